"""Plots of a result: the unrolled residuals of a cylinder, and radii with their uncertainty."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from cylx.errors import UsageError
from cylx.geometry.arrays import FloatArray
from cylx.optional.matplotlib import new_figure
from cylx.palette import cylinder_colors
from cylx.records import Extraction
from cylx.report.maps import EMPTY, unroll
from cylx.report.view import View

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike

    from cylx.records import PointCloud
    from cylx.results import Result


DPI = 125


def plot_residuals(
    found: Extraction | Result, cylinder: int = 0, cloud: PointCloud | ArrayLike | None = None
) -> Figure:
    """Draw the unrolled surface of a cylinder with the residuals of its points, by angle and height.

    Parameters
    ----------
    found : Extraction or Result
    cylinder : int
        Its `id`.
    cloud : PointCloud, optional
        The annotated cloud of a `Result`, as returned by `read_cloud`. An `Extraction` has its own.

    Returns
    -------
    matplotlib.figure.Figure
        Each cell shows the mean residual of its points, blue inside and red outside; grey cells have no points. The
        angle 0 is the upper side, or towards x for an upright cylinder; heights begin at `start`.

    Raises
    ------
    UsageError
        If there is no such cylinder, it has no points, or matplotlib is not installed.
    """
    view = View.of(found, cloud)
    count = len(view.shapes)
    if not 0 <= cylinder < count:
        ids = f"its ids are 0 to {count - 1}" if count else "it has none"
        raise UsageError("cylinder", f"there is no cylinder {cylinder}", f"choose another; {ids}")
    own = (view.labels == cylinder) & np.isfinite(view.residuals)
    if not own.any():
        remedy = "give the annotated cloud, as cylx.read_cloud('scan.annotated.ply')"
        raise UsageError("cloud", f"it has no points of cylinder {cylinder}", remedy)
    shape = view.shapes[cylinder]
    unrolled = unroll(view.points[own], view.residuals[own].astype(np.float64), shape, view.noise)
    means = np.where(unrolled.means == EMPTY, np.nan, unrolled.means / 127.0 * unrolled.reach)
    figure = new_figure((7.2, 4.8), DPI, layout="constrained")
    axes: Any = figure.add_subplot()
    axes.set_facecolor("0.85")
    limit = unrolled.limit
    extent = (-180.0, 180.0, 0.0, shape.height or 1.0)
    image = axes.imshow(
        means,
        origin="lower",
        extent=extent,
        aspect="auto",
        cmap="RdBu_r",
        vmin=-limit,
        vmax=limit,
        interpolation="none",
    )
    axes.set_xticks(range(-180, 181, 90))
    axes.set_xlabel(f"angle about the axis, degrees (0 is towards {unrolled.zero})")
    axes.set_ylabel("height above the start")
    axes.set_title(f"cylinder {cylinder}: radius {shape.radius:.5g}, {int(own.sum())} points")
    figure.colorbar(image, ax=axes, label="mean residual, + is outside")
    return figure


def plot_radii(found: Extraction | Result, reference: Sequence[float] | None = None) -> Figure:
    """Draw the radius of each cylinder with its standard deviation, or its difference from a reference.

    Parameters
    ----------
    found : Extraction or Result
    reference : sequence of float, optional
        A radius for each cylinder to compare with, scene units, in the order of the ids: true, nominal, or from an
        earlier scan. NaN for none.

    Returns
    -------
    matplotlib.figure.Figure
        A dot for each, with a bar of two standard deviations in both directions if the uncertainty was computed.

    Raises
    ------
    UsageError
        If the number of references differs from that of cylinders, or matplotlib is not installed.
    """
    radii, deviations = _radii_of(found)
    if reference is not None and len(reference) != len(radii):
        fault = f"{len(reference)} radii for {len(radii)} cylinders"
        raise UsageError("reference", fault, "give one for each, in the order of the ids; NaN for none")
    figure = new_figure((7.2, max(2.4, min(0.9 + 0.28 * len(radii), 40.0))), DPI, layout="constrained")
    axes: Any = figure.add_subplot()
    rows = np.arange(len(radii))
    values = radii if reference is None else radii - np.asarray(reference, dtype=np.float64)
    for row in rows:
        color = cylinder_colors(np.array([row]))[0] / 255.0 * 0.85
        deviation = deviations[row]
        bar = None if deviation is None else 2.0 * deviation
        axes.errorbar(values[row], row, xerr=bar, fmt="o", color=color, markersize=4, capsize=3)
        text = with_deviation(radii[row], deviation)
        axes.annotate(text, (1.01, row), xycoords=("axes fraction", "data"), va="center", fontsize=8)
    if reference is None:
        axes.set_xlim(left=0.0)
        axes.set_xlabel("radius")
    else:
        axes.axvline(0.0, color="grey", linewidth=0.8)
        axes.set_xlabel("radius minus reference")
    axes.set_yticks(rows)
    axes.set_ylim(max(len(radii), 1) - 0.5, -0.5)
    axes.set_ylabel("cylinder")
    axes.grid(axis="x", linewidth=0.4)
    axes.set_title("bars of two standard deviations", fontsize=10)
    return figure


def _radii_of(found: Extraction | Result) -> tuple[FloatArray, list[float | None]]:
    """Return the radii and their standard deviations, None if unknown."""
    if isinstance(found, Extraction):
        pairs = [(fit.cylinder.radius, fit.radius_sd) for fit in found.cylinders]
    else:
        pairs = [(one.radius, one.uncertainty.radius if one.uncertainty else None) for one in found.cylinders]
    return np.array([radius for radius, _ in pairs], dtype=np.float64), [deviation for _, deviation in pairs]


def with_deviation(value: float, deviation: float | None) -> str:
    """Format a number with as many decimals as its standard deviation justifies.

    Parameters
    ----------
    value : float
    deviation : float or None
        None or 0 if it is unknown.
    """
    if deviation is None or not 0.0 < deviation < math.inf:
        return f"{value:.5g}"
    decimals = min(12, max(0, 1 - math.floor(math.log10(deviation))))
    return f"{value:.{decimals}f} ± {deviation:.{decimals}f}"
