"""The profile of a bar or a plate with two rounded edges: two quarter circles with something flat between them.

Where the flat between them is narrow, the two pass for one half round that is larger than either. Both are the same
curve but for one length, so that their squared residuals tell which it is.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from cylx.geometry.arrays import FloatArray

TUKEY, WIDER, NARROWED = 4.685, 3.0, 0.7
"""Residuals of so many deviations have no weight; at first this much wider, and each step's narrower than the last."""
STEPS, SETTLED = 30, 1e-4
"""Steps at most; one of less than this, in radii or radians, is the last."""
LONGEST_STEP = 0.15
"""Longest step, in radii or radians."""
FIRST_FLAT = 0.3
"""Half the flat from which the fit sets out, in radii."""
BACK, CLEAR = 1.0, 0.2
"""The sides count up to so many radii back from where the arcs end, and are known by what is further than the other."""
LEAST_ON_SIDE, LEAST_ON_ARC = 12, 12
"""Points of each side and of each arc."""
CLIPPED = 3.0
"""Residuals count up to so many deviations."""
X, Y, FLAT, OWN, TURN = range(5)
"""The unknowns: the point between the centres of the arcs, half the flat, the radius, the direction of the middle."""


class RoundedEnd(NamedTuple):
    """Two quarter circles that go on into parallel sides, and what is flat between them.

    Parameters
    ----------
    centers : ndarray of shape (2, 2)
        Of the two arcs.
    radius : float
    middles : ndarray of shape (2,)
        Angles of the middles of the arcs about their centres, radians.
    flat, flat_error : float
        Half the width of the flat between them, and its standard error.
    gain : float
        How much smaller the sum of squared residuals is than that of a half round between the same sides, in squared
        deviations, each clipped.
    share : float
        The gain as a share of what the half round leaves unexplained.
    """

    centers: FloatArray
    radius: float
    middles: FloatArray
    flat: float
    flat_error: float
    gain: float
    share: float


def fit_rounded_end(points: FloatArray, radius: float, middle: float, deviation: float) -> RoundedEnd | None:
    """Fit two rounded edges, both with the same radius, where one circle was found.

    Parameters
    ----------
    points : ndarray of shape (n, 2)
        Points about the circle, its centre at zero.
    radius : float
        Of the circle.
    middle : float
        Angle of the middle of its arc, radians.
    deviation : float
        Standard deviation of the points about the profile.

    Returns
    -------
    RoundedEnd or None
        None if there are no two parallel sides, or nothing flat between two arcs.
    """
    plain = _settled(points, np.array([0.0, 0.0, 0.0, radius, middle]), deviation, free=[X, Y, OWN, TURN])
    if plain is None:
        return None
    start = plain[0].copy()
    start[FLAT], start[OWN] = FIRST_FLAT * radius, start[OWN] - FIRST_FLAT * radius
    start[X] += FIRST_FLAT * radius * math.cos(start[TURN])
    start[Y] += FIRST_FLAT * radius * math.sin(start[TURN])
    settled = _settled(points, start, deviation, free=[X, Y, FLAT, OWN, TURN])
    if settled is None:
        return None
    end, matrix = settled
    if end[FLAT] <= 0.0 or not _is_complete(points, end, deviation):
        return None
    # both over the points that the one or the other counts
    residuals = [_residuals(points, one, radius)[0] for one in (plain[0], end)]
    about = np.isfinite(residuals[0]) & np.isfinite(residuals[1])
    about &= np.minimum(np.abs(residuals[0]), np.abs(residuals[1])) < CLIPPED * deviation
    squares = [float((np.minimum(np.abs(one[about]) / deviation, CLIPPED) ** 2).sum()) for one in residuals]
    gain = squares[0] - squares[1]
    along = np.array([-math.sin(end[TURN]), math.cos(end[TURN])])
    quarter = 0.25 * math.pi
    return RoundedEnd(
        end[:2] + end[FLAT] * np.array([-along, along]),
        float(end[OWN]),
        end[TURN] + np.array([-quarter, quarter]),
        float(end[FLAT]),
        deviation * math.sqrt(max(float(np.linalg.pinv(matrix, hermitian=True)[FLAT, FLAT]), 0.0)),
        gain,
        gain / max(squares[0] - float(about.sum()), gain, 1e-300),
    )


