"""Nominal sizes of steel pipes with the measures of their fittings, as plants have them."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class PipeSize:
    """One nominal size; all measures in metres.

    Parameters
    ----------
    nominal : float
        Nominal diameter: 0.1 for DN100. Bend radii are multiples of it.
    radius : float
        Outer radius of the pipe (EN 10220).
    flange_radius, flange_thickness : float
        Disc of a flange (EN 1092-1, PN 16).
    reducer_length : float
        Length of a reducer whose larger end has this size (ASME B16.9).
    valve_length : float
        From face to face of a flanged valve (EN 558, series 1).
    """

    nominal: float
    radius: float
    flange_radius: float
    flange_thickness: float
    reducer_length: float
    valve_length: float


_MILLIMETRES = (
    (40, 48.3, 150, 18, 64, 200),
    (50, 60.3, 165, 18, 76, 230),
    (65, 76.1, 185, 18, 89, 290),
    (80, 88.9, 200, 20, 89, 310),
    (100, 114.3, 220, 20, 102, 350),
    (125, 139.7, 250, 22, 127, 400),
    (150, 168.3, 285, 22, 140, 480),
    (200, 219.1, 340, 24, 152, 600),
    (250, 273.0, 405, 26, 178, 730),
    (300, 323.9, 460, 28, 203, 850),
)
"""Nominal diameter, outer diameter, diameter and thickness of the flange, lengths of reducer and valve."""

SIZES = tuple(
    PipeSize(dn / 1e3, outer / 2e3, disc / 2e3, thick / 1e3, reducer / 1e3, valve / 1e3)
    for dn, outer, disc, thick, reducer, valve in _MILLIMETRES
)
"""From the smallest to the largest."""

SHARES = (0.1, 0.15, 0.1, 0.15, 0.15, 0.1, 0.1, 0.09, 0.04, 0.02)
"""How often a run starts with each of them."""
