"""Whether two pieces in line, far from each other, are as large as each other."""

from __future__ import annotations

import math

from cylx.records import Finding

LEAST_RADIUS_DIFFERENCE, ERRORS_OF_RADIUS = 0.03, 4.0
"""Radii that differ less, as a share of the smaller, or in standard deviations, are the same."""


def is_another_size(a: Finding, b: Finding, gap: float) -> bool:
    """Return whether a piece that lies further away than either is long has another radius, beyond their errors.

    Over so long a gap, pipes that lie in line by chance are as likely as one pipe; one fit may explain both within the
    noise though each of them is known much better than that.

    Parameters
    ----------
    a, b : Finding
        Each fitted to its own points.
    gap : float
        Between them, along the axis.
    """
    one, two = a.segment, b.segment
    if gap <= 2.0 * max(one.half, two.half):
        return False
    # a radius is known about as well as an axis
    certain = ERRORS_OF_RADIUS * math.hypot(a.offset_error, b.offset_error)
    return abs(one.radius - two.radius) > max(LEAST_RADIUS_DIFFERENCE * min(one.radius, two.radius), certain)
