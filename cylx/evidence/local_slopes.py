"""Whether the surface about each piece of a segment is radial: a cylinder touches all its points, and crosses none."""

from __future__ import annotations

import math

import numpy as np

from cylx.evidence.measures import Shell
from cylx.geometry.arrays import FloatArray, IndexArray

TELLING_SLOPE = 0.04
"""Standard deviation of the slope of a piece: pieces are so large that it is no more than this."""
LEAST_IN_PIECE = 10
"""Points without which the slope of a piece tells nothing."""
LARGEST_PIECE = 0.6
"""Side of a piece in radii, and in heights, above which it tells nothing of its own."""
RADIAL_SLOPE = 0.2
"""A steeper surface crosses the cylinder: dents and seams of real objects are less steep."""
BAND = 0.4
"""What lies within this many sides of a piece may belong to the surface there, whether it crosses or not."""


def radial_pieces(shell: Shell, radius: float, half: float, scatter: float, coverage: float) -> tuple[float, float]:
    """Count the pieces of a surface that are radial, and those that tell whether they are.

    The surface is unrolled and cut into squares. A plane is fitted to the residuals in each, of all points near it. Of
    a cylinder it is level; of what merely crosses the band about one it is steep.

    Parameters
    ----------
    shell : Shell
    radius, half : float
        Of the segment, frame units.
    scatter : float
        Of the points about their surface, frame units.
    coverage : float
        Angle that is covered, radians.

    Returns
    -------
    radial, told : float
        Each piece counts by its share of the points on the surface, so that `told` is at most the number of pieces.
    """
    count = int(shell.on.sum())
    density = count / max(2.0 * half * radius * max(coverage, 0.1), 1e-300)
    sharp = math.sqrt(math.sqrt(12.0 / density) * scatter / TELLING_SLOPE)
    side = max(sharp, math.sqrt(1.5 * LEAST_IN_PIECE / density))
    if side > LARGEST_PIECE * min(radius, 2.0 * half):
        return 0.0, 0.0
    near = (np.abs(shell.residuals) < max(4.0 * scatter, BAND * side)) & (np.abs(shell.heights) <= 1.0)
    cell, u, v = _unrolled(shell, near, radius, half, side)
    pieces = int(cell.max()) + 1
    residuals, own = shell.residuals[near], np.bincount(cell, shell.on[near], minlength=pieces)
    slopes, errors = _slopes(cell, u, v, residuals, scatter)
    told = (own >= LEAST_IN_PIECE) & (errors < 2.0 * TELLING_SLOPE)
    level = told & (slopes < RADIAL_SLOPE + 2.0 * errors)
    # the number of pieces of equal weight that are worth as much
    worth = float(own[told].sum() ** 2 / max((own[told] ** 2).sum(), 1.0))
    return worth * float(own[level].sum() / max(own[told].sum(), 1.0)), worth


def _unrolled(
    shell: Shell, near: IndexArray, radius: float, half: float, side: float
) -> tuple[IndexArray, FloatArray, FloatArray]:
    """Return the piece of each point, and where in it the point lies, around and along."""
    columns = max(6, round(2.0 * math.pi * radius / side))
    rows = max(1, round(2.0 * half / side))
    turn = (shell.angles[near] / (2.0 * math.pi) + 0.5) * columns
    along = (shell.heights[near] + 1.0) / 2.0 * rows
    column = np.clip(turn.astype(np.int64), 0, columns - 1)
    row = np.clip(along.astype(np.int64), 0, rows - 1)
    u = (turn - column - 0.5) * (2.0 * math.pi * radius / columns)
    v = (along - row - 0.5) * (2.0 * half / rows)
    return column * rows + row, u, v


def _slopes(
    cell: IndexArray, u: FloatArray, v: FloatArray, residuals: FloatArray, scatter: float
) -> tuple[FloatArray, FloatArray]:
    """Return the slope of the residuals of each piece, and its standard deviation."""
    n = np.maximum(np.bincount(cell), 1)

    def mean(values: FloatArray) -> FloatArray:
        return np.asarray(np.bincount(cell, values) / n, dtype=np.float64)

    du, dv, dr = u - mean(u)[cell], v - mean(v)[cell], residuals - mean(residuals)[cell]
    uu, uv, vv, ur, vr = mean(du * du), mean(du * dv), mean(dv * dv), mean(du * dr), mean(dv * dr)
    determinant = np.maximum(uu * vv - uv**2, 1e-300)
    b, c = (ur * vv - vr * uv) / determinant, (vr * uu - ur * uv) / determinant
    errors = scatter * np.sqrt((uu + vv) / determinant / 2.0 / n)
    return np.hypot(b, c), errors
