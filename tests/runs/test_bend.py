"""The centre line of a bend: it is smooth, touches both axes, and moves with them."""

import math

import numpy as np
import pytest

from cylx.runs.bend import Bend

X, Y, Z = np.eye(3)
BENDS = [
    Bend(np.array([1.0, 2, 3]), X, Y, 0.5),
    Bend(np.zeros(3), Z, (X + Z) / math.sqrt(2.0), 2.0),
    Bend(np.zeros(3), X, (Y - X) / math.sqrt(2.0), 0.3),
]


@pytest.mark.parametrize("bend", BENDS)
def test_points_of_the_centre_line_are_at_no_distance_and_in_order(bend):
    turn = np.linspace(0.0, bend.angle, 9)
    radial = (bend.start - bend.center) / bend.bend_radius
    arc = bend.center + bend.bend_radius * (np.cos(turn)[:, None] * radial + np.sin(turn)[:, None] * bend.first)
    before, after = bend.start - 0.7 * bend.first, bend.end + 0.9 * bend.second
    along, distances = bend.coordinates(np.vstack([before, arc, after]))
    assert distances == pytest.approx(0.0, abs=1e-7)
    assert along == pytest.approx([-0.7, *(bend.bend_radius * turn), bend.length + 0.9], abs=1e-9)
    assert arc[-1] == pytest.approx(bend.end)


@pytest.mark.parametrize("bend", BENDS)
def test_distances_are_those_from_the_nearest_point_of_the_line(bend):
    rng = np.random.default_rng(1)
    turn = np.linspace(0.0, bend.angle, 2001)
    radial = (bend.start - bend.center) / bend.bend_radius
    arc = bend.center + bend.bend_radius * (np.cos(turn)[:, None] * radial + np.sin(turn)[:, None] * bend.first)
    far = np.linspace(0.0, 3.0, 3001)[:, None]
    line = np.vstack([bend.start - far * bend.first, arc, bend.end + far * bend.second])
    inner = np.vstack([line[:2500], arc, line[-3001:-500]])
    some = inner[rng.integers(0, len(inner), 200)] + rng.normal(0, 0.05 * bend.bend_radius, (200, 3))
    nearest = np.array([np.linalg.norm(line - point, axis=1).min() for point in some])
    assert bend.coordinates(some)[1] == pytest.approx(nearest, abs=2e-3)


def test_a_bend_without_radius_is_the_corner():
    bend = Bend(np.zeros(3), X, Y, 0.0)
    along, distances = bend.coordinates(np.array([[-2.0, 0, 1], [0, 3, -1]]))
    assert along == pytest.approx([-2.0, 3.0])
    assert distances == pytest.approx([1.0, 1.0])
    assert bend.center == pytest.approx(np.zeros(3))


def test_the_normal_turns_the_first_direction_into_the_second():
    for bend in BENDS:
        assert np.cross(bend.normal, bend.first) @ bend.second > 0
        assert bend.normal @ bend.first == pytest.approx(0.0, abs=1e-12)