def _local(points: FloatArray, end: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return how far points are ahead of the line through both centres, and along it."""
    away = points - end[:2]
    cosine, sine = math.cos(end[TURN]), math.sin(end[TURN])
    return away[:, 0] * cosine + away[:, 1] * sine, away[:, 1] * cosine - away[:, 0] * sine


def _residuals(points: FloatArray, end: FloatArray, radius: float) -> tuple[FloatArray, FloatArray]:
    """Return the distances to the profile, and the rows of their derivatives; infinite where the sides do not count."""
    ahead, along = _local(points, end)
    side, beyond = np.sign(along), np.abs(along) - end[FLAT]
    aside = np.maximum(beyond, 0.0)
    distance = np.maximum(np.hypot(ahead, aside), 1e-12 * radius)
    front = ahead > 0.0
    by_ahead = np.where(front, ahead / distance, 0.0)
    by_along = np.where(front, aside / distance, 1.0)
    residuals = np.where(front, distance, beyond) - end[OWN]
    residuals[ahead < -BACK * radius] = np.inf
    cosine, sine = math.cos(end[TURN]), math.sin(end[TURN])
    across = side * by_along
    rows = np.stack(
        [
            -by_ahead * cosine + across * sine,
            -by_ahead * sine - across * cosine,
            -by_along,
            -np.ones(len(points)),
            by_ahead * along - across * ahead,
        ],
        axis=1,
    )
    return residuals, rows


def _settled(
    points: FloatArray, start: FloatArray, deviation: float, free: list[int]
) -> tuple[FloatArray, FloatArray] | None:
    """Fit some of the unknowns by Gauss-Newton steps with Tukey's weights; give them with the normal equations."""
    end, radius = start.copy(), float(start[OWN] + start[FLAT])
    matrix = np.zeros((5, 5))
    for step in range(STEPS):
        residuals, rows = _residuals(points, end, radius)
        width = TUKEY * deviation * max(1.0, WIDER * NARROWED**step)
        near = np.abs(residuals) < width
        if np.count_nonzero(near) < LEAST_ON_ARC:
            return None
        weights = (1.0 - (residuals[near] / width) ** 2) ** 2
        weighted = rows[near] * weights[:, None]
        matrix = weighted.T @ rows[near]
        part = matrix[np.ix_(free, free)]
        part[np.diag_indices(len(free))] *= 1.0 + 1e-9
        try:
            change = -np.linalg.solve(part, (weighted.T @ residuals[near])[free])
        except np.linalg.LinAlgError:
            return None
        scales = np.where(np.array(free) == TURN, 1.0, radius)
        longest = float(np.abs(change / scales).max())
        end[free] += change * min(1.0, LONGEST_STEP / max(longest, 1e-300))
        if not (np.isfinite(end).all() and 0.0 < end[OWN] < 2.0 * radius and abs(end[FLAT]) < radius):
            return None
        end[FLAT] = max(end[FLAT], 0.0)
        if longest < SETTLED and WIDER * NARROWED**step <= 1.0:
            break
    return end, matrix


def _is_complete(points: FloatArray, end: FloatArray, deviation: float) -> bool:
    """Return whether both sides and both arcs have points."""
    residuals, _ = _residuals(points, end, float(end[OWN] + end[FLAT]))
    near = np.abs(residuals) < CLIPPED * deviation
    ahead, along = _local(points[near], end)
    for side in (-1.0, 1.0):
        if np.count_nonzero((ahead < -CLEAR * end[OWN]) & (side * along > 0.0)) < LEAST_ON_SIDE:
            return False
        if np.count_nonzero((ahead > 0.0) & (side * along > end[FLAT])) < LEAST_ON_ARC:
            return False
    return True
