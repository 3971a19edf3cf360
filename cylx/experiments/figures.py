"""The paper's figures 5 to 12 as lists of cells: parameters varied, their values, and the methods.

The paper's numbers are used where it gives them. It does not give the number of points (10 000 here), the height (4
radii), p of eq. 2 (0.9), the thickness of slices (0.05 radii) and the distance within which a point supports an ellipse
(0.06 radii, or four sigma if that is more), the two shares of outliers of figure 5 (0.1 and 0.4, with sigma = 0.01 and
sigma_o = 0.04), the distances of Tran et al. and Jin et al. (those of MSAC), nor most of the positions along the x
axes. The best cluster is used, however small it is.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from cylx.config.choices import METHODS

POINTS, HEIGHT = 10_000, 4.0
COMPETITORS = tuple(method for method in METHODS if method != "gt")
CURVES = (*METHODS, "auto")
"""The paper's method and its competitors as the paper has them, and the default of cylx."""
UNSURE = "auto, 0.02"
"""The default method with confidence from 0.02: the other methods accept their results, however unlikely."""

_UNIT = ("msac.distance=0.03", "tran.distance=0.03", "jin.distance=0.03", "jin.neighbourhood=1.2")
_ANY_CLUSTER = ("clustering.min_support=1", "clustering.min_payoff=0")
_FROM_LITTLE = ("verification.min_confidence=0.02",)
_UPRIGHT = ("scene.axis=[0, 0, 1]", "scene.axis_tolerance_deg=90")  # reference for the inclination, without a limit
_NOISY_TRAN = ("tran.neighbours=100", "tran.start_neighbours=200")


class Cell(NamedTuple):
    """One setting of a figure; it is run many times.

    Parameters
    ----------
    panel : str
        Column of the figure.
    curve : str
        Its name in the legend.
    x : float
        Its position on the x axis.
    method : str
        `gt` (the paper's), one of its competitors, or `auto`.
    scene : tuple of (str, float)
        Parameters of the scene.
    settings : tuple of str
        Each of the form `section.key=value`.
    """

    panel: str
    curve: str
    x: float
    method: str
    scene: tuple[tuple[str, float], ...]
    settings: tuple[str, ...] = ()


class Figure(NamedTuple):
    """A figure of the paper.

    Parameters
    ----------
    number : int
    title : str
    kind : str
        `cylinder`: one synthetic cylinder, three errors; `cans`: two scanned cans, the angle between them; `time` and
        `cans time`: seconds.
    x_label : str
    cells : tuple of Cell
    logarithmic : bool
        Whether the y axis is logarithmic.
    boxes : bool
        Whether to draw boxes rather than means.
    """

    number: int
    title: str
    kind: str
    x_label: str
    cells: tuple[Cell, ...]
    logarithmic: bool = False
    boxes: bool = False

    @property
    def needs_scan(self) -> bool:
        """Whether it needs the scan of an object."""
        return self.kind.startswith("cans")

    @property
    def panels(self) -> list[str]:
        """Columns, in order."""
        return list(dict.fromkeys(cell.panel for cell in self.cells))


def _single(**changes: float) -> tuple[tuple[str, float], ...]:
    """Return the parameters of a synthetic cylinder."""
    return tuple({"points": POINTS, "height": HEIGHT, **changes}.items())


def _of_methods(
    panel: str, x: float, scene: tuple[tuple[str, float], ...], planes: int, settings: tuple[str, ...] = _UNIT
) -> Iterator[Cell]:
    """Yield the cells of all methods at one position."""
    for method in CURVES:
        own = () if method == "auto" else (*_slices(planes, scene), *settings)
        yield Cell(panel, method, x, method, scene, own)


def _slices(planes: int, scene: tuple[tuple[str, float], ...]) -> tuple[str, ...]:
    """Return the settings of the paper's own method, also used by the line fit."""
    tolerance = max(0.06, 4 * dict(scene)["sigma"])
    slices = (f"slicing.planes={planes}", "slicing.thickness=0.05", f"ellipses.tolerance={tolerance:g}")
    return *slices, *_ANY_CLUSTER


def _figure_5() -> Iterator[Cell]:
    for panel, p in (("few outliers (p = 0.1)", 0.1), ("many outliers (p = 0.4)", 0.4)):
        for theta in (50, 90, 135, 360):
            scene = _single(sigma=0.01, sigma_o=0.04, p=p, theta_deg=theta)
            for planes in (10, 20, 30, 40, 60, 90):
                yield Cell(panel, f"gt {theta}°", planes, "gt", scene, _slices(planes, scene))
            yield Cell(panel, f"auto {theta}°", 40, "auto", scene)


