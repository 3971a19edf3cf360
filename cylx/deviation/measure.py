"""Measure each design cylinder in a scan: its points, its cylinder with uncertainties, its form and its dents."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cylx.deviation.assign import WITHIN, assign
from cylx.deviation.form import Form, Smooth, form_of, smooth_of
from cylx.deviation.surface import Cells, Patch, cells_of, patches_of, sharpened
from cylx.errors import InputError
from cylx.geometry.arrays import FloatArray
from cylx.geometry.cylinder import Cylinder, axis_basis, cylinder_between, cylinder_coordinates
from cylx.pipeline.segmented import fit_cylinder
from cylx.records import CylinderFit
from cylx.records.designs import Design

MOST_POINTS_TO_FIT = 100_000
ROUNDS = 2
"""Times that points are assigned and fitted: first about the design, then about what was found."""
FURTHEST = 1.0
"""A cylinder whose axis is further off than this many design radii, or has another radius by as much, is another."""


@dataclass(frozen=True, slots=True, eq=False)
class Measured:
    """A design cylinder as it was built.

    Parameters
    ----------
    fit : CylinderFit
        Its cylinder between the ends of its points, with a covariance that holds the form of the surface, too.
    offset, offset_sd : float
        Distance of its axis from the design axis, across that, at its middle; scene units.
    shift : ndarray of shape (3,)
        The same as a vector, from the design to what was built.
    tilt, tilt_sd : float
        Angle between the axes, radians.
    radius, radius_sd : float
        Radius minus that of the design, scene units.
    cells : Cells
        Its surface.
    form : Form or None
        None if there are too few points.
    patches : tuple of Patch
        Dents and bulges, the deepest first.
    """

    fit: CylinderFit
    offset: float
    offset_sd: float
    shift: FloatArray
    tilt: float
    tilt_sd: float
    radius: float
    radius_sd: float
    cells: Cells
    form: Form | None
    patches: tuple[Patch, ...]

    def place_of(self, patch: Patch) -> FloatArray:
        """Return the middle of a patch, on the cylinder, scene units."""
        shape = self.fit.cylinder
        across, along = axis_basis(shape.direction)
        radial = math.cos(patch.angle) * across + math.sin(patch.angle) * along
        return np.asarray(shape.point + patch.height * shape.direction + shape.radius * radial)


@dataclass(frozen=True, slots=True, eq=False)
class Deviation:
    """A design cylinder, and what was found of it.

    Parameters
    ----------
    design : Cylinder
    points : int
        Number of points near its surface.
    measured : Measured or None
        None if the points do not determine a cylinder.
    fault : str
        Why not; empty if they do.
    """

    design: Cylinder
    points: int
    measured: Measured | None
    fault: str = ""


def measure_deviations(
    points: FloatArray,
    designs: Sequence[Cylinder],
    *,
    within: float | None = None,
    cell: float | None = None,
    least_depth: float = 0.0,
) -> tuple[list[Deviation], NDArray[np.int32], FloatArray]:
    """Measure design cylinders in a scan that is in the coordinates of the design.

    Parameters
    ----------
    points : ndarray of shape (N, 3)
        Scene units.
    designs : sequence of Cylinder
        Their heights are > 0.
    within : float, optional
        How far from a design surface its points may be, scene units; by default 15 % of its radius.
    cell : float, optional
        Side of the cells in which the surface is measured, scene units; by default they have about 25 points each.
    least_depth : float
        Dents and bulges less deep than this do not matter, scene units.

    Returns
    -------
    deviations : list of Deviation
        One for each design.
    labels : ndarray of shape (N,), int32
        Number of the design cylinder of each point; -1 for none.
    residuals : ndarray of shape (N,)
        Distance of each from the cylinder that was found, + is outside; NaN for none.
    """
    origin = points.mean(axis=0)
    local = points - origin
    moved = [design.moved(-origin) for design in designs]
    widths = [WITHIN * design.radius if within is None else within for design in designs]
    found: list[CylinderFit | str] = []
    shapes: list[Cylinder | None] = list(moved)
    labels, residuals = assign(local, shapes, widths)
    counts = np.bincount(labels[labels >= 0], minlength=len(designs))
    for _ in range(ROUNDS):
        found = [_fit(local[labels == k], shapes[k] or moved[k], moved[k]) for k in range(len(designs))]
        shapes = [_within_ends(one, design) for one, design in zip(found, moved, strict=True)]
        labels, residuals = assign(local, shapes, widths)
    out = []
    for k, (one, design) in enumerate(zip(found, designs, strict=True)):
        if isinstance(one, str):
            out.append(Deviation(design, int(counts[k]), None, one))
            continue
        own = labels == k
        measured = _measure(local[own], one, moved[k], origin, cell, least_depth)
        out.append(Deviation(design, int(own.sum()), measured))
    return out, labels, residuals


def shapes_of(design: Design, scale: float = 1.0) -> list[Cylinder]:
    """Return the cylinders of a design, its lengths times a scale."""
    return [
        cylinder_between(np.array(one.start) * scale, np.array(one.end) * scale, one.radius * scale)
        for one in design.cylinders
    ]


def _within_ends(found: CylinderFit | str, design: Cylinder) -> Cylinder | None:
    """Return a cylinder that was found between the ends of its design."""
    if isinstance(found, str):
        return None
    shape = found.cylinder
    middle = shape.point + ((design.point - shape.point) @ shape.direction) * shape.direction
    return Cylinder(middle, shape.direction, shape.radius, design.height)


def _fit(points: FloatArray, start: Cylinder, design: Cylinder) -> CylinderFit | str:
    """Fit a cylinder to the points of a design; a text says why it cannot be."""
    if len(points) > MOST_POINTS_TO_FIT:
        points = points[:: -(-len(points) // MOST_POINTS_TO_FIT)]
    try:
        fit = fit_cylinder(points, start=start)
    except InputError as error:
        return error.fault
    shape = fit.cylinder
    away = shape.point - design.point
    off = float(np.linalg.norm(away - (away @ design.direction) * design.direction))
    if max(off, abs(shape.radius - design.radius)) > FURTHEST * design.radius:
        return "the points near it are those of another cylinder"
    return fit


def _measure(
    points: FloatArray, fit: CylinderFit, design: Cylinder, origin: FloatArray, side: float | None, least: float
) -> Measured:
    shape = fit.cylinder
    heights, distances, angles = cylinder_coordinates(points, shape.point, shape.direction)
    low, high = (float(heights.min()), float(heights.max())) if len(heights) else (0.0, 0.0)
    point = shape.point + 0.5 * (low + high) * shape.direction
    shape = Cylinder(point, shape.direction, shape.radius, max(high - low, 1e-9 * shape.radius))
    residuals = distances - shape.radius
    cells = cells_of(heights - 0.5 * (low + high), angles, residuals, shape.radius, shape.height, side)
    smooth = smooth_of(cells)
    patches: list[Patch] = []
    form = None
    if smooth is not None:
        middle = heights - 0.5 * (low + high)
        off = residuals - smooth.at(angles, middle)
        rough = patches_of(cells, smooth.off, shape.radius, least)
        patches = [sharpened(one, cells, middle, angles, off, shape.radius) for one in rough]
        form = form_of(cells, shape.radius, smooth, _peaks(patches, smooth))
    covariance = np.zeros((5, 5)) if fit.covariance is None else fit.covariance
    if smooth is not None:  # the larger: cells also scatter by the form of the surface
        covariance = max((covariance, smooth.of_cylinder), key=lambda one: float(np.trace(one)))
    rmse = float(np.sqrt(np.mean(residuals**2))) if len(residuals) else 0.0
    whole = CylinderFit(
        shape.moved(origin), len(points), rmse, cells.coverage if len(cells.cells) else fit.coverage, 0, None,
        covariance=covariance,
    )  # fmt: skip
    along = design.direction * np.sign(design.direction @ shape.direction or 1.0)
    away = shape.point - design.point
    # where the axis meets the section of the design in which the middle of what was seen lies
    shift = away - (away @ design.direction) * design.direction
    tilt = math.atan2(float(np.linalg.norm(np.cross(along, shape.direction))), float(along @ shape.direction))
    return Measured(
        whole, float(np.linalg.norm(shift)), _widest(covariance[:2, :2]), shift, tilt, _widest(covariance[2:4, 2:4]),
        shape.radius - design.radius, math.sqrt(max(float(covariance[4, 4]), 0.0)), cells, form,
        tuple(sorted(patches, key=lambda patch: -patch.depth)),
    )  # fmt: skip


def _peaks(patches: Sequence[Patch], smooth: Smooth) -> FloatArray:
    """Return angle, height and value of the deepest place of each patch, shape (k, 3)."""
    rows = [(*patch.deepest, -patch.depth if patch.kind == "dent" else patch.depth) for patch in patches]
    peaks = np.array(rows, dtype=np.float64).reshape(-1, 3)
    peaks[:, 2] += smooth.at(peaks[:, 0], peaks[:, 1])
    return peaks


def _widest(covariance: FloatArray) -> float:
    """Return the standard deviation in the least certain direction."""
    return float(np.sqrt(max(float(np.linalg.eigvalsh(covariance)[-1]), 0.0)))
