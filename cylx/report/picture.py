"""The result as a picture: points by cylinder, and the outlines of the cylinders, obliquely from above."""

from __future__ import annotations

import io
import warnings
from typing import TYPE_CHECKING, Any

import numpy as np

from cylx.geometry.arrays import FloatArray
from cylx.geometry.cylinder import Cylinder, axis_basis
from cylx.optional.matplotlib import new_figure
from cylx.palette import cylinder_colors
from cylx.report.points import choose_points
from cylx.report.view import View

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike

    from cylx.records import Extraction, PointCloud
    from cylx.results import Result

MOST_POINTS = 60_000
INCHES, DPI = (9.6, 7.2), 125
ELEVATION, AZIMUTH = 25.0, -60.0
_RULINGS, _AROUND = 4, 48
_OUTLYING = 0.002


def png_of(extraction: Extraction) -> bytes:
    """Draw an extraction.

    Parameters
    ----------
    extraction : Extraction
        The output of a run.

    Returns
    -------
    bytes
        A PNG of 1200 by 900 pixels.

    Raises
    ------
    UsageError
        If matplotlib is not installed.
    """
    picture = io.BytesIO()
    figure = plot_scene(extraction)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # about letters of a name that the font lacks
        figure.savefig(picture, format="png", dpi=DPI)
    return picture.getvalue()


def plot_scene(found: Extraction | Result, cloud: PointCloud | ArrayLike | None = None) -> Figure:
    """Draw points by cylinder, or by run if there are runs, and the outlines of cylinders, obliquely from above.

    Parameters
    ----------
    found : Extraction or Result
    cloud : PointCloud or array_like of shape (N, 3), optional
        The points of a `Result`, as returned by `read_cloud`; those of the annotated cloud are coloured by cylinder. An
        `Extraction` has its own.

    Returns
    -------
    matplotlib.figure.Figure
        Of 9.6 by 7.2 inches; `savefig` writes it, and a notebook shows it. At most 60 000 points are drawn.

    Raises
    ------
    UsageError
        If matplotlib is not installed, or a cloud is given with an extraction.
    """
    view = View.of(found, cloud)
    canvas = new_figure(INCHES, DPI)
    axes: Any = canvas.add_axes((0.02, 0.02, 0.94, 0.92), projection="3d", elev=ELEVATION, azim=AZIMUTH)
    chosen = choose_points(view.labels, MOST_POINTS, np.random.default_rng(view.seed))
    points, labels = view.points[chosen], view.labels[chosen]
    # the last tone is what label -1 maps to
    tones = np.array([*(range(len(view.shapes)) if view.runs is None else view.runs), -1])
    lines = [outline(shape) for shape in view.shapes]
    if len(points):
        low, high = np.quantile(points, (_OUTLYING, 1 - _OUTLYING), axis=0)
        shown = ((points >= low) & (points <= high)).all(axis=1) | (labels >= 0)
        colors = np.column_stack([cylinder_colors(tones[labels][shown]) / 255.0, np.where(labels[shown] < 0, 0.5, 0.9)])
        axes.scatter(*points[shown].T, c=colors, s=2.5, marker=".", linewidths=0, depthshade=False, rasterized=True)
        points = points[shown] if shown.any() else points
    elif lines:
        points = np.concatenate([line for cylinder in lines for line in cylinder])
    for number, cylinder in enumerate(lines):
        color = cylinder_colors(tones[[number]])[0] / 255.0 * 0.6
        for line in cylinder:
            axes.plot(*line.T, color=color, linewidth=1.0)
    for owner, piece in view.fittings:
        color = cylinder_colors(tones[[owner]])[0] / 255.0 * 0.6
        for rim in outline(piece)[:2]:
            axes.plot(*rim.T, color=color, linewidth=0.6)
    if len(points):
        _frame(axes, points)
    count = len(view.shapes)
    title = f"{_printable(view.name)}: {count} cylinder{'' if count == 1 else 's'}"
    canvas.suptitle(title, fontsize=13, parse_math=False)
    return canvas


def outline(cylinder: Cylinder) -> list[FloatArray]:
    """Return the outline of a cylinder: its two rims, and straight lines between them.

    Parameters
    ----------
    cylinder : Cylinder

    Returns
    -------
    list of ndarray of shape (n, 3)
    """
    across, along = axis_basis(cylinder.direction)
    angles = np.linspace(0, 2 * np.pi, _AROUND + 1)
    circle = cylinder.radius * (np.outer(np.cos(angles), across) + np.outer(np.sin(angles), along))
    rims = [cylinder.start + circle, cylinder.end + circle]
    return [*rims, *(np.array([rims[0][i], rims[1][i]]) for i in range(0, _AROUND, _AROUND // _RULINGS))]


def _frame(axes: Any, points: FloatArray) -> None:  # noqa: ANN401  (it has no types)
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
    """Remove from a name the characters that cannot be drawn on one line, and the middle of a very long name."""
    name = "".join(letter if letter.isprintable() else "?" for letter in name)
    return name if len(name) <= 80 else f"{name[:38]} … {name[-38:]}"
