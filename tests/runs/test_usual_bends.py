"""Bend radii with what is usual as a prior."""

import pytest

from cylx.runs.usual_bends import Usual, posterior

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
