"""The oracle: what it says about its scenes must be so."""

import inspect
import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cylx.errors import UsageError
from cylx.geometry.cylinder import cylinder_coordinates, surface_distances
from cylx.synthetic import NOISE, OTHER_SURFACE, multi, piping, single
from cylx.synthetic.placement import segment_distances
from cylx.synthetic.surfaces import Box, Frustum, Sphere, Wall


def radial(points):
    return np.hypot(points[:, 0], points[:, 1])


def test_the_papers_cylinder_has_unit_radius_about_z():
    scene = single(points=5000, height=3.0, sigma=0.0)
    assert np.allclose(radial(scene.points), 1.0, atol=1e-12)
    assert np.abs(scene.points[:, 2]).max() <= 1.5
    assert np.ptp(scene.points[:, 2]) > 2.9
    shape = scene.cylinders[0].cylinder
    assert (shape.radius, shape.height, shape.direction.tolist()) == (1.0, 3.0, [0.0, 0.0, 1.0])


def test_the_noise_is_gaussian_of_sigma_in_each_coordinate():
    clean, noisy = single(points=40000, sigma=0.0, seed=5), single(points=40000, sigma=0.03, seed=5)
    noise = noisy.points - clean.points
    # the standard deviation of 40 000 samples is known to 1 / sqrt(80 000) = 0.35 %: five of these
    assert np.allclose(noise.std(axis=0), 0.03, rtol=0.018)
    assert np.allclose(noise.mean(axis=0), 0.0, atol=5 * 0.03 / 200)


def test_salt_and_pepper_stands_in_place_of_the_noise():
    clean = single(points=40000, sigma=0.0, p=0.3, sigma_o=0.0, seed=2)
    noisy = single(points=40000, sigma=0.04, p=0.3, sigma_o=0.03, seed=2)
    noise, outlier = noisy.points - clean.points, noisy.labels == NOISE
    assert np.isclose(outlier.mean(), 0.3, atol=5 * np.sqrt(0.3 * 0.7 / 40000))
    assert np.allclose(noise[outlier].std(axis=0), 0.03, rtol=0.033)  # were they added, it would be 0.05
    assert np.allclose(noise[~outlier].std(axis=0), 0.04, rtol=0.022)
    assert noisy.cylinders[0].points == (~outlier).sum()


@pytest.mark.parametrize("theta_deg", [30.0, 135.0, 270.0])
def test_only_the_arc_theta_is_seen(theta_deg):
    scene = single(points=20000, sigma=0.0, theta_deg=theta_deg)
    angles = np.sort(np.degrees(np.arctan2(scene.points[:, 1], scene.points[:, 0])))
    unseen = np.diff(angles, append=angles[0] + 360).max()
    assert 360 - theta_deg <= unseen < 360 - theta_deg + 0.5
    assert scene.cylinders[0].coverage_deg == theta_deg


@pytest.mark.parametrize("seed", range(3))
def test_every_label_tells_what_the_point_lies_on(seed):
    sigma = 0.003
    scene = multi(points=30000, planes=3, sigma=sigma, seed=seed)
    assert np.unique(scene.labels).tolist() == [NOISE, OTHER_SURFACE, *range(5)]
    for i, true in enumerate(scene.cylinders):
        own = scene.points[scene.labels == i]
        shape = true.cylinder
        heights, distances, _ = cylinder_coordinates(own, shape.point, shape.direction)
        assert len(own) == true.points
        assert np.abs(distances - shape.radius).max() < 6 * sigma
        assert np.abs(heights).max() < 0.5 * shape.height + 6 * sigma
        assert true.ignore == (len(own) < 100)


@pytest.mark.parametrize("seed", range(5))
def test_nothing_else_is_on_a_cylinder(seed):
    scene = multi(points=30000, cylinders=8, planes=6, boxes=4, spheres=4, cones=4, noise=0.0, sigma=0.0, seed=seed)
    for i, true in enumerate(scene.cylinders):
        shape = true.cylinder
        others = scene.points[scene.labels != i]
        heights, distances, _ = cylinder_coordinates(others, shape.point, shape.direction)
        beside = np.abs(heights) <= 0.5 * shape.height
        assert distances[beside].min() > shape.radius


