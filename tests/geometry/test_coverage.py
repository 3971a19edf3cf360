"""The angle that few points cover."""

import numpy as np
import pytest

from cylx.geometry.coverage import covered_angle, likely_angle


@pytest.mark.parametrize("covered_deg", [90.0, 180.0, 270.0, 360.0])
@pytest.mark.parametrize("count", [60, 300, 3000])
def test_the_likely_angle_is_that_of_the_surface(covered_deg, count):
    rng = np.random.default_rng(0)
    likely = [likely_angle(np.radians(covered_deg) * rng.random(count) - np.pi) for _ in range(100)]
    assert np.degrees(np.median(likely)) == pytest.approx(covered_deg, abs=15.0)


def test_it_is_never_less_than_what_is_covered_nor_more_than_a_turn():
    rng = np.random.default_rng(1)
    for count in (0, 1, 2, 10, 40, 1000):
        angles = 2 * np.pi * rng.random(count) - np.pi
        assert covered_angle(angles) <= likely_angle(angles) + 1e-12
        assert likely_angle(angles) <= 2 * np.pi + 1e-12
