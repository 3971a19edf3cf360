"""Whether a cylinder is within its tolerances: passed, failed, or undecided within its uncertainty (ISO 14253-1)."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from typing import Literal

from cylx.deviation.measure import Deviation

Verdict = Literal["pass", "fail", "undecided"]
EXPANDED = 2.0
"""The expanded uncertainty is this many standard deviations."""


@dataclass(frozen=True, slots=True)
class Tolerances:
    """What is allowed; None is not checked.

    Parameters
    ----------
    offset : float or None
        Distance of the axis from that of the design, scene units.
    tilt_deg : float or None
        Angle between the axes, degrees.
    radius : float or None
        Difference of the radius, either way, scene units.
    cylindricity : float or None
        Of the minimum zone, scene units.
    ovality : float or None
        Largest diameter minus smallest, scene units.
    taper : float or None
        Change of the diameter per length, either way.
    dent : float or None
        Depth of the deepest dent or bulge, scene units.
    """

    offset: float | None = None
    tilt_deg: float | None = None
    radius: float | None = None
    cylindricity: float | None = None
    ovality: float | None = None
    taper: float | None = None
    dent: float | None = None

    @property
    def any(self) -> bool:
        """Whether something is checked."""
        return any(getattr(self, one.name) is not None for one in fields(self))


@dataclass(frozen=True, slots=True)
class Check:
    """One value against its tolerance.

    Parameters
    ----------
    of : str
        A field of `Tolerances`, or `found`.
    value, uncertainty : float or None
        The value, its sign dropped, and its expanded uncertainty; None if it could not be measured.
    tolerance : float or None
    verdict : {"pass", "fail", "undecided"}
    """

    of: str
    value: float | None
    uncertainty: float | None
    tolerance: float | None
    verdict: Verdict


def check_deviation(deviation: Deviation, tolerances: Tolerances) -> list[Check]:
    """Check a design cylinder; one that was not found fails."""
    measured = deviation.measured
    if measured is None:
        return [Check("found", None, None, None, "fail")]
    return [Check("found", None, None, None, "pass"), *_checks(deviation, tolerances)]


def overall(checks: Sequence[Check]) -> Verdict:
    """Return the worst verdict: failed before undecided before passed."""
    verdicts = {check.verdict for check in checks}
    return "fail" if "fail" in verdicts else "undecided" if "undecided" in verdicts else "pass"


def _checks(deviation: Deviation, tolerances: Tolerances) -> Iterator[Check]:
    measured = deviation.measured
    assert measured is not None
    form = measured.form
    deepest = max(measured.patches, key=lambda patch: patch.depth, default=None)
    values: dict[str, tuple[float | None, float | None]] = {
        "offset": (measured.offset, EXPANDED * measured.offset_sd),
        "tilt_deg": (math.degrees(measured.tilt), EXPANDED * math.degrees(measured.tilt_sd)),
        "radius": (abs(measured.radius), EXPANDED * measured.radius_sd),
        "cylindricity": (None, None) if form is None else (form.minimum_zone, form.noise),
        "ovality": (
            (None, None)
            if form is None or form.ovality is None or form.ovality_sd is None
            else (form.ovality, EXPANDED * form.ovality_sd)
        ),
        "taper": (None, None) if form is None else (abs(form.taper), EXPANDED * form.taper_sd),
        "dent": (
            (None, None)
            if form is None
            else (0.0, 0.0)
            if deepest is None
            else (deepest.depth, EXPANDED * deepest.depth_sd)
        ),
    }
    for name, (value, uncertainty) in values.items():
        tolerance = getattr(tolerances, name)
        if tolerance is None:
            continue
        if value is None or uncertainty is None:
            yield Check(name, None, None, tolerance, "undecided")
            continue
        # noise only ever adds to the cylindricity
        above = 0.0 if name == "cylindricity" else uncertainty
        verdict: Verdict = (
            "pass" if value + above <= tolerance else "fail" if value - uncertainty > tolerance else "undecided"
        )
        yield Check(name, value, uncertainty, tolerance, verdict)
