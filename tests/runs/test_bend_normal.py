"""The normal equations of a bend, against its centre line and differences."""

import math

import numpy as np
import pytest

from cylx.runs.bend_fit import axes_of, bend_of
from cylx.runs.bend_normal import fill_bend_frame, fill_bend_normal
from cylx.runs.pipes import Pipe

R = 0.05
STATE = np.array([0.002, -0.001, 0.003, 0.002, -0.001, 0.001, -0.002, 0.004, R, 0.16])
SMALL = np.array([*[1e-6] * 2, *[1e-6] * 2, *[1e-6] * 2, *[1e-6] * 2, *[1e-6] * 2])


def pipes():
    """Make two pipes whose axes nearly meet."""
    known = np.diag([1e-6, 1e-6, 1e-6, 1e-6, 1e-8])
    one = Pipe(np.array([-1.0, 0.0, 0.001]), np.zeros(3), R, 0.002, known, 0)
    two = Pipe(np.array([0.15, 1.0, 0.0]), np.array([0.15, 0.15, 0.0]), R, 0.002, known, 1)
    return one, two


def test_the_frame_is_that_of_the_centre_line():
    one, two = pipes()
    bend, skew = bend_of(one, two, ("end", "end"), STATE[:8], STATE[9])
    frame, passing = np.empty((6, 3)), np.empty(3)
    radius, angle = fill_bend_frame(axes_of(one, two), np.array([1.0, -1.0]), STATE, frame, passing)
    assert (radius, angle) == pytest.approx((bend.bend_radius, bend.angle))
    expected = [bend.center, bend.first, -bend.inward, bend.normal, bend.end, bend.second]
    assert frame == pytest.approx(np.stack(expected), abs=1e-9)
    assert passing == pytest.approx(skew, abs=1e-9)


def test_the_equations_are_those_of_weighted_least_squares():
    one, two = pipes()
    rng = np.random.default_rng(0)
    points = rng.uniform([-0.2, -0.1, -0.08], [0.25, 0.3, 0.08], (400, 3))
    spread, width, skewed = 0.02, 0.09, 0.001
    reach = np.array([spread, width, 0.0, 0.0, 2.0 * R, 0.25, skewed])
    normal, gradient = np.empty((10, 10)), np.empty(10)
    signs = np.array([1.0, -1.0])
    fill_bend_normal(points, axes_of(one, two), signs, STATE, SMALL, reach, normal, gradient)

    def residuals(state):
        bend, skew = bend_of(one, two, ("end", "end"), state[:8], state[9])
        along, distances = bend.coordinates(points)
        return along, distances - state[8], skew, bend.length

    along, errors, skew, length = residuals(STATE)
    beside = np.maximum(np.maximum(-along, along - length), 0.0)
    weights = np.maximum(1.0 - (errors / width) ** 2, 0.0) ** 2 / spread**2
    weights *= np.where(beside > 2.0 * R, 0.0, np.where(beside > 0.0, 0.25, 1.0))
    rows = [(residuals(STATE + SMALL * unit), step) for unit, step in zip(np.eye(10), SMALL, strict=True)]
    jacobian = np.stack([(one[1] - errors) / step for one, step in rows], axis=1)
    passing = np.stack([(one[2] - skew) / step for one, step in rows], axis=1)
    expected = (jacobian * weights[:, None]).T @ jacobian + passing.T @ passing / skewed**2
    assert normal == pytest.approx(expected, rel=1e-5, abs=1e-5 * np.abs(expected).max())
    right = jacobian.T @ (weights * errors) + passing.T @ skew / skewed**2
    assert gradient == pytest.approx(right, rel=1e-5, abs=1e-5 * np.abs(right).max())


def test_points_beyond_the_arc_have_no_say_if_they_shall_not():
    one, two = pipes()
    far = np.column_stack([np.linspace(-0.9, -0.3, 50), np.full(50, R), np.zeros(50)])
    reach = np.array([0.002, 0.009, 0.0, 0.0, 0.0, 0.0, math.inf])
    normal, gradient = np.empty((10, 10)), np.empty(10)
    cost = fill_bend_normal(far, axes_of(one, two), np.array([1.0, -1.0]), STATE, SMALL, reach, normal, gradient)
    assert (cost, np.abs(normal).max(), np.abs(gradient).max()) == (0.0, 0.0, 0.0)
