"""What lies about a segment: inside it, just outside, and going on from where its arc ends."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from cylx.evidence.measures import Shell
from cylx.geometry.arrays import FloatArray, IndexArray, MaskArray
from cylx.geometry.coverage import SECTORS, filled_sectors, sector_of
from cylx.geometry.cylinder import axis_basis

PIECES_OF_HEIGHT = 10
"""Pieces of the height over which inside and outside are counted; their median forgives lids, floors and crossings."""
SIDES = 4, 24
"""Sides over which they are counted, too: least and most; each should hold `LEAST_ON` points."""
HALF_SEEN = 0.5
"""Share of the sides that must hold points of the surface: of a strip of something nearly flat all sides are empty."""
THIRDS = 3
"""Pieces of the height over which flanks are counted: what touches a pipe at one place only is none."""
MIDDLE = 0.9
"""Share of the height over which flanks are counted."""
LEAST_ON = 10
"""Points on the surface without which there is no density to compare with."""
WALL, WALL_SHARE, WALL_SECTORS = 0.04, 0.5, 9
"""The inner wall of a tube is so thick at most, in radii, holds this share of what is inside, over so many sectors."""
BALL_DEVIATIONS, BALL_RADII, BALL_HEIGHT, BALL_SECTORS = 3.0, 0.03, 0.8, 0.5
"""Points within so many deviations, or radii, of a ball are on it; it is followed up to this height, in radii,
over this share of the sectors."""
ARC_SHARE = 0.3
"""Sectors with less than this share of what a typical one holds are beyond the end of an arc."""


OUTER_SECTORS, CLEAR_WALL = 20, 0.15
"""An outer wall goes over so many sectors, and is told from what lies about a surface only if that is no rougher."""
LEAST_OF_MEAN = 0.5
"""Pieces of the height count as if they held this share of what they hold on the average."""
END, END_DEVIATIONS, MOST_END = 0.02, 4.0, 0.4
"""Caps and plates lie within this share of half the height and so many deviations of an end, within limits."""


def emptiness(shell: Shell, radius: float, half: float) -> tuple[float, float]:
    """Return points inside and just outside as shares of those on the surface.

    Medians over pieces of the height, as lids, floors and crossings are other things; inside also over sides, if that
    is less and half a turn is seen, as spokes and webs are. Outside, points of planes do not count: a pipe may lie on a
    floor or run along a wall.
    """
    piece = np.clip(((shell.heights + 1.0) / 2.0 * PIECES_OF_HEIGHT).astype(np.int64), 0, PIECES_OF_HEIGHT - 1)
    piece[np.abs(shell.heights) > 1.0 - _end_of(shell, half)] = PIECES_OF_HEIGHT
    # what lies beside a disc further off than it is high is another thing, and there is much of it
    beside = max(half, 10.0 * shell.deviation)
    outer = min(max(0.5 * radius, 10.0 * shell.deviation), beside)
    on = np.abs(shell.residuals) < 3.0 * shell.deviation
    inside = (shell.residuals < -4.0 * shell.deviation) & (shell.residuals > -beside)
    outside = (shell.residuals > 4.0 * shell.deviation) & (shell.residuals < outer) & ~shell.flat
    inside &= ~_on_other_wall(shell, inside, radius)
    if 6.0 * shell.deviation < CLEAR_WALL * radius:  # the wall of a rough surface could be anything
        outside &= ~_on_other_wall(shell, outside, radius, OUTER_SECTORS)
    masks = [on, inside, outside]
    counts = [np.bincount(piece[mask], minlength=PIECES_OF_HEIGHT + 1) for mask in masks]
    if counts[0][:-1].any():  # caps and plates lie at the ends
        counts = [count[:-1] for count in counts]
        masks = [mask & (piece < PIECES_OF_HEIGHT) for mask in masks]
    by_height = _median_shares(counts)
    sides = int(np.clip(np.count_nonzero(masks[0]) // LEAST_ON, *SIDES))
    side = np.clip(((shell.angles / (2.0 * math.pi) + 0.5) * sides).astype(np.int64), 0, sides - 1)
    counts = [np.bincount(side[mask], minlength=sides) for mask in masks]
    if np.count_nonzero(counts[0]) < HALF_SEEN * sides:
        return by_height
    return min(by_height[0], _median_shares(counts)[0]), by_height[1]


def _median_shares(counts: list[IndexArray]) -> tuple[float, float]:
    """Return the medians, over pieces of a surface, of what is inside and outside as shares of what is on it."""
    full = counts[0] >= 1
    if not full.any():
        return 1.0, 1.0
    # the points of a short cylinder may lie on a few circles
    usual = np.maximum(counts[0][full], LEAST_OF_MEAN * counts[0].mean())
    return float(np.median(counts[1][full] / usual)), float(np.median(counts[2][full] / usual))


def _end_of(shell: Shell, half: float) -> float:
    """Return the share of half the height that a cap or a plate at its end takes."""
    return min(END + END_DEVIATIONS * shell.deviation / max(half, 1e-300), MOST_END)


def clear_of_ends(shell: Shell, half: float) -> Shell:
    """Return a shell whose surface is without what a cap or a plate at an end may have drawn out of its form."""
    return replace(shell, on=shell.on & (np.abs(shell.heights) <= 1.0 - _end_of(shell, half)))


def _on_other_wall(shell: Shell, aside: MaskArray, radius: float, sectors: int = WALL_SECTORS) -> MaskArray:
    """Return which of the points inside or outside lie on a cylinder about the same axis: other wall of tube or mug."""
    where = np.flatnonzero(aside)
    none = np.zeros(len(aside), np.bool_)
    if len(where) < LEAST_ON:
        return none
    where = where[np.argsort(shell.residuals[where], kind="stable")]
    depths = shell.residuals[where]
    counts = np.searchsorted(depths, depths + max(6.0 * shell.deviation, WALL * radius), "right") - np.arange(
        len(where)
    )
    first = int(counts.argmax())
    wall = where[first : first + int(counts[first])]
    if len(wall) < WALL_SHARE * len(where) or len(np.unique(sector_of(shell.angles[wall]))) < sectors:
        return none
    none[wall] = True
    return none


def continuation(shell: Shell, radius: float) -> tuple[float, float]:
    """Return the density of points that go on tangentially past an end of the arc, as a share of the arc's own.

    A rounded edge of a box goes on as its two sides, of which one may be hidden; a pipe ends.

    Returns
    -------
    tangent, both : float
        Of the two ends the one with more, and the one with less. Of arcs of more than half a turn both are the latter.
    """
    middle = np.abs(shell.heights) <= 0.8
    on = middle & shell.on
    closed = filled_sectors(shell.angles[on], SECTORS, ARC_SHARE) if on.any() else np.zeros(SECTORS, np.bool_)
    for _ in range(2):  # gaps of up to two sectors are not ends
        for step in (1, 2):
            closed |= np.roll(closed, 1) & np.roll(closed, -step)
    if closed.all() or not closed.any():
        return 0.0, 0.0
    start, length = _longest_run(closed)
    if length >= SECTORS - 3:
        return 0.0, 0.0
    width = 2.0 * math.pi / SECTORS
    counts = np.bincount(sector_of(shell.angles[on]), minlength=SECTORS)
    density = max(float(counts[(start + np.arange(length)) % SECTORS].sum()) / length, 1e-9)
    low = -math.pi + start * width
    # sectors that are a little filled count as arc, so that it may have ended up to this much before
    reach, early = math.radians(20.0), math.radians(25.0)
    shares = []
    for end, sign in ((low, -1.0), (low + length * width, 1.0)):
        past = (sign * (shell.angles - end) + math.pi) % (2.0 * math.pi) - math.pi
        least = radius * (1.0 / np.cos(np.clip(past, 0.0, reach)) - 1.0) - 4.0 * shell.deviation
        most = radius * (1.0 / np.cos(np.clip(past, 0.0, reach) + early) - 1.0) + 4.0 * shell.deviation
        # what is within three deviations is the surface itself, seen less often there
        least = np.maximum(least, 3.0 * shell.deviation)
        off = (shell.residuals > least) & (shell.residuals < most)
        # a plane that touches the arc lies on its surface at first
        off |= shell.flat & (np.abs(shell.residuals) < 3.0 * shell.deviation)
        along = middle & (past > 0) & (past < reach) & off
        shares.append(float(along.sum()) / (reach / width) / density)
    # an edge turns by less than half a turn; of more, both ends would have to go on
    return (max(shares) if closed.sum() <= SECTORS // 2 else min(shares)), min(shares)


def flank(shell: Shell, radius: float) -> float:
    """Return how densely points lie on a half plane that touches the cylinder and goes off to one side.

    Sides of edges and plates are such half planes. A point beyond the surface lies on two tangents, one that touches it
    to its left and one to its right; of all points of a half plane, one of the two touches at the same place, and what
    touches where more others do is taken for the one. A pipe on a floor touches two halves of one plane, which cancel
    each other. Unlike `continuation` this needs no end of the arc, which the surface itself hides where the radius is
    but a few deviations.

    Parameters
    ----------
    shell : Shell
    radius : float
        Frame units.

    Returns
    -------
    float
        As a share of the density on the surface, beyond what chance brings; the median over three pieces of the height.
    """
    middle = np.abs(shell.heights) <= MIDDLE
    on = middle & (np.abs(shell.residuals) < 3.0 * shell.deviation)
    if on.sum() < LEAST_ON:
        return 0.0
    beyond = middle & (shell.residuals > 3.0 * shell.deviation)
    counts = np.bincount(sector_of(shell.angles[on]), minlength=SECTORS)
    density = float(counts[counts > 0].mean()) / (2.0 * math.pi / SECTORS * radius)
    nearest, farthest = radius + 3.0 * shell.deviation, radius + max(0.5 * radius, 10.0 * shell.deviation)
    length = math.sqrt(farthest**2 - radius**2) - math.sqrt(nearest**2 - radius**2)
    turn = np.arccos(radius / (radius + shell.residuals[beyond]))
    piece = np.clip(((shell.heights[beyond] / MIDDLE + 1.0) / 2.0 * THIRDS).astype(np.int64), 0, THIRDS - 1)
    places = [sector_of(shell.angles[beyond] + sign * turn) for sign in (-1.0, 1.0)]
    popular = [np.bincount(place, minlength=SECTORS)[place] for place in places]
    sides = []
    for place, chosen in zip(places, (popular[0] >= popular[1], popular[1] > popular[0]), strict=True):
        counts = np.bincount((piece * SECTORS + place)[chosen], minlength=THIRDS * SECTORS)
        sides.append(counts.reshape(THIRDS, SECTORS))
    best = 0.0
    for one, other in (sides, sides[::-1]):
        here = one + np.roll(one, -1, axis=1)  # the place may be at the border of two sectors
        rest = sum(np.roll(other, shift, axis=1) for shift in (1, 0, -1, -2))
        excess = here - rest - np.sqrt(here + rest)
        best = max(best, float(np.median(excess, axis=0).max()) / (density * length / THIRDS + 1.0))
    return best


def _longest_run(filled: MaskArray) -> tuple[int, int]:
    """Return start and length of the longest cyclic run of True; not all are True."""
    best = (0, 0)
    count = len(filled)
    for start in np.flatnonzero(filled & ~np.roll(filled, 1)):
        length = 0
        while length < count and filled[(start + length) % count]:
            length += 1
        if length > best[1]:
            best = (int(start), length)
    return best


def ball_share(points: FloatArray, model: FloatArray, half: float, deviation: float) -> float:
    """Return how much of a ball goes on above or below a band of it, as a share of what there would be.

    Equal heights of a ball and of the cylinder about it have equal areas.

    Parameters
    ----------
    points : ndarray of shape (n, 3)
        About the band, frame units.
    model : ndarray of shape (7,)
        The cylinder whose middle is that of the ball.
    half : float
        Half the height of the band.
    deviation : float
        Standard deviation of the points on it.

    Returns
    -------
    float
        Of the fuller side, in [0, 1].
    """
    away = points - model[:3]
    heights = away @ model[3:6]
    radius = float(model[6])
    reach = max(BALL_DEVIATIONS * deviation, BALL_RADII * radius)
    low, high = half + reach, min(BALL_HEIGHT * radius, 3.0 * half + reach)
    if high <= low:
        return 0.0
    u, v = (away @ axis for axis in axis_basis(model[3:6]))
    across = np.hypot(u, v)
    sector = sector_of(np.arctan2(v, u))
    on = (np.abs(across - radius) < 3.0 * deviation) & (np.abs(heights) < half)
    seen = np.bincount(sector[on], minlength=SECTORS) > 0
    expected = float(on.sum()) * (high - low) / (2.0 * half)
    off = np.abs(np.sqrt((away**2).sum(axis=1)) - radius)
    best = 0.0
    for side in (-1.0, 1.0):
        beyond = (side * heights > low) & (side * heights < high)
        near, beside = (
            np.bincount(sector[beyond & mask], minlength=SECTORS)
            for mask in (off < reach, (off >= reach) & (off < 3.0 * reach))
        )
        # other surfaces cross the ball or fill its place; they are beside it as well, on twice the depth
        more = near > beside / 2.0
        if np.count_nonzero(more & seen) >= BALL_SECTORS * np.count_nonzero(seen):
            best = max(best, float((near - beside / 2.0).sum()) / max(expected, 1.0))
    return min(1.0, best)
