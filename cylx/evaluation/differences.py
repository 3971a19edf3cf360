"""Differences of two results: what they are told by, and how large they may be."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Literal

from cylx.errors import UsageError

Kind = Literal["missing", "extra", "moved", "resized", "recounted", "parted", "joined"]
List = Literal["cylinders", "blends", "fittings", "runs"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Tolerances:
    """The allowed differences of two results.

    Parameters
    ----------
    angle_deg : float
        Angle between the axes, degrees.
    offset : float
        Distance of the axes at the middle of either cylinder, in radii.
    radius : float
        Of the radii, relative.
    height : float
        Of the heights, and of the mid-points along the axis, relative to the larger height plus radius.
    inliers : float
        Of the numbers of inliers, relative.
    """

    angle_deg: float = 0.1
    offset: float = 0.01
    radius: float = 0.005
    height: float = 0.05
    inliers: float = 0.05

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not value >= 0:
                raise UsageError(f"tolerance {field.name}", f"must be >= 0, not {value}", "give a number >= 0")


@dataclass(frozen=True, slots=True, kw_only=True)
class Difference:
    """One difference of two results.

    Parameters
    ----------
    kind : str
        `missing` (only in a), `extra` (only in b), `moved`, `resized` or `recounted`; of runs `parted` (one in a,
        several in b) and `joined` (several in a, one in b).
    id_a, id_b : int or None
        The cylinder in a and in b.
    what : str
        `cylinder`, `blend` or the kind of a fitting if one is missing or extra, `run`, or `angle_deg`, `offset`,
        `shift` (along the axis), `height`, `radius`, `inliers` or another key of what differs.
    a, b : float or None
        The values in a and b, if there are any; the radius of a missing or extra cylinder.
    difference, tolerance : float or None
        The difference and its tolerance, in the same unit.
    of : str
        The list they are in: `cylinders`, `blends`, `fittings` or `runs`.
    """

    kind: Kind
    id_a: int | None
    id_b: int | None
    what: str
    a: float | None = None
    b: float | None = None
    difference: float | None = None
    tolerance: float | None = None
    of: List = "cylinders"
