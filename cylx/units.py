"""The units of length that a scan may have, and their lengths in metres."""

from __future__ import annotations

METRES = {"m": 1.0, "mm": 0.001, "cm": 0.01, "in": 0.0254, "ft": 0.3048, "us-ft": 1200.0 / 3937.0}
"""Length of each unit, metres; `us-ft` is the foot of surveys in the USA, which is longer by two millionths."""
_SAME = 2e-7
"""Relative difference up to which lengths are the same unit: files round the US foot to seven digits."""


def unit_of(metres: float) -> str | None:
    """Return the unit of a length in metres, a key of `METRES`; None if there is none.

    Examples
    --------
    >>> unit_of(0.3048), unit_of(0.3048006096), unit_of(1000.0)
    ('ft', 'us-ft', None)
    """
    return next((name for name, length in METRES.items() if abs(metres - length) <= _SAME * length), None)
