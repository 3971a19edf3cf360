"""Runs as they were built: axes meet and angles are round where the uncertainties allow, and only there."""

import math

import numpy as np
import pytest

from cylx.records import Elbow, PipeRun, PipeSize, Piping
from cylx.runs.constraints import fit_runs
from tests.support.pipework import fit_of

R = 0.05


def bent(angle_deg, skew=0.0, radius=R):
    """Make two cylinders with an elbow of an angle between them, whose axes pass each other, and their run."""
    turn = math.radians(angle_deg)
    onward = np.array([math.cos(turn), math.sin(turn), 0.0])
    lift = np.array([0.0, 0.0, skew])
    fits = [fit_of([-1, 0, 0], [-0.15, 0, 0], R), fit_of(0.15 * onward + lift, onward + lift, radius)]
    elbow = Elbow(
        joins=(0, 1),
        ends=("end" if fits[0].cylinder.direction[0] > 0 else "start", "start"),
        confidence=0.9,
        center=np.zeros(3),
        normal=np.array([0.0, 0, 1]),
        bend_radius=0.15,
        angle=turn,
        radius=R,
        start=np.zeros(3),
        end=np.zeros(3),
    )
    size = PipeSize(0.5 * (R + radius), 1e-4, 2.0, (0, 1))
    return fits, Piping((elbow,), (PipeRun((0, 1), (0,), 2.0, None, (size,), ()),))


def axes_of(cylinders):
    one, two = (fit.cylinder for fit in cylinders)
    across = np.cross(one.direction, two.direction)
    skew = (two.point - one.point) @ across / np.linalg.norm(across)
    return math.degrees(math.atan2(np.linalg.norm(across), one.direction @ two.direction)), skew


def test_an_angle_that_is_nearly_round_becomes_round():
    fits, piping = bent(90.02, skew=1e-4)
    moved, fitted = fit_runs(fits, piping)
    angle, skew = axes_of(moved)
    assert angle == pytest.approx(90.0, abs=1e-6)
    assert skew == pytest.approx(0.0, abs=1e-8)
    assert math.degrees(fitted.fittings[0].angle) == pytest.approx(90.0, abs=1e-6)
    assert moved[0].measured.point == pytest.approx(fits[0].cylinder.point)
    told = {one.what: one for one in fitted.adjustments if one.fitting == 0}
    assert told["angle_deg"].measured == pytest.approx(89.98)
    assert told["meeting"].measured == pytest.approx(1e-4, rel=1e-3)
    assert all(one.applied for one in told.values())


def test_an_angle_that_is_not_round_stays():
    fits, piping = bent(83.0)
    moved, fitted = fit_runs(fits, piping)
    assert axes_of(moved)[0] == pytest.approx(83.0, abs=0.01)
    (angle,) = (one for one in fitted.adjustments if one.what == "angle_deg")
    assert (angle.applied, angle.target) == (False, pytest.approx(90.0))


def test_axes_that_clearly_miss_each_other_stay():
    fits, piping = bent(90.0, skew=0.01)
    moved, fitted = fit_runs(fits, piping)
    assert abs(axes_of(moved)[1]) == pytest.approx(0.01, rel=1e-3)
    (meeting,) = (one for one in fitted.adjustments if one.what == "meeting")
    assert not meeting.applied


def test_radii_of_a_size_become_one():
    fits, piping = bent(90.0, radius=R + 1e-4)
    moved, _ = fit_runs(fits, piping)
    assert moved[0].cylinder.radius == moved[1].cylinder.radius == pytest.approx(R + 5e-5)


def test_the_less_certain_axis_moves_more():
    fits, piping = bent(90.05)
    loose = fits[1].covariance * 100.0
    fits[1] = fit_of(fits[1].cylinder.start, fits[1].cylinder.end, R)
    object.__setattr__(fits[1], "covariance", loose)
    moved, _ = fit_runs(fits, piping)
    turned = [
        np.linalg.norm(np.cross(one.cylinder.direction, other.cylinder.direction))
        for one, other in zip(fits, moved, strict=True)
    ]
    assert turned[1] > 10.0 * turned[0]
