"""The noise is that of the surfaces, however many small features they have."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cylx.scene import measure_scene

LENGTH, THICKNESS, BORE = 6.0, 0.4, 0.12


def bored_plate(bores, seed, count=14000):
    """Draw evenly from both faces of a plate and from the walls of small bores through it, a square of them."""
    rng = np.random.default_rng(seed)
    faces = np.column_stack([LENGTH * rng.random((count, 2)), THICKNESS * rng.integers(0, 2, count)])
    middles = LENGTH * (np.arange(bores) + 0.5) / bores
    wall = int(count / (2 * LENGTH**2) * 2 * np.pi * BORE * THICKNESS)
    kept, walls = np.ones(count, bool), []
    for middle in np.stack(np.meshgrid(middles, middles), axis=-1).reshape(-1, 2):
        kept &= np.linalg.norm(faces[:, :2] - middle, axis=1) > BORE
        turn = 2 * np.pi * rng.random(wall)
        around = middle + BORE * np.column_stack([np.cos(turn), np.sin(turn)])
        walls.append(np.column_stack([around, THICKNESS * rng.random(wall)]))
    return np.concatenate([faces[kept], *walls])


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("noise", [0.05, 0.1, 0.2])
def test_the_noise_of_a_plate_with_many_bores_is_measured(noise, seed):
    points = bored_plate(6, seed)
    sigma = noise * measure_scene(points).spacing
    measured = measure_scene(points + sigma * np.random.default_rng([5, seed]).standard_normal(points.shape)).noise
    assert measured == pytest.approx(sigma, rel=0.15)


@pytest.mark.parametrize("bores", [6, 10])
def test_a_plate_with_bores_and_without_noise_has_none(bores):
    scene = measure_scene(bored_plate(bores, 0))
    assert scene.noise <= 0.002 * scene.spacing


@pytest.mark.parametrize("noise", [0.0, 0.05, 0.2])
def test_unit_place_and_attitude_change_little(noise):
    """The cells differ, and so does the sample of the neighbourhoods; the mode of their noise scatters by 4 %."""
    points = bored_plate(6, 1)
    sigma = noise * measure_scene(points).spacing
    points = points + sigma * np.random.default_rng(6).standard_normal(points.shape)
    turn = Rotation.random(random_state=3).as_matrix()
    here, there = measure_scene(points), measure_scene(1e3 * points @ turn.T + [5.0, -700.0, 3e4])
    assert there.noise == pytest.approx(1e3 * here.noise, rel=0.2)
    assert there.spacing == pytest.approx(1e3 * here.spacing, rel=0.05)
    # a power of two changes nothing at all
    assert measure_scene(1024 * points).noise == pytest.approx(1024 * here.noise, rel=1e-9)


def thin_plate(thickness, seed, side=60):
    """Draw from both faces of a plate; lengths in spacings."""
    rng = np.random.default_rng(seed)
    count = 2 * side * side
    return np.column_stack([side * rng.random((count, 2)), thickness * rng.integers(0, 2, count)])


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("thickness", [2.5, 3.0, 6.0])
@pytest.mark.parametrize("noise", [0.05, 0.2])
def test_the_noise_of_a_thin_plate_is_not_its_thickness(noise, thickness, seed):
    points = thin_plate(thickness, seed)
    scene = measure_scene(points + noise * np.random.default_rng([7, seed]).standard_normal(points.shape))
    assert scene.noise == pytest.approx(noise, rel=0.35)


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("noise", [0.3, 0.5, 0.8, 1.5])
def test_a_thick_surface_is_not_as_thin_as_its_thinnest_patches(noise, seed):
    points = thin_plate(0.0, seed)
    scene = measure_scene(points + noise * np.random.default_rng([7, seed]).standard_normal(points.shape))
    assert scene.noise == pytest.approx(noise, rel=0.2)
