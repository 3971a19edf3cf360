"""What a cloud says about itself: spacing and noise as they are, in any unit, place, direction and order."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from cylx.config import Config, load_config
from cylx.errors import InputError
from cylx.geometry.cylinder import Cylinder
from cylx.geometry.morton import morton_codes
from cylx.records import Noise
from cylx.scene import (
    canonical_order,
    cell_cube,
    check_usable,
    known_of,
    make_frame,
    measure_scene,
    radius_range,
    resolve,
)
from cylx.synthetic import multi, single

UTM = np.array([512345.678, 5412345.432, 123.4])


def plane(n, sigma, seed=0):
    """Give noisy points of a plane of area 1 that stands at an angle."""
    rng = np.random.default_rng(seed)
    flat = np.column_stack([rng.random((n, 2)), np.zeros(n)]) + sigma * rng.standard_normal((n, 3))
    return flat @ Rotation.from_rotvec([0.3, 0.5, 0.2]).as_matrix().T


@pytest.mark.parametrize(("n", "sigma"), [(2500, 0.001), (2500, 0.01), (6000, 0.005)])
def test_a_plane_shows_its_spacing_and_noise(n, sigma):
    scene = measure_scene(plane(n, sigma))
    assert np.isclose(scene.spacing, n**-0.5, rtol=0.1)  # each point has an area of the spacing squared
    assert np.isclose(scene.noise, sigma, rtol=0.1)


@pytest.mark.parametrize(("n", "sigma"), [(60000, 0.03), (60000, 0.05), (20000, 0.1), (200000, 0.03)])
def test_noise_of_several_spacings_is_noise(n, sigma):
    scene = measure_scene(single(points=n, sigma=sigma, seed=2).points)
    assert sigma > 1.2 * scene.spacing
    assert np.isclose(scene.noise, sigma, rtol=0.1)


@pytest.mark.parametrize(("n", "theta_deg"), [(2500, 360), (2500, 90), (6000, 360)])
@pytest.mark.parametrize("sigma", [0.003, 0.02])
def test_a_cylinder_shows_its_spacing_and_noise(n, theta_deg, sigma):
    scene = measure_scene(single(points=n, sigma=sigma, theta_deg=theta_deg).points)
    assert np.isclose(scene.spacing, np.sqrt(np.radians(theta_deg) * 4 / n), rtol=0.1)
    assert np.isclose(scene.noise, sigma, rtol=0.1)
    assert np.isclose(scene.extent, np.linalg.norm([2, 2, 4]) if theta_deg == 360 else 4.25, rtol=0.05)


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("share", [0.05, 0.15, 0.3, 0.5])
@pytest.mark.parametrize("kind", ["room", "whole", "part"])
def test_spacing_and_noise_are_those_put_in_from_next_to_nothing_to_half_a_spacing(kind, share, seed):
    if kind == "room":
        clean = multi(points=8000, sigma=0.0, noise=0.0, seed=seed)
        floor = (clean.points[:, 2] < 1e-9).sum()  # things that touch it are too few to count
        spacing = clean.params["room"] / np.sqrt(floor)
        scene = multi(points=8000, sigma=share * spacing, noise=0.0, seed=seed)
    else:
        theta_deg = 360.0 if kind == "whole" else 120.0
        spacing = np.sqrt(np.radians(theta_deg) * 4 / 6000)
        scene = single(points=6000, sigma=share * spacing, theta_deg=theta_deg, seed=seed)
    measured = measure_scene(scene.points)
    assert np.isclose(measured.spacing, spacing, rtol=0.1)
    assert np.isclose(measured.noise, share * spacing, rtol=0.1)


@pytest.mark.parametrize("sigma", [0.002, 0.005])
def test_a_room_full_of_things_shows_the_noise_of_its_surfaces(sigma):
    scene = multi(points=12000, sigma=sigma, noise=0.05, seed=4)
    floor = 12000 * np.mean((scene.points[:, 2] < 4 * sigma) & (scene.labels == -1))
    measured = measure_scene(scene.points)
    assert np.isclose(measured.noise, sigma, rtol=0.1)
    assert np.isclose(measured.spacing, 2.0 / np.sqrt(floor), rtol=0.1)  # the floor is 2 x 2


@pytest.mark.parametrize(("p", "sigma_o"), [(0.1, 0.04), (0.3, 0.04), (0.2, 0.2)])
def test_outliers_hardly_change_the_noise(p, sigma_o):
    scene = measure_scene(single(points=4000, sigma=0.01, p=p, sigma_o=sigma_o).points)
    # all points together have a standard deviation of up to 0.11
    assert 0.009 < scene.noise < 0.015


def test_a_surface_without_noise_has_a_scale_all_the_same():
    grid = np.stack(np.meshgrid(np.arange(40.0), np.arange(40.0)), axis=-1).reshape(-1, 2)
    scene = measure_scene(np.column_stack([grid, np.zeros(1600)]))
    assert np.isclose(scene.spacing, 1.0, rtol=0.1)
    assert 0 < scene.noise < 0.01


@pytest.mark.parametrize("n", [5, 6, 9, 12, 30])
def test_a_handful_of_points_has_some_scale(n):
    points = np.random.default_rng(n).random((n, 3))
    scene = measure_scene(points)
    assert 0.02 < scene.spacing < 1.5
    assert 0 < scene.noise < 1


@pytest.fixture(scope="module")
def small():
    """A scene of which every point is looked at, and what it says."""
    points = multi(points=2500, cylinders=2, planes=1, boxes=0, spheres=0, cones=0, seed=3).points
    return points, measure_scene(points)


@pytest.fixture(scope="module")
def large():
    points = single(points=4000).points
    return points, measure_scene(points)


def assert_same(found, expected, scale, tolerance):
    assert np.isclose(found.spacing, scale * expected.spacing, rtol=tolerance)
    assert np.isclose(found.noise, scale * expected.noise, rtol=tolerance)


@pytest.mark.parametrize("scale", [1e-3, 0.0254, 1000.0])
def test_the_unit_does_not_matter(small, scale):
    points, scene = small
    assert_same(measure_scene(scale * points), scene, scale, 1e-9)


def test_the_origin_does_not_matter(small):
    points, scene = small
    assert_same(measure_scene(points + UTM), scene, 1.0, 1e-5)  # coordinates of 5e6 have steps of 1e-9


def test_directions_do_not_matter(small, large):
    turn = Rotation.from_rotvec([0.5, -1.2, 0.4]).as_matrix()
    assert_same(measure_scene(small[0] @ turn.T), small[1], 1.0, 1e-9)
    # of more points others are looked at
    assert_same(measure_scene(large[0] @ turn.T), large[1], 1.0, 0.05)


def test_the_order_of_the_points_does_not_matter(small, large):
    for points, scene in (small, large):
        order = np.random.default_rng(0).permutation(len(points))
        assert_same(measure_scene(points[order]), scene, 1.0, 1e-12)


def test_other_neighbourhoods_say_the_same(large):
    points, scene = large
    for seed in (1, 2):
        assert_same(measure_scene(points, seed), scene, 1.0, 0.1)


RNG = np.random.default_rng(9)
LINE = np.outer(RNG.uniform(-1, 1, 50), [1.0, 2.0, -0.5])
FLAT = RNG.uniform(-1, 1, (50, 2)) @ np.array([[1.0, 2.0, -0.5], [0.3, 0.0, 1.0]])
UNUSABLE = {
    "none": (np.empty((0, 3)), "only 0 usable points"),
    "one": (np.ones((1, 3)), "only 1 usable point;"),
    "four": (RNG.random((4, 3)), "only 4 usable points"),
    "equal": (np.full((20, 3), 0.1), "all points are equal"),
    "line": (LINE, "all points lie on one line"),
    "two places": (np.repeat(LINE[:2], 10, axis=0), "all points lie on one line"),
    "plane": (FLAT, "all points lie on one plane"),
    "level": (np.column_stack([RNG.random((9, 2)), np.full(9, 0.1)]), "all points lie on one plane"),
    "three places": (np.repeat(RNG.random((3, 3)), 5, axis=0), "all points lie on one plane"),
}


@pytest.mark.parametrize("name", UNUSABLE)
@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("origin", [np.zeros(3), UTM], ids=["here", "far"])
def test_clouds_in_which_nothing_could_be_told_are_refused(name, scale, origin):
    points, fault = UNUSABLE[name]
    with pytest.raises(InputError) as caught:
        check_usable(scale * points + origin, "scan.ply")
    message = str(caught.value)
    assert message.startswith("scan.ply: ")
    assert fault in message
    assert message.endswith("a cylinder needs at least 5 points that do not lie on one plane")
    assert "\n" not in message


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("origin", [np.zeros(3), UTM], ids=["here", "far"])
def test_clouds_that_are_nearly_flat_are_not(scale, origin):
    rng = np.random.default_rng(1)
    check_usable(scale * (FLAT + 1e-4 * rng.standard_normal(FLAT.shape)) + origin, "scan.ply")
    check_usable(scale * rng.random((5, 3)) + origin, "scan.ply")


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_the_canonical_order_is_one_of_the_points(seed):
    rng = np.random.default_rng(seed)
    points = 100 * rng.standard_normal(3) + rng.standard_normal((60, 3))
    ordered, order, codes, unit = canonical_order(points)
    assert np.array_equal(np.sort(order), np.arange(60))
    assert np.array_equal(ordered, points[order] - points.min(axis=0))
    assert (np.diff(codes) >= 0).all()
    assert np.array_equal(codes, morton_codes(ordered, unit))
    shuffle = rng.permutation(60)
    assert np.array_equal(canonical_order(points[shuffle])[0], ordered)


@pytest.mark.parametrize("away", [1e2, 1e4, 1e6])
@pytest.mark.parametrize("count", [1, 20])
def test_a_few_points_far_away_change_nothing(small, away, count):
    points, scene = small
    rng = np.random.default_rng(2)
    strays = points.mean(axis=0) + away * rng.choice([-1, 1], (count, 3)) * rng.uniform(0.5, 1, (count, 3))
    cloud = np.concatenate([points, strays])
    check_usable(cloud, "scan.ply")
    assert_same(measure_scene(cloud), scene, 1.0, 0.03)
    frame, _ = make_frame(cloud, Config())
    assert np.allclose(
        frame.points * frame.spacing + frame.origin, cloud[frame.order], rtol=0, atol=1e-12 * away + 1e-12
    )
    assert np.isclose(frame.unit * 2**frame.voxel_level, frame.window / 6)


def test_points_at_zero_do_not_hide_what_is_flat_or_cylinders():
    with pytest.raises(InputError, match="all points lie on one plane"):
        check_usable(np.concatenate([np.repeat(FLAT, 10, axis=0) + UTM, np.zeros((1, 3))]), "scan.ply")
    check_usable(np.concatenate([RNG.random((500, 3)) + UTM, np.zeros((1, 3))]), "scan.ply")


def test_half_of_a_cloud_is_no_stray():
    rng = np.random.default_rng(4)
    points = np.concatenate([rng.random((300, 3)), rng.random((300, 3)) + 1e9])
    corner, side = cell_cube(points)
    assert np.array_equal(corner, points.min(axis=0))
    assert side == np.ptp(points, axis=0).max()


@pytest.fixture(scope="module")
def framed():
    points = multi(points=4000, cylinders=2, seed=5).points
    return points, *make_frame(points, Config())


def test_the_frame_is_the_cloud_in_its_own_units(framed):
    points, frame, scene = framed
    assert frame.spacing == scene.spacing
    assert np.isclose(frame.noise.least, scene.noise / scene.spacing)
    assert np.array_equal(np.sort(frame.order), np.arange(4000))
    assert np.allclose(frame.points * frame.spacing + frame.origin, points[frame.order], rtol=0, atol=1e-12)
    assert np.array_equal(frame.codes, morton_codes(frame.points, frame.unit))
    assert (np.diff(frame.codes) >= 0).all()
    # six voxels to the smallest window, which is at least as wide as promised
    assert np.isclose(frame.unit * 2**frame.voxel_level, frame.window / 6)
    assert frame.window >= Config().candidates.window_noises * frame.noise.least * (1 - 1e-12)
    shape = Cylinder((1, 2, 3), (0, 0, 1), 2.0, 4.0)
    assert np.allclose(frame.to_scene(shape).point, frame.spacing * shape.point + frame.origin)
    assert np.isclose(frame.to_scene(shape).radius, 2 * frame.spacing)


def test_what_is_known_of_the_scene_is_not_measured(framed):
    points, _, measured = framed
    config = load_config(overrides=["scene.noise=0.0123", "scene.spacing=0.5"])
    frame, scene = make_frame(points, config)
    assert (scene.noise, scene.spacing, frame.spacing) == (0.0123, 0.5, 0.5)
    assert np.isclose(frame.noise.least, 0.0246)
    assert scene.extent == measured.extent


def test_every_null_becomes_a_length(framed):
    _, frame, scene = framed
    config = resolve(Config(), scene)
    unknown = {"axis", "axis_sd_deg", "known_radius", "known_radius_sd", "catalogue"}
    assert None not in config.scene.model_dump(exclude=unknown).values()
    assert config.slicing.thickness > 0
    assert config.ellipses.tolerance > 0
    assert (config.scene.spacing, config.scene.noise) == (scene.spacing, scene.noise)
    low, high = radius_range(config, frame)
    assert 0 < low < high
    assert np.isclose(high * frame.spacing, config.scene.radius_max)
    assert resolve(config, scene) == config


def test_a_known_radius_has_a_deviation(framed):
    _, frame, scene = framed
    for given_, expected in (
        (["scene.known_radius=2"], 0.002),
        (["scene.known_radius=2", "scene.known_radius_sd=0.1"], 0.1),
    ):
        config = resolve(load_config(overrides=given_), scene)
        assert np.isclose(config.scene.known_radius_sd, expected)
        known = known_of(config, frame)
        assert np.allclose([known.radius, known.radius_deviation], np.array([2, expected]) / frame.spacing)
        assert known.direction is None
    config = resolve(load_config(overrides=["scene.axis=[0, 0, -2]", "scene.axis_sd_deg=0.5"]), scene)
    known = known_of(config, frame)
    assert known.radius is None
    assert known.direction.tolist() == [0, 0, -1]
    assert np.isclose(known.direction_deviation, np.radians(0.5))
    for nothing in ([], ["scene.axis=[0, 0, 1]"]):
        assert known_of(resolve(load_config(overrides=nothing), scene), frame) is None


def test_lengths_follow_the_unit(framed):
    _, _, scene = framed
    scaled = type(scene)(1000 * scene.spacing, 1000 * scene.noise, 1000 * scene.extent)
    one, other = resolve(Config(), scene), resolve(Config(), scaled)
    for section, key in [
        ("scene", "radius_min"),
        ("scene", "radius_max"),
        ("slicing", "thickness"),
        ("ellipses", "tolerance"),
    ]:
        assert np.isclose(getattr(getattr(other, section), key), 1000 * getattr(getattr(one, section), key))


def test_lengths_that_are_given_stay(framed):
    _, _, scene = framed
    given_ = ["scene.radius_min=0.01", "scene.radius_max=0.5", "slicing.thickness=0.07", "ellipses.tolerance=0.003"]
    config = resolve(load_config(overrides=given_), scene)
    assert (config.scene.radius_min, config.scene.radius_max) == (0.01, 0.5)
    assert (config.slicing.thickness, config.ellipses.tolerance) == (0.07, 0.003)


@pytest.mark.parametrize("bound", ["scene.radius_max=1e-6", "scene.radius_min=1e6"])
def test_a_resolved_configuration_can_be_loaded_again(framed, bound):
    _, _, scene = framed
    config = resolve(load_config(overrides=[bound]), scene)
    assert Config.model_validate(config.model_dump()) == config


def test_independent_noise_is_the_same_at_every_size():
    for points in (plane(6000, 0.003), single(points=4000).points):
        noise = make_frame(points, Config())[0].noise
        assert len(set(noise.deviations)) == 1
        assert noise.at(1e-6) == noise.at(1e6) == pytest.approx(noise.least)


def test_noise_that_neighbours_share_grows_with_the_size():
    rng = np.random.default_rng(3)
    points = plane(8000, 0.002)
    for _ in range(60):  # waves of about twenty spacings, 0.005 in all
        pitch = 2 * np.pi / 0.2 * rng.uniform(0.7, 1.4)
        turn = rng.uniform(0, 2 * np.pi)
        points[:, 2] += 0.005 / np.sqrt(30) * np.cos(pitch * points[:, :2] @ [np.cos(turn), np.sin(turn)] + 7 * turn)
    frame, scene = make_frame(points, Config())
    assert np.isclose(frame.noise.least * frame.spacing, scene.noise)
    assert 0.0018 < scene.noise < 0.003
    assert 0.004 < frame.noise.at(60.0) * frame.spacing < 0.007
    assert (np.diff(frame.noise.deviations) >= 0).all()


def test_noise_between_two_sizes_is_between_theirs():
    noise = Noise(np.array([1.0, 4.0]), np.array([0.1, 0.4]))
    assert [noise.at(size) for size in (0.0, 0.5, 1, 2, 4, 9)] == pytest.approx([0.1, 0.1, 0.1, 0.2, 0.4, 0.4])
    assert noise.least == 0.1
