"""A scan against the cylinders of a design: where each is, how large and how round, and where it is dented."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from os import PathLike
from typing import TYPE_CHECKING

from cylx.api.clouds import chosen_cloud
from cylx.deviation import Comparison, Tolerances, compare_with_design
from cylx.errors import UsageError
from cylx.geometry.cylinder import Cylinder
from cylx.io import recorded_name
from cylx.io.design import read_design
from cylx.records import Crop, PointCloud
from cylx.records.designs import Design, DesignCylinder, Triple
from cylx.units import METRES

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from cylx.geometry.arrays import FloatArray


def measure_deviations(
    points_or_path: ArrayLike | PointCloud | str | PathLike[str],
    design: Design | Sequence[Cylinder] | str | PathLike[str],
    *,
    offset: float | None = None,
    tilt_deg: float | None = None,
    radius: float | None = None,
    cylindricity: float | None = None,
    ovality: float | None = None,
    taper: float | None = None,
    dent: float | None = None,
    within: float | None = None,
    cell: float | None = None,
    units: str | None = None,
    design_units: str | None = None,
    crop: Crop | None = None,
    voxel: float | None = None,
    every: int | None = None,
    classes: Sequence[int] | None = None,
    scan: int | None = None,
) -> Comparison:
    """Compare a scan with the cylinders of a design, which is in its coordinates; the same as `cylx deviation`.

    Parameters
    ----------
    points_or_path : array_like of shape (N, 3), PointCloud, str or Path
        Coordinates in any unit, or a file that holds them.
    design : str, Path, Design, or sequence of Cylinder
        A result or a truth (.json), a table (.csv), solids (.step, .ifc), or cylinders with a height in the unit of the
        points.
    offset : float, optional
        Allowed distance of an axis from that of the design, in the unit of the points; by default it is not checked,
        and likewise the others.
    tilt_deg : float, optional
        Allowed angle between the axes, degrees.
    radius : float, optional
        Allowed difference of the radius, either way, in the unit of the points.
    cylindricity : float, optional
        Allowed cylindricity (ISO 1101, minimum zone), in the unit of the points.
    ovality : float, optional
        Allowed difference of the largest and smallest diameter, in the unit of the points.
    taper : float, optional
        Allowed change of the diameter per length, either way.
    dent : float, optional
        Allowed depth of dents and bulges, in the unit of the points.
    within : float, optional
        How far from a design surface its points may be, in the unit of the points; by default 15 % of its radius.
    cell : float, optional
        Side of the cells in which a surface is measured, in the unit of the points; by default of 25 points or so.
    units : str, optional
        Unit of the points, such as `m` or `mm`; by default what the file says.
    design_units : str, optional
        Unit of the design, if its file does not say it.
    crop, voxel, every, classes, scan
        As for `extract`.

    Returns
    -------
    Comparison
        `deviations` has one entry for each cylinder of the design, `verdict` is the worst of all checks.

    Raises
    ------
    InputError
        If a file cannot be read.
    UsageError
        If a unit is unknown, contradicts the file of the design, or is missing for the points while the design has one.
    ValueError
        If the shape of the array is not (N, 3), or the selection of points is impossible.

    Examples
    --------
    >>> import cylx, cylx.synthetic
    >>> pipe = cylx.synthetic.single(points=4000, seed=1)
    >>> compared = cylx.measure_deviations(pipe.points, [one.cylinder for one in pipe.cylinders], radius=0.01)
    >>> compared.verdict, abs(compared.deviations[0].measured.radius) < 0.01
    ('pass', True)
    """
    for name, unit in (("units", units), ("design_units", design_units)):
        if unit is not None and unit not in METRES:
            raise UsageError(name, f"{unit!r} is no unit of length", f"choose one of {', '.join(METRES)}")
    place = str(design) if isinstance(design, str | PathLike) else "the design"
    file = recorded_name(place) if isinstance(design, str | PathLike) else ""
    drawn = _design_of(design)
    if design_units is not None:
        drawn = _with_units(drawn, design_units, place)
    cloud = chosen_cloud(points_or_path, units, crop=crop, voxel=voxel, every=every, classes=classes, scan=scan)
    scale = _scale_of(drawn, units or cloud.source.units, place)
    limits = Tolerances(offset, tilt_deg, radius, cylindricity, ovality, taper, dent)
    return compare_with_design(cloud, drawn, limits, file=file, scale=scale, within=within, cell=cell)


def _design_of(given: Design | Sequence[Cylinder] | str | PathLike[str]) -> Design:
    """Return the design that was given, in whatever form."""
    if isinstance(given, Design):
        return given
    if isinstance(given, str | PathLike):
        return read_design(str(given))
    drawn = tuple(
        DesignCylinder(str(k), _triple(one.start), _triple(one.end), float(one.radius)) for k, one in enumerate(given)
    )
    return Design("json", None, None, drawn)


def _triple(place: FloatArray) -> Triple:
    return float(place[0]), float(place[1]), float(place[2])


def _with_units(drawn: Design, units: str, place: str) -> Design:
    """Return a design whose unit is given; a file that says another is refused."""
    if drawn.units not in {None, units}:
        raise UsageError("--design-units", f"{place} is in {drawn.units}", "leave it out")
    return replace(drawn, units=units, metres=METRES[units])


def _scale_of(drawn: Design, units: str | None, place: str) -> float:
    """Return what the lengths of a design are multiplied by, to be in the unit of the scan."""
    if drawn.metres is None:
        return 1.0
    if units is None:
        if drawn.format == "json":
            return 1.0
        fault = f"has a unit, {drawn.units or f'{drawn.metres:g} m'}, and the scan says none"
        raise UsageError(place, fault, "give that of the scan by --units")
    ratio = drawn.metres / METRES[units]
    return 1.0 if abs(ratio - 1.0) < 1e-9 else ratio
