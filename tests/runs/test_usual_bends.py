"""Bend radii with what is usual as a prior."""

import numpy as np
import pytest

from cylx.records import Elbow
from cylx.runs.usual_bends import DIAMETER, DIAMETER_SD, Usual, nominal_of, posterior

R = 0.05


def test_a_bend_radius_that_points_tell_stays_and_one_that_they_leave_open_is_a_usual_one():
    usual = [Usual(0.15, 0.005, 0.75)]
    radius, std = posterior(0.151, 0.0005, R, usual)
    assert radius == pytest.approx(0.151, abs=0.0003)
    assert std <= 0.00055
    radius, std = posterior(0.17, 0.02, R, usual)
    assert abs(radius - 0.15) < 0.006
    assert 0.004 < std < 0.02
    # what contradicts all usual radii is what it is
    radius, std = posterior(0.25, 0.01, R, usual)
    assert radius == pytest.approx(0.25, abs=0.002)
    assert std == pytest.approx(0.01, rel=0.2)


def elbow(bend_radius, std):
    """Make an elbow of which the bend radius matters."""
    return Elbow(
        joins=(0, 1),
        ends=("end", "start"),
        confidence=0.9,
        inliers=100,
        std={"bend_radius": std},
        center=np.zeros(3),
        normal=np.array([0.0, 0.0, 1.0]),
        bend_radius=bend_radius,
        angle=1.5,
        radius=R,
        start=np.zeros(3),
        end=np.ones(3),
    )


def test_elbows_that_are_known_tell_the_nominal_diameter_of_their_size():
    mean, std = nominal_of([])
    assert mean == pytest.approx(DIAMETER, rel=0.01)
    assert std == pytest.approx(DIAMETER_SD * DIAMETER, rel=0.1)
    made = [elbow(times * 1.66 * R, 0.01 * times * 1.66 * R) for times in (1.0, 1.5, 3.0)]
    for one in made:  # one alone may have any radius
        told, known = nominal_of([one])
        assert 1.66 < told < 1.7
        assert known < 0.8 * std
    told, known = nominal_of(made)
    assert told == pytest.approx(1.66, rel=0.005)
    assert known < 0.25 * std
    # one that is bent to no usual radius tells nothing
    assert nominal_of([elbow(4.1 * 1.75 * R, 0.005 * R)]) == pytest.approx((mean, std), rel=0.1)


def test_a_radius_that_is_hardly_measured_is_a_usual_one_though_any_other_fits_as_well():
    usual = [Usual(0.13, 0.003, 0.45)]
    radius, std = posterior(0.0, 1.0, R, usual)
    assert abs(radius - 0.13) < 0.06
    assert std < 0.3
    # a mitre that is clearly one stays so
    assert posterior(0.0, 0.004, R, usual)[0] == pytest.approx(0.0, abs=1e-3)
