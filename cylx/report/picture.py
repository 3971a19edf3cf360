"""The result as a picture: points by cylinder, and the outlines of the cylinders, from obliquely above."""

from __future__ import annotations

import io
import warnings
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from cylx.errors import UsageError
from cylx.geometry.cylinder import Cylinder, axis_frame
from cylx.json_parts import Input
from cylx.palette import cylinder_colors
from cylx.report.points import choose_points

if TYPE_CHECKING:
    from cylx.records import Extraction

MOST_POINTS = 60_000
INCHES, DPI = (9.6, 7.2), 125
ELEVATION, AZIMUTH = 25.0, -60.0
_RULINGS, _AROUND = 4, 48
_OUTLYING = 0.002


def check_pictures() -> None:
    """Refuse to draw where the drawing library is missing, before anything is computed.

    Raises
    ------
    UsageError
        If matplotlib is not installed.
    """
    try:
        import matplotlib.figure  # noqa: F401, PLC0415  an extra
    except ImportError:
        raise UsageError("the picture", "matplotlib is not installed", "pip install 'cylx[plots]'") from None


def png_of(extraction: Extraction) -> bytes:
    """Draw an extraction.

    Parameters
    ----------
    extraction : Extraction
        What a run found out.

    Returns
    -------
    bytes
        A PNG of 1200 by 900 pixels.

    Raises
    ------
    UsageError
        If matplotlib is not installed.
    """
    check_pictures()
    from matplotlib.backends.backend_agg import FigureCanvasAgg  # noqa: PLC0415
    from matplotlib.figure import Figure  # noqa: PLC0415

    canvas = Figure(figsize=INCHES, dpi=DPI)
    FigureCanvasAgg(canvas)
    axes: Any = canvas.add_axes((0.02, 0.02, 0.94, 0.92), projection="3d", elev=ELEVATION, azim=AZIMUTH)
    chosen = choose_points(extraction.labels, MOST_POINTS, np.random.default_rng(extraction.config.seed))
    points, labels = extraction.cloud.points[chosen], extraction.labels[chosen]
    low, high = np.quantile(points, (_OUTLYING, 1 - _OUTLYING), axis=0)
    shown = ((points >= low) & (points <= high)).all(axis=1) | (labels >= 0)
    colors = np.column_stack([cylinder_colors(labels[shown]) / 255.0, np.where(labels[shown] < 0, 0.5, 0.9)])
    axes.scatter(*points[shown].T, c=colors, s=2.5, marker=".", linewidths=0, depthshade=False, rasterized=True)
    for number, fit in enumerate(extraction.cylinders):
        color = cylinder_colors(np.array([number]))[0] / 255.0 * 0.6
        for line in outline(fit.cylinder):
            axes.plot(*line.T, color=color, linewidth=1.0)
    _frame(axes, points[shown] if shown.any() else points)
    count = len(extraction.cylinders)
    title = f"{_printable(Input.of(extraction).file)}: {count} cylinder{'' if count == 1 else 's'}"
    canvas.suptitle(title, fontsize=13, parse_math=False)
    picture = io.BytesIO()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # letters of a name that the font has not
        canvas.savefig(picture, format="png", dpi=DPI)
    return picture.getvalue()


def outline(cylinder: Cylinder) -> list[NDArray[np.float64]]:
    """Give the lines a cylinder is drawn by: its two rims, and straight lines between them.

    Parameters
    ----------
    cylinder : Cylinder

    Returns
    -------
    list of ndarray of shape (n, 3)
    """
    across, along = axis_frame(cylinder.direction)
    angles = np.linspace(0, 2 * np.pi, _AROUND + 1)
    circle = cylinder.radius * (np.outer(np.cos(angles), across) + np.outer(np.sin(angles), along))
    rims = [cylinder.start + circle, cylinder.end + circle]
    return [*rims, *(np.array([rims[0][i], rims[1][i]]) for i in range(0, _AROUND, _AROUND // _RULINGS))]


def _frame(axes: Any, points: NDArray[np.float64]) -> None:  # noqa: ANN401  (it has no types)
    """Show all points, at the same scale along all axes."""
    low, high = points.min(axis=0), points.max(axis=0)
    size = np.maximum(high - low, 0.05 * float((high - low).max()) or 1.0)
    middle = 0.5 * (low + high)
    for axis, center, width in zip("xyz", middle, size, strict=True):
        getattr(axes, f"set_{axis}lim")(center - 0.5 * width, center + 0.5 * width)
        getattr(axes, f"set_{axis}label")(axis)
        axes.tick_params(axis=axis, labelsize=8)
        getattr(axes, f"{axis}axis").get_major_locator().set_params(nbins=5)
    axes.set_box_aspect(size, zoom=1.08)


def _printable(name: str) -> str:
    """Leave out of a name what cannot be drawn on one line, and the middle of a very long one."""
    name = "".join(letter if letter.isprintable() else "?" for letter in name)
    return name if len(name) <= 80 else f"{name[:38]} … {name[-38:]}"