def _figure_6() -> Iterator[Cell]:
    for panel, sigma in (("low noise (sigma = 0.001)", 0.001), ("high noise (sigma = 0.1)", 0.1)):
        scene = _single(sigma=sigma, sigma_o=0.05, p=0.1)
        for low in range(0, 90, 10):
            inclination = f"slicing.inclination_deg=[{low}, {low + 10}]"
            yield Cell(panel, "gt", low + 5, "gt", scene, (*_slices(20, scene), inclination, *_UPRIGHT))


def _figure_7() -> Iterator[Cell]:
    for sigma in (0.001, 0.005, 0.01, 0.02, 0.03, 0.04, 0.05):
        yield from _of_methods("", sigma, _single(sigma=sigma, sigma_o=0.04, p=0.3), 20)


def _figure_8() -> Iterator[Cell]:
    settings = (*_UNIT, *_NOISY_TRAN)
    for p in (0.1, 0.2, 0.3, 0.4, 0.5):
        yield from _of_methods("p, at sigma_o = 0.1", p, _single(sigma=0.001, sigma_o=0.1, p=p), 20, settings)
    for sigma_o in (0.05, 0.1, 0.15, 0.2):
        scene = _single(sigma=0.001, sigma_o=sigma_o, p=0.4)
        yield from _of_methods("sigma_o, at p = 0.4", sigma_o, scene, 20, settings)


def _figure_9() -> Iterator[Cell]:
    for theta in (30, 50, 70, 90, 110, 135, 180, 270, 360):
        yield from _of_methods("", theta, _single(sigma=0.005, sigma_o=0.01, p=0.1, theta_deg=theta), 40)


def _figure_10() -> Iterator[Cell]:
    for sigma in (0.001, 0.01, 0.03, 0.05):
        yield from _of_methods("sigma, at p = 0.1", sigma, _single(sigma=sigma, sigma_o=0.05, p=0.1), 20)
    for p in (0.1, 0.3, 0.5):
        yield from _of_methods("p, at sigma = 0.01", p, _single(sigma=0.01, sigma_o=0.05, p=p), 20)


def _of_scan_methods(panel: str, x: float, scene: dict[str, float], planes: int, iterations: int) -> Iterator[Cell]:
    """Yield the cells of all methods that find several cylinders; distances are set later from the scan's size."""
    normals = ("msac.neighbours=80", "tran.neighbours=80", f"msac.iterations={iterations}")
    for method in CURVES:
        if method != "line-fit":
            own = () if method == "auto" else (f"slicing.planes={planes}", *_ANY_CLUSTER, *normals)
            yield Cell(panel, method, x, method, tuple(scene.items()), own)


def _figure_11() -> Iterator[Cell]:
    for percent in (30, 50, 70, 100):
        scene = {"share": percent / 100}
        yield from _of_scan_methods("points kept, %", percent, scene, 40, 4000)
        yield Cell("points kept, %", UNSURE, percent, "auto", tuple(scene.items()), _FROM_LITTLE)
    for panel, side in (
        ("least angle of normal and (0, 1, 0), °", 1.0),
        ("least angle of normal and (0, -1, 0), °", -1.0),
    ):
        for view in (0, 30, 60, 90, 105, 120):
            scene = {"share": 0.8, "view_deg": float(view), "side": side}
            yield from _of_scan_methods(panel, view, scene, 50, 5000)
            yield Cell(panel, UNSURE, view, "auto", tuple(scene.items()), _FROM_LITTLE)


def _figure_12() -> Iterator[Cell]:
    for points in (300_000, 500_000, 700_000, 1_000_000):
        yield from _of_scan_methods("", points / 1000, {"cans": 5, "points": points}, 20, 5000)


FIGURES = {
    figure.number: figure
    for figure in (
        Figure(5, "planes and coverage", "cylinder", "slicing planes", tuple(_figure_5()), logarithmic=True),
        Figure(6, "inclination of planes", "cylinder", "angle of normals and axis, °", tuple(_figure_6()), boxes=True),
        Figure(7, "Gaussian noise", "cylinder", "sigma, radii", tuple(_figure_7()), logarithmic=True),
        Figure(8, "outliers", "cylinder", "share, or magnitude in radii", tuple(_figure_8()), logarithmic=True),
        Figure(9, "coverage", "cylinder", "coverage, °", tuple(_figure_9()), logarithmic=True),
        Figure(10, "time of one cylinder", "time", "share, or sigma in radii", tuple(_figure_10()), logarithmic=True),
        Figure(11, "two cans", "cans", "", tuple(_figure_11()), logarithmic=True),
        Figure(12, "time of five cans", "cans time", "thousand points", tuple(_figure_12()), logarithmic=True),
    )
}  # fmt: skip
"""By number."""
