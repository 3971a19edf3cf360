"""What can be measured of a segment against the points in and about it; none of it needs normals."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from cylx.geometry.arrays import FloatArray, IndexArray, MaskArray
from cylx.geometry.cylinder import RADIUS, coordinates_of
from cylx.geometry.kernels import njit
from cylx.geometry.numerics import fill_basis
from cylx.records import IndexedCloud, Segment

TRUNCATED = 0.9866
"""Standard deviation of a Gaussian cut off at three sigmas."""
ROUGH = 0.04
"""Scatter that a surface may have whatever the noise, as a share of the radius: bark, dents, what is out of round."""
LESS = 0.5
"""A surface may scatter less than the noise of its surroundings, down to this share."""
BESIDE, LEAST_FREEDOM = 6.0, 8
"""Points whose mean each is compared with, and degrees of freedom without which that tells nothing."""
CLOSED = 20
"""Sectors, of 24, that make a cylinder closed."""
FLAT_RISE = 6.0
"""A flat window may hide a curve that rises by so many times the scatter."""
FLAT_LEAST = 0.02
"""And this share of the radius at least."""


@dataclass(frozen=True, slots=True, eq=False)
class Shell:
    """The points about a segment in its own coordinates.

    Parameters
    ----------
    indices : ndarray of shape (n,)
        Which points of the cloud they are.
    heights, residuals, angles : ndarray of shape (n,)
        Heights in half heights (so in [-1, 1]), signed distances to the surface, angles about the axis.
    on : ndarray of shape (n,), bool
        Points on the surface that may belong to it.
    flat : ndarray of shape (n,), bool
        Points of something much flatter than the segment.
    deviation : float
        Standard deviation the surface was cut out with.
    """

    indices: IndexArray
    heights: FloatArray
    residuals: FloatArray
    angles: FloatArray
    on: MaskArray
    flat: MaskArray
    deviation: float

    def thinned(self, stride: int) -> Shell:
        """Return every so manyth point: shares and shapes stay, and cost what they should."""
        return Shell(
            self.indices[::stride],
            self.heights[::stride],
            self.residuals[::stride],
            self.angles[::stride],
            self.on[::stride],
            self.flat[::stride],
            self.deviation,
        )


def scatter_of(segment: Segment, noise: float) -> float:
    """Return the standard deviation of a segment's points: its own, within what a surface may have.

    Parameters
    ----------
    segment : Segment
    noise : float
        About it, as far as it is known.
    """
    return max(min(segment.spread, max(2.0 * noise, ROUGH * float(segment.model[6]))), LESS * noise)


def look_at(segment: Segment, indexed: IndexedCloud) -> Shell:
    """Collect the points in and about a segment."""
    model, half = segment.model, segment.half
    noise = indexed.noise_about(model, half)
    deviation = scatter_of(segment, noise)
    near = indexed.cells.near_cylinder(
        model, -half, half, 0.0, model[RADIUS] + max(0.5 * model[RADIUS], 10.0 * deviation)
    )
    heights, residuals, angles = coordinates_of(indexed.points, near, model)
    if segment.wedge is None:
        flat = ~indexed.may_be_on(near, model, segment.flat_share)
    else:  # fitted with the planes that touch it, which flat windows on a small arc are taken for
        flat = _beyond_wedge(indexed.points[near], segment)
    on = (np.abs(residuals) < 3.0 * deviation) & ~flat
    return Shell(near, heights / max(half, 1e-300), residuals, angles, on, flat, deviation)


def _beyond_wedge(points: FloatArray, segment: Segment) -> MaskArray:
    """Return which points lie beyond the ends of an arc."""
    assert segment.wedge is not None
    away = points - segment.point
    away -= np.outer(away @ segment.direction, segment.direction)
    return np.asarray(away @ segment.wedge[:3] < segment.wedge[3] * np.linalg.norm(away, axis=1), dtype=np.bool_)


def edge_gain(shell: Shell, segment: Segment, deviation: float) -> float:
    """Return how much better an arc explains its points than the sharp edge of the planes that touch it.

    Parameters
    ----------
    shell : Shell
    segment : Segment
    deviation : float
        Of the points about the arc, frame units.

    Returns
    -------
    float
        Difference of the sums of squares, in squared deviations, each square at most nine; 0 if it is no such arc.
    """
    if segment.wedge is None:
        return 0.0
    basis = np.empty((2, 3))
    fill_basis(segment.direction, basis)
    middle = math.atan2(float(segment.wedge[:3] @ basis[1]), float(segment.wedge[:3] @ basis[0]))
    opening = math.acos(min(1.0, max(-1.0, float(segment.wedge[3]))))
    near = (np.abs(shell.residuals) < 0.5 * segment.radius) & ~shell.flat
    turn = np.abs((shell.angles[near] - middle + math.pi) % (2.0 * math.pi) - math.pi)
    distances = shell.residuals[near] + segment.radius
    heights = distances * np.cos(opening - turn) - segment.radius  # over the nearer of the two planes
    squares = [np.minimum(np.abs(one) / deviation, 3.0) ** 2 for one in (heights, shell.residuals[near])]
    return float((squares[0] - squares[1]).sum())


def shape_of(shell: Shell, segment: Segment, deviation: float) -> dict[str, float]:
    """Measure curvature against a plane; slope, bulge and bend along the axis, and their standard errors.

    Bulge and bend are not told apart where little of the arc is seen, so each is fitted without the other.
    """
    radius, half = segment.radius, segment.half
    gram, right = np.zeros((9, 9)), np.zeros(9)
    _fill_shape(shell.heights[shell.on], shell.residuals[shell.on], shell.angles[shell.on], gram, right)
    gram[np.diag_indices(9)] *= 1.0 + 1e-12
    covariance = _inverse(gram[:5, :5]) * deviation**2
    wider = _inverse(gram[:7, :7])
    terms = wider @ right[:7]
    errors = np.sqrt(np.maximum(np.diag(wider), 0.0)) * deviation
    bend, bend_error = _bend(gram, right)
    return {
        "curvature": radius / math.sqrt(max(float(covariance[4, 4]), 1e-300)),
        "offset_error": math.sqrt(max(float(covariance[0, 0] + covariance[1, 1]), 0.0)),
        "tilt_error": math.sqrt(max(float(covariance[2, 2] + covariance[3, 3]), 0.0)) / half,
        "slope": float(terms[5]) / half,
        "slope_error": float(errors[5]) / half,
        "bulge": -2.0 * float(terms[6]) * radius / half**2,
        "bulge_error": 2.0 * float(errors[6]) * radius / half**2,
        "bend": 2.0 * bend * radius / half**2,
        "bend_error": 2.0 * bend_error * deviation * radius / half**2,
    }


def _inverse(gram: FloatArray) -> FloatArray:
    """Invert a matrix of normal equations; what nothing is known of is left out where it cannot be inverted."""
    try:
        return np.asarray(np.linalg.inv(gram), dtype=np.float64)
    except np.linalg.LinAlgError:
        return np.asarray(np.linalg.pinv(gram, hermitian=True), dtype=np.float64)


def _bend(gram: FloatArray, right: FloatArray) -> tuple[float, float]:
    """Return how far the axis is off the straight at the ends, and the standard error of that for unit noise."""
    which = np.array([0, 1, 2, 3, 4, 7, 8])
    inverse = _inverse(gram[np.ix_(which, which)])
    aside = (inverse @ right[which])[5:]
    size = float(np.hypot(*aside))
    way = aside / size if size > 0.0 else np.array([1.0, 0.0])
    return size, math.sqrt(max(float(way @ inverse[5:, 5:] @ way), 0.0))


@njit(cache=True, nogil=True)
def _fill_shape(z: FloatArray, residuals: FloatArray, angles: FloatArray, gram: FloatArray, right: FloatArray) -> None:
    """Fill the normal equations of offset (2), tilt (2), radius, slope, bulge and bend (2)."""
    row, middle = np.empty(9), 0.0
    for i in range(len(z)):
        middle += z[i] * z[i] / len(z)
    for i in range(len(z)):
        row[0], row[1] = math.cos(angles[i]), math.sin(angles[i])
        row[2], row[3] = z[i] * row[0], z[i] * row[1]
        row[4], row[5], row[6] = 1.0, z[i], z[i] * z[i] - middle
        row[7], row[8] = row[6] * row[0], row[6] * row[1]
        for a in range(9):
            right[a] += row[a] * residuals[i]
            for b in range(a + 1):
                gram[a, b] += row[a] * row[b]
    for a in range(9):
        for b in range(a + 1, 9):
            gram[a, b] = gram[b, a]


def deviations_of_form(shell: Shell, deviation: float) -> dict[str, float]:
    """Measure how the mean residuals over the surface deviate from zero, and what shape would explain it.

    Returns
    -------
    dict of str to float
        `lack_of_fit`: chi-square per cell; `structure`: the rms of what is structure in the residuals, frame units;
        `ovality`: the rms of an ellipse in it, frame units; `explained`: the largest share of it that a cone, a barrel,
        a bent or an elliptic cylinder would explain, in [0, 1]; `prism`: the same of a prism of five to eight sides, 0
        if the cylinder is not closed.
    """
    z, residuals, angles = shell.heights[shell.on], shell.residuals[shell.on], shell.angles[shell.on]
    rows = int(np.clip(len(z) / 60, 3, 8))
    cell = ((angles / (2.0 * np.pi) + 0.5) * 24).astype(np.int64) % 24 * rows
    cell += np.clip(((z + 1.0) / 2.0 * rows).astype(np.int64), 0, rows - 1)
    counts = np.bincount(cell, minlength=24 * rows).astype(np.float64)
    full = counts >= 4
    if full.sum() <= 6:
        return {"lack_of_fit": 1.0, "structure": 0.0, "ovality": 0.0, "explained": 0.0, "prism": 0.0}
    total, cells = float(counts[full].sum()), float(full.sum())
    sums = np.bincount(cell, residuals, minlength=24 * rows)[full]
    squares = float((sums**2 / counts[full]).sum())
    variance = max(deviation**2, 1e-300)  # points may lie on the surface exactly
    excess = max(0.0, (squares - cells * variance) / total)
    weights = np.sqrt(counts[full])
    middle = np.bincount(cell, z, minlength=24 * rows)[full] / counts[full]
    turn = (np.flatnonzero(full) // rows + 0.5) / 24.0 * 2.0 * np.pi - np.pi
    cosine, sine, one = np.cos(turn), np.sin(turn), np.ones(len(turn))
    base = [cosine, sine, middle * cosine, middle * sine, one]
    shapes = {
        "cone": [middle],
        "barrel": [middle**2],
        "bent": [middle**2 * cosine, middle**2 * sine],
        "oval": [np.cos(2.0 * turn), np.sin(2.0 * turn)],
    }
    # of a piece of the arc any smooth deviation would be explained by these
    closed = len(np.unique(turn)) >= CLOSED
    prisms = [[np.cos(k * turn), np.sin(k * turn)] for k in range(5, 9)] if closed else []
    means = sums / counts[full] * weights
    left = _left_over(base, weights, means)
    gains = {
        name: max(0.0, left - _left_over(base + terms, weights, means) - 2.0 * len(terms) * variance)
        for name, terms in shapes.items()
    }
    rest = [_left_over(base + terms, weights, means) for terms in prisms]
    faceted = max(0.0, left - min(rest, default=left) - 4.0 * variance)
    return {
        "prism": faceted / left if left > 0.0 else 0.0,
        "lack_of_fit": squares / variance / max(int(cells) - 5, 1),
        "structure": math.sqrt(excess),
        "ovality": math.sqrt(gains["oval"] / total),
        "explained": max(gains.values()) / left if left > 0.0 else 0.0,
    }


def own_scatter(shell: Shell, radius: float, half: float, coverage: float) -> float:
    """Return how far points scatter about the mean of the few beside them: the noise of this surface, without its form.

    Parameters
    ----------
    shell : Shell
    radius, half : float
        Of the segment, frame units.
    coverage : float
        Angle that is covered, radians.
    """
    z, residuals, angles = shell.heights[shell.on], shell.residuals[shell.on], shell.angles[shell.on]
    count = len(z)
    area = 2.0 * half * radius * max(coverage, 0.1)
    side = math.sqrt(area * BESIDE / max(count, 1))
    rows = int(np.clip(round(2.0 * half / max(side, 1e-300)), 1, 10000))
    columns = int(np.clip(round(2.0 * math.pi * radius / max(side, 1e-300)), 6, 10000))
    cell = np.clip(((angles / (2.0 * np.pi) + 0.5) * columns).astype(np.int64), 0, columns - 1) * rows
    cell += np.clip(((z + 1.0) / 2.0 * rows).astype(np.int64), 0, rows - 1)
    _, where = np.unique(cell, return_inverse=True)
    counts = np.bincount(where)
    means = np.bincount(where, residuals) / counts
    freedom = count - len(counts)
    within = float(((residuals - means[where]) ** 2).sum())
    return math.sqrt(within / freedom) if freedom >= LEAST_FREEDOM else math.sqrt(float((residuals**2).mean()))


def _left_over(terms: list[FloatArray], weights: FloatArray, values: FloatArray) -> float:
    """Return the sum of squares that a weighted fit of the terms leaves."""
    design = np.stack(terms, axis=1) * weights[:, None]
    fitted, *_ = np.linalg.lstsq(design, values, rcond=1e-6)
    return float(((values - design @ fitted) ** 2).sum())


def facets(shell: Shell, flatness: FloatArray, radius: float, scatter: float) -> float:
    """Return the share of the surface that lies in flat windows so wide that a cylinder would curve out of them."""
    own = flatness[shell.indices[shell.on]]
    if len(own) == 0:
        return 0.0
    return float((own * own > 2.0 * radius * max(FLAT_RISE * scatter, FLAT_LEAST * radius)).mean())
