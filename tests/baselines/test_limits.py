"""Limits of what is looked for."""

import numpy as np

from cylx.baselines import Limits


def test_limits_admit_directions_either_way_up_to_their_tilt():
    upright = Limits((0.5, 2.0), np.array([0.0, 0.0, 1.0]), np.radians(10))
    for angle, admitted in ((0, True), (9.9, True), (10.1, False), (90, False), (170.1, True), (180, True)):
        direction = np.array([np.sin(np.radians(angle)), 0.0, np.cos(np.radians(angle))])
        assert upright.admit(direction) == admitted
        assert Limits((0.5, 2.0)).admit(direction)
    np.testing.assert_allclose(upright.numbers, [0.5, 2.0, 0.0, 0.0, 1.0, np.cos(np.radians(10))])
    assert Limits((0.5, 2.0)).numbers.tolist() == [0.5, 2.0, 0.0, 0.0, 0.0, -1.0]
