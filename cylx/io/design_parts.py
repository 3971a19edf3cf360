"""A cylinder of a design, checked, from the numbers of any file."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

from cylx.errors import InputError
from cylx.harmless import visible
from cylx.records.designs import DesignCylinder, Triple

KEYS = "give id or name, start_x to end_z (or axis_point, axis_direction and height) and radius"
_LONGEST_NAME = 200
_LARGEST, _SMALLEST = 1e100, 1e-100
"""Lengths whose squares are still numbers."""


def design_cylinder(name: str, start: Iterable[Any], end: Iterable[Any], radius: Any, place: str) -> DesignCylinder:  # noqa: ANN401  from files
    """Return a cylinder whose numbers were checked.

    Raises
    ------
    InputError
        If a number is not finite, the radius is not > 0, or the ends are one point.
    """
    try:
        first, last = triple(start), triple(end)
        size = float(radius)
    except (TypeError, ValueError, OverflowError):
        raise InputError(place, "has an end or a radius that is no number", KEYS) from None
    sizes = (*first, *last, size)
    if not (all(abs(one) < _LARGEST for one in sizes) and size > _SMALLEST and math.dist(first, last) > _SMALLEST):
        raise InputError(place, "has no length, no radius, or one that is not finite", KEYS)
    return DesignCylinder(visible(name)[:_LONGEST_NAME], first, last, size)


def triple(values: Iterable[Any]) -> Triple:
    """Return three numbers as floats."""
    x, y, z = (float(value) for value in values)
    return x, y, z
