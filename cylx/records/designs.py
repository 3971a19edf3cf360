"""Cylinders as they were designed: what a scan is compared with."""

from __future__ import annotations

from dataclasses import dataclass

Triple = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class DesignCylinder:
    """A cylinder of a design.

    Parameters
    ----------
    name : str
        Its name in the design, or its number.
    start, end : tuple of float
        Ends of its axis, which differ.
    radius : float
        Greater than 0.
    """

    name: str
    start: Triple
    end: Triple
    radius: float


@dataclass(frozen=True, slots=True)
class Design:
    """The cylinders of a file.

    Parameters
    ----------
    format : str
        `json`, `csv`, `step` or `ifc`.
    units : str or None
        Unit of its lengths, a key of `cylx.units.METRES`; None if the file says none.
    metres : float or None
        Length of that unit, metres: of files whose unit may be any.
    cylinders : tuple of DesignCylinder
    """

    format: str
    units: str | None
    metres: float | None
    cylinders: tuple[DesignCylinder, ...]
