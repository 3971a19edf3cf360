"""Walls about a known axis: the counterbore of a bore, and what is no wall."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import cylx
from cylx.config import Config
from cylx.geometry.cells import Cells
from cylx.records import Finding, IndexedCloud, Noise, Segment
from cylx.scene import make_frame
from cylx.stages.coaxial import walls_about

SIGMA, BORE = 0.2, 5.0


def ring(rng, inner, outer, height):
    """Draw the flat ring between two circles, one point for each unit of area."""
    count = round(np.pi * (outer**2 - inner**2))
    turn, away = 2 * np.pi * rng.random(count), np.sqrt(rng.uniform(inner**2, outer**2, count))
    return np.column_stack([away * np.cos(turn), away * np.sin(turn), np.full(count, height)])


def wall(rng, radius, low, high):
    """Draw a cylinder."""
    count = round(2 * np.pi * radius * (high - low))
    turn = 2 * np.pi * rng.random(count)
    return np.column_stack([radius * np.cos(turn), radius * np.sin(turn), rng.uniform(low, high, count)])


def counterbore(seed, step=8.0, depth=3.7):
    """Draw a bore and its counterbore in a plate; lengths in spacings."""
    rng = np.random.default_rng(seed)
    parts = [
        wall(rng, BORE, -8.0, 0.0),
        ring(rng, BORE, step, 0.0),
        wall(rng, step, 0.0, depth),
        ring(rng, step, 25.0, depth),
    ]
    points = np.concatenate(parts)
    return points + SIGMA * rng.standard_normal(points.shape), len(parts[0])


def walls(points, bore, tilt_error=0.01):
    """Give the walls about the bore, as (radius, height), in units of the points."""
    frame, _ = make_frame(points, Config())
    unit = frame.spacing
    indexed = IndexedCloud(
        Cells(frame.points, frame.codes), np.zeros(len(points)), Noise(np.ones(1), np.array([SIGMA / unit])), None, None
    )
    middle = np.array([0.0, 0.0, -4.0])
    model = np.concatenate([(middle - frame.origin) / unit, [0.0, 0.0, 1.0], [BORE / unit]])
    own = np.flatnonzero(frame.order < bore)
    known = Finding(Segment(model, 4.0 / unit, SIGMA / unit), own, 10, 0.9, 0.99, 2 * np.pi, 0.02, tilt_error)
    free = np.ones(len(points), np.bool_)
    free[own] = False
    return [(wall.radius * unit, 2.0 * wall.half * unit) for wall in walls_about(known, indexed, free)]


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize(("step", "depth"), [(8.0, 3.7), (7.0, 6.0), (12.0, 2.5)])
def test_the_counterbore_of_a_bore_is_proposed(seed, step, depth):
    found = walls(*counterbore(seed, step, depth))
    assert len(found) >= 1
    radius, height = found[0]
    assert radius == pytest.approx(step, rel=0.04)
    assert height == pytest.approx(depth, abs=2.5)


def test_a_floor_and_strays_are_no_walls():
    rng = np.random.default_rng(0)
    bore = wall(rng, BORE, -8.0, 0.0)
    for other in (ring(rng, BORE, 25.0, 0.0), rng.uniform(-30, 30, (4000, 3))):
        points = np.concatenate([bore, other])
        assert walls(points + SIGMA * rng.standard_normal(points.shape), len(bore)) == []


def test_about_an_axis_that_is_hardly_known_nothing_is_looked_for():
    assert walls(*counterbore(0), tilt_error=1.0) == []


def test_a_counterbore_is_found_as_a_cylinder_of_its_own_however_it_is_turned():
    turn = Rotation.random(random_state=3).as_matrix()
    for points in (counterbore(1)[0], 1e-3 * counterbore(1)[0] @ turn.T):
        unit = 1.0 if np.ptp(points) > 1.0 else 1e-3
        radii = sorted(fit.cylinder.radius / unit for fit in cylx.extract(points).cylinders)
        assert radii == pytest.approx([BORE, 8.0], rel=0.03)
