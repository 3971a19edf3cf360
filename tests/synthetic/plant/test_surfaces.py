"""Surfaces of pipes and fittings: points lie on them evenly, normals point outwards, areas are right."""

import math

import numpy as np
import pytest

from cylx.synthetic.plant.surfaces import Bend, Block, Face, Revolved, Ring, pipe

Z = np.array([0.0, 0.0, 1.0])
ORIGIN = np.zeros(3)
SKEW = np.array([0.3, -0.2, 0.0])
N = 20000

CONE = Revolved(ORIGIN, Z, 0.0, 2.0, 1.0, slope=-0.25)
OBLIQUE = Revolved(ORIGIN, Z, 0.0, 2.0, 1.0, slope=-0.25, skew=SKEW)
SPHERE = Revolved(ORIGIN, Z, -2.0, 2.0, 2.0, bulge=1.0)
HEAD = Revolved(ORIGIN, Z, 0.0, 1.0, 2.0, bulge=4.0)
BEND = Bend(ORIGIN, Z, np.array([1.0, 0.0, 0.0]), 3.0, 1.0, math.radians(60))
BLOCK = Block(ORIGIN, np.array([1.0, 2.0, 4.0]), np.eye(3))


def oblique(q):
    rho = np.linalg.norm((q - q[:, 2:] * SKEW)[:, :2], axis=1)
    return rho - 1 + 0.25 * q[:, 2]


SURFACES = {
    "pipe": (pipe(ORIGIN, 2 * Z, 0.5), 2 * math.pi, lambda q: np.hypot(q[:, 0], q[:, 1]) - 0.5),
    "cone": (CONE, math.pi * 1.5 * math.hypot(2, 0.5), lambda q: np.hypot(q[:, 0], q[:, 1]) - 1 + 0.25 * q[:, 2]),
    "oblique cone": (OBLIQUE, None, oblique),
    "sphere": (SPHERE, 16 * math.pi, lambda q: np.linalg.norm(q, axis=1) - 2),
    "head": (
        HEAD,  # half an oblate spheroid with semi-axes 2 and 1
        math.pi * 4 * (1 + 0.25 / math.sqrt(0.75) * math.atanh(math.sqrt(0.75))),
        lambda q: np.sqrt((q[:, 0] / 2) ** 2 + (q[:, 1] / 2) ** 2 + q[:, 2] ** 2) - 1,
    ),
    "bend": (BEND, 2 * math.pi**2, lambda q: np.hypot(np.hypot(q[:, 0], q[:, 1]) - 3, q[:, 2]) - 1),
    "ring": (Ring(ORIGIN, Z, 1.0, 2.0), 3 * math.pi, lambda q: q[:, 2]),
    "block": (BLOCK, 28.0, lambda q: (np.abs(q) - [0.5, 1.0, 2.0]).max(axis=1)),
    "face": (Face(np.array([1.0, 2.0, 3.0]), 1, 2.0), 3.0, lambda q: 2 - q[:, 1]),
}


@pytest.mark.parametrize("name", SURFACES)
def test_points_lie_on_the_surface_and_normals_leave_it(name):
    surface, area, distance = SURFACES[name]
    points, normals = surface.sample(np.random.default_rng(0), N)
    assert points.shape == normals.shape == (N, 3)
    assert np.abs(distance(points)).max() < 1e-9
    assert np.allclose(np.linalg.norm(normals, axis=1), 1)
    step = 1e-6
    assert (distance(points + step * normals) > 0).all()
    sideways = np.cross(normals, [0.48, 0.6, 0.64])  # off the surface only in the second order
    if name != "block":  # which has edges
        assert np.abs(distance(points + step * sideways)).max() < 1e-3 * step
    if area is not None:
        assert surface.area == pytest.approx(area, rel=2e-3)


def test_an_oblique_cone_has_the_area_of_its_triangles():
    s, angles = np.meshgrid(np.linspace(0, 2, 300), np.linspace(0, 2 * np.pi, 300), indexing="ij")
    rho = 1 - 0.25 * s
    grid = np.stack([s * SKEW[0] + rho * np.cos(angles), s * SKEW[1] + rho * np.sin(angles), s], axis=-1)
    one, other = grid[1:, :-1] - grid[:-1, :-1], grid[:-1, 1:] - grid[:-1, :-1]
    assert OBLIQUE.area == pytest.approx(np.linalg.norm(np.cross(one, other), axis=-1).sum(), rel=2e-3)


@pytest.mark.parametrize(
    ("surface", "part", "share"),
    [
        (CONE, lambda q: q[:, 2] < 1, (1 + 0.75) / (1 + 0.75 + 0.75 + 0.5)),
        (SPHERE, lambda q: q[:, 2] > 1, 0.25),  # heights on a sphere are uniform
        (BEND, lambda q: np.hypot(q[:, 0], q[:, 1]) > 3, 0.5 + 1 / (3 * math.pi)),  # the outer half is larger
        (BEND, lambda q: np.arctan2(q[:, 1], q[:, 0]) < math.radians(15), 0.25),
        (BLOCK, lambda q: np.isclose(np.abs(q[:, 0]), 0.5), 16 / 28),
        (Ring(ORIGIN, Z, 1.0, 2.0), lambda q: np.hypot(q[:, 0], q[:, 1]) < 1.5, 1.25 / 3),
    ],
    ids=["cone", "sphere", "bend outside", "bend along", "block", "ring"],
)
def test_points_are_even(surface, part, share):
    points, _ = surface.sample(np.random.default_rng(1), N)
    assert part(points).mean() == pytest.approx(share, abs=5 * math.sqrt(share * (1 - share) / N))


def test_a_bend_starts_outward_and_turns_about_its_normal():
    line, _ = BEND.at(np.radians([0.0, 60.0]))
    assert np.allclose(line, [[3, 0, 0], [1.5, 1.5 * math.sqrt(3), 0]])