def test_density_is_the_same_on_every_surface():
    scene = multi(points=200000, noise=0.0, planes=1, sigma=0.0, coverage_min_deg=360.0)
    floor = (scene.points[:, 2] == 0).sum() / scene.params["room"] ** 2
    for true in scene.cylinders:
        shape = true.cylinder
        assert np.isclose(true.points / (2 * np.pi * shape.radius * shape.height), floor, rtol=0.01)


@pytest.mark.parametrize(
    ("surface", "distance"),
    [
        (Sphere(np.ones(3), 0.5), lambda q: np.linalg.norm(q - 1, axis=1) - 0.5),
        (
            Box(np.zeros(3), np.array([1.0, 2.0, 4.0]), np.eye(3)),
            lambda q: np.abs(np.abs(q) - [0.5, 1.0, 2.0]).min(axis=1),
        ),
        (Wall(np.array([1.0, 2.0, 3.0]), 1, 2.0), lambda q: q[:, 1] - 2.0),
        (Frustum(np.zeros(3), np.array([0.0, 0.0, 1.0]), 1.0, 2.0, 4.0), lambda q: radial(q) - 1.5 - q[:, 2] / 4),
    ],
    ids=["sphere", "box", "wall", "frustum"],
)
def test_samples_lie_on_their_surface_evenly(surface, distance):
    points = surface.sample(np.random.default_rng(0), 20000)
    assert np.abs(distance(points)).max() < 1e-12
    if isinstance(surface, Frustum):  # share of the area below the middle: (1 + 1.5) / 2 of (1 + 2) / 2, times a half
        assert np.isclose((points[:, 2] < 0).mean(), 2.5 / 6, atol=0.0175)
    if isinstance(surface, Box):  # the two faces of 2 x 4, of 28 in all
        assert np.isclose((np.abs(points[:, 0]) == 0.5).mean(), 16 / 28, atol=0.0175)
    if isinstance(surface, Sphere):  # Archimedes: heights are uniform
        assert np.isclose((points[:, 2] > 1.25).mean(), 0.25, atol=0.0155)


@given(st.integers(0, 2**32), st.integers(1, 6))
@settings(max_examples=60, deadline=None)
def test_segment_distance_is_the_least_over_both_segments(seed, n):
    rng = np.random.default_rng(seed)
    start, end = rng.standard_normal((2, 3))
    starts, ends = rng.standard_normal((2, n, 3))
    ends[0] = starts[0]  # a point
    if n > 1:
        ends[1] = starts[1] + (end - start)  # a parallel
    grid = np.linspace(0, 1, 41)
    on_own = start + grid[:, None] * (end - start)
    given_distances = segment_distances(start, end, starts, ends)
    for i in range(n):
        on_other = starts[i] + grid[:, None] * (ends[i] - starts[i])
        least = np.linalg.norm(on_own[:, None] - on_other, axis=2).min()
        step = (np.linalg.norm(end - start) + np.linalg.norm(ends[i] - starts[i])) / 80
        assert least - step - 1e-12 <= given_distances[i] <= least + 1e-12


def test_a_seed_gives_one_scene_and_another_seed_another():
    for family in (single, multi, piping):
        first, again, other = family(points=500, seed=7), family(points=500, seed=7), family(points=500, seed=8)
        assert np.array_equal(first.points, again.points)
        assert first.truth() == again.truth()
        assert not np.array_equal(first.points, other.points)


def test_moving_carries_the_truth_along():
    offset = np.array([512345678.0, 5412345432.0, 123400.0])
    scene = multi(points=4000, seed=3)
    moved = scene.moved(1000.0, offset)
    assert moved.sigma == 1000 * scene.sigma
    for true in moved.cylinders:
        own = moved.points[moved.labels == moved.cylinders.index(true)]
        assert np.abs(surface_distances(own, true.cylinder)).max() < 6 * moved.sigma
    twice = scene.moved(10.0, [1, 2, 3]).moved(2.0, [1, 1, 1])
    assert np.allclose(twice.points, 20 * scene.points + [3, 5, 7])
    assert (twice.params["scale"], twice.params["offset"]) == (20.0, [3.0, 5.0, 7.0])


