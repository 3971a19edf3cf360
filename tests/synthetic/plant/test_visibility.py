"""Which points are seen: against shadows that can be told on paper, and against marching along the rays."""

import math

import numpy as np
import pytest

from cylx.synthetic.plant.surfaces import Bend, Block, Revolved, pipe
from cylx.synthetic.plant.visibility import seen_from

Z = np.array([0.0, 0.0, 1.0])


def looked_at(points, normals, solids, scanner):
    lifts = np.full(len(points), 1e-6)
    return seen_from(np.array(points), np.array(normals), lifts, np.concatenate(solids), np.array([scanner]))


@pytest.mark.parametrize(
    "solid",
    [
        Block(np.array([0.0, 0.0, 1.0]), np.array([1.0, 1.0, 0.2]), np.eye(3)),
        Revolved(np.array([0.0, 0.0, 1.0]), Z, -0.1, 0.1, 0.5),
        Revolved(np.array([0.0, 0.0, 1.0]), Z, -0.5, 0.5, 0.5, bulge=1.0),
        Revolved(np.array([0.0, 0.0, 0.5]), Z, 0.0, 1.0, 0.5, slope=-0.4),
    ],
    ids=["block", "disc", "ball", "cone"],
)
def test_a_shadow_is_as_wide_as_what_throws_it(solid):
    """From far above, the shadow on the floor reaches as far as the solid does."""
    x = np.linspace(-2, 2, 401)
    floor = np.column_stack([x, np.zeros_like(x), np.zeros_like(x)])
    seen, buried = looked_at(floor, np.tile(Z, (len(x), 1)), [solid.solids()], (0.0, 0.0, 1e6))
    assert not buried.any()
    assert seen[np.abs(x) > 0.501].all()
    assert not seen[np.abs(x) < 0.499].any()


def test_only_the_front_of_a_pipe_is_seen_and_not_at_a_grazing_angle():
    mantle = pipe(np.zeros(3), Z, 0.1)
    points, normals = mantle.sample(np.random.default_rng(0), 5000)
    seen, buried = looked_at(points, normals, [mantle.solids()], (1e5, 0.0, 0.5))
    assert not buried.any()
    assert np.array_equal(seen, normals[:, 0] > 0.1)


def test_what_is_inside_is_buried_and_what_is_behind_is_hidden():
    solid = pipe(np.zeros(3), Z, 0.5).solids()
    points = [(0.0, 0.0, 0.5), (0.0, 0.0, 1.5), (0.0, 0.0, -1.0), (0.6, 0.0, 0.5)]
    seen, buried = looked_at(points, np.tile(Z, (4, 1)), [solid], (0.0, 0.0, 10.0))
    assert buried.tolist() == [True, False, False, False]
    assert seen.tolist() == [False, True, False, True]


def test_any_scanner_is_enough():
    solid = Block(np.array([0.0, 0.0, 1.0]), np.ones(3), np.eye(3)).solids()
    places = np.array([[0.0, 0.0, 10.0], [10.0, 0.0, 3.0]])
    point, normal = np.array([[0.0, 0.0, 0.0]]), Z[None, :]
    for chosen, expected in (([0], False), ([1], True), ([0, 1], True)):
        assert seen_from(point, normal, np.zeros(1), solid, places[chosen])[0].tolist() == [expected]


@pytest.mark.parametrize("seed", range(4))
def test_rays_agree_with_marching_along_them(seed):
    """Random solids, near and far, against many steps along each ray; what only grazes a solid may differ."""
    rng = np.random.default_rng(seed)
    shapes = []
    for _ in range(20):
        base, axis, skew = rng.uniform(-3, 3, 3), rng.standard_normal(3), rng.standard_normal(3)
        axis /= np.linalg.norm(axis)
        skew -= skew @ axis * axis
        length, radius = rng.uniform(0.2, 3), rng.uniform(0.2, 0.8)
        slope = rng.uniform(-0.9, 0.9) * radius / length
        shapes.append(Revolved(base, axis, 0.0, length, radius, slope=slope, skew=0.3 * skew))
    scanner = rng.uniform(-5, 5, 3)
    points = rng.uniform(-4, 4, (200, 3))
    toward = scanner - points
    normals = toward / np.linalg.norm(toward, axis=1, keepdims=True)
    seen, _ = looked_at(points, normals, [shape.solids() for shape in shapes], scanner)
    inmost = np.full(len(points), np.inf)
    steps = np.linspace(0, 1, 1500)
    for shape in shapes:
        ways = points[:, None] + steps[:, None] * toward[:, None] - shape.base
        s = ways @ shape.direction
        rho = np.linalg.norm(ways - s[..., None] * (shape.direction + shape.skew), axis=-1)
        outside = np.maximum(rho - shape.radius - shape.slope * s, np.maximum(-s, s - shape.high))
        inmost = np.minimum(inmost, outside.min(axis=1))
    clear = np.abs(inmost) > 0.02
    assert 0.15 < (inmost < 0).mean() < 0.85
    assert np.array_equal(seen[clear], inmost[clear] > 0)


def test_a_bend_hides_itself_from_inside_only_where_it_must():
    """From the middle of its circle, all of the inner half of a bend is seen; the outer half is not."""
    bend = Bend(np.zeros(3), Z, np.array([1.0, 0.0, 0.0]), 1.0, 0.2, math.radians(90))
    points, normals = bend.sample(np.random.default_rng(0), 4000)
    lifts = np.full(len(points), bend.lift)
    seen, buried = seen_from(points, normals, lifts, bend.solids(), np.zeros((1, 3)))
    assert not buried.any()
    facing = -np.einsum("ij,ij->i", points, normals) / np.linalg.norm(points, axis=1)
    assert seen[facing > 0.11].all()
    assert not seen[facing < 0.09].any()