def test_the_truth_is_json_and_has_the_keys_of_a_truth():
    truth = single(points=200).truth()
    assert json.loads(json.dumps(truth)) == truth
    assert list(truth) == ["family", "seed", "sigma", "params", "points", "cylinders"]
    assert list(truth["cylinders"][0]) == [
        "id", "axis_point", "axis_direction", "radius", "height", "start", "end", "points", "coverage_deg", "ignore",
    ]  # fmt: skip


@pytest.mark.parametrize("family", [single, multi, piping])
def test_the_params_make_the_scene_again(family):
    scene = family(points=300, seed=4, sigma=0.005)
    again = family(seed=scene.seed, sigma=scene.sigma, **scene.params)
    assert np.array_equal(scene.points, again.points)
    assert set(inspect.signature(family).parameters) == {"seed", "sigma", *scene.params}


def test_what_is_hardly_there_is_to_be_ignored():
    assert single(points=99).cylinders[0].ignore
    assert not single(points=200).cylinders[0].ignore
    assert single(points=2000, theta_deg=14.0).cylinders[0].ignore


def test_a_room_may_be_empty():
    scene = multi(points=100, cylinders=0, planes=0, boxes=0, spheres=0, cones=0, noise=1.0)
    assert (len(scene.points), scene.cylinders) == (100, ())
    assert (scene.labels == NOISE).all()


@pytest.mark.parametrize(
    ("family", "params", "message"),
    [
        (single, {"points": 0}, "points: must be > 0, not 0; choose another value"),
        (single, {"height": -1.0}, "height: must be > 0, not -1.0; choose another value"),
        (single, {"sigma": float("nan")}, "sigma: must be >= 0, not nan; choose another value"),
        (single, {"p": 1.5}, "p: must be in [0, 1], not 1.5; choose another value"),
        (single, {"sigma_o": -0.1}, "sigma_o: must be >= 0, not -0.1; choose another value"),
        (single, {"theta_deg": 361.0}, "theta_deg: must be in (0, 360], not 361.0; choose another value"),
        (single, {"seed": -1}, "seed: must be >= 0, not -1; choose another value"),
        (multi, {"points": 0}, "points: must be > 0, not 0; choose another value"),
        (multi, {"boxes": -1}, "boxes: must be >= 0, not -1; choose another value"),
        (multi, {"planes": 7}, "planes: must be <= 6, not 7; choose another value"),
        (multi, {"noise": 1.1}, "noise: must be in [0, 1], not 1.1; choose another value"),
        (multi, {"sigma": -1.0}, "sigma: must be >= 0, not -1.0; choose another value"),
        (multi, {"seed": -1}, "seed: must be >= 0, not -1; choose another value"),
        (multi, {"radius_min": 0.5}, "radius_min: must be > 0 and <= radius_max, not 0.5; choose another value"),
        (multi, {"coverage_min_deg": 0}, "coverage_min_deg: must be in (0, 360], not 0; choose another value"),
        (multi, {"room": 0.0}, "room: must be > 0, not 0.0; choose another value"),
        (
            multi,
            {"cylinders": 0, "planes": 0, "boxes": 0, "spheres": 0, "cones": 0},
            "noise: must be 1 if there is no surface; choose another value",
        ),
        (
            multi,
            {"cylinders": 500, "room": 1.0},
            "cylinders: no room for all of them in a room 1 wide; ask for fewer, or a larger room",
        ),
    ],
)
def test_what_cannot_be_made_is_refused(family, params, message):
    with pytest.raises(UsageError) as caught:
        family(**params)
    assert str(caught.value) == message


@pytest.mark.parametrize(
    ("scale", "offset", "place"),
    [(0.0, (0, 0, 0), "scale"), (1.0, (0, 0), "offset"), (1.0, (0, 0, float("inf")), "offset")],
)
def test_a_frame_that_is_none_is_refused(scale, offset, place):
    with pytest.raises(UsageError) as caught:
        single(points=10).moved(scale, offset)
    assert caught.value.place == place
