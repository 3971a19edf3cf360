"""From which side a surface is seen: what adjoins it and what lies about it tell, or nothing does."""

import numpy as np
import pytest

from cylx.config import Config
from cylx.evidence.side import side_of
from cylx.geometry.cells import Cells
from cylx.records import IndexedCloud, Noise, Segment
from cylx.scene import make_frame

SIGMA, STEP = 0.004, 0.05
"""Noise and spacing; the radius is 1."""


def sheet(area, rng):
    """Give two even numbers in [0, 1) for each point of an area."""
    return rng.random((max(int(area / STEP**2), 1), 2))


def wall(low, high, radius=1.0, turn_deg=360.0, seed=0):
    rng = np.random.default_rng(seed)
    turn = np.radians(turn_deg)
    u = sheet(turn * radius * (high - low), rng)
    at = radius + SIGMA * rng.standard_normal(len(u))
    return np.column_stack([at * np.cos(turn * u[:, 0]), at * np.sin(turn * u[:, 0]), low + (high - low) * u[:, 1]])


def ring(height, inner, outer, turn_deg=360.0, seed=1):
    """A flat ring across the axis: a cap if it starts at 0, a plate with a hole otherwise."""
    rng = np.random.default_rng(seed)
    turn = np.radians(turn_deg)
    u = sheet(turn / 2 * (outer**2 - inner**2), rng)
    at = np.sqrt(inner**2 + (outer**2 - inner**2) * u[:, 1])
    level = height + SIGMA * rng.standard_normal(len(u))
    return np.column_stack([at * np.cos(turn * u[:, 0]), at * np.sin(turn * u[:, 0]), level])


def things(low, high, beside, seed=2):
    """A ball of points, off the axis."""
    rng = np.random.default_rng(seed)
    ways = rng.standard_normal((800, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    return 0.3 * ways + [beside, 0.0, 0.5 * (low + high)]


def side(*parts, half=1.0, turn_deg=360.0, turned=None, scale=1.0):
    points = scale * np.concatenate(parts)
    up = np.array([0.0, 0.0, 1.0])
    if turned is not None:
        points, up = points @ turned.T, turned @ up
    points = points + np.array([7.0, -3.0, 2.0])
    frame, _ = make_frame(points, Config())
    noise = Noise(np.ones(1), np.array([scale * SIGMA / frame.spacing]))
    indexed = IndexedCloud(Cells(frame.points, frame.codes), np.zeros(len(points)), noise)
    middle = (np.array([7.0, -3.0, 2.0]) - frame.origin) / frame.spacing
    model = np.concatenate([middle, up, [scale / frame.spacing]])
    segment = Segment(model, scale * half / frame.spacing, scale * SIGMA / frame.spacing)
    return side_of(segment, indexed, np.radians(turn_deg))


CAPS = (ring(-1.0, 0.0, 1.0), ring(1.0, 0.0, 1.0))
PLATES = (ring(-1.0, 1.0, 4.0), ring(1.0, 1.0, 4.0))

KINDS = {
    "can": ((wall(-1, 1), *CAPS), {}, "convex"),
    "half a can": (
        (wall(-1, 1, turn_deg=180), ring(1.0, 0, 1, 180), ring(-1.0, 0, 1, 180)), {"turn_deg": 180.0}, "convex"
    ),
    "disc": ((wall(-0.1, 0.1), ring(-0.1, 0, 1), ring(0.1, 0, 1)), {"half": 0.1}, "convex"),
    "through bore in a plate": ((wall(-1, 1), *PLATES), {}, "concave"),
    "hole in a sheet": ((wall(-0.1, 0.1), ring(-0.1, 1, 4), ring(0.1, 1, 4)), {"half": 0.1}, "concave"),
    "bore beside another": ((wall(-1, 1), *PLATES, things(-1, 1, 1.8)), {}, "concave"),
    "fillet": ((wall(-1, 1, turn_deg=90), ring(-1, 1, 3, 90), ring(1, 1, 3, 90)), {"turn_deg": 90.0}, "concave"),
    "pin on a plate with a cap": ((wall(-1, 1), PLATES[0], CAPS[1]), {}, "unknown"),
    "bare pipe": ((wall(-1, 1),), {}, "unknown"),
    "bare long pipe": ((wall(-6, 6),), {"half": 6.0}, "unknown"),
    "groove in a shaft": (
        (wall(-1, 1), ring(-1, 1, 1.4), ring(1, 1, 1.4), wall(1, 3, 1.4), wall(-3, -1, 1.4)), {}, "unknown"
    ),
    "flange on a shaft": (
        (wall(-1, 1), ring(-1, 0.5, 1), ring(1, 0.5, 1), wall(1, 3, 0.5), wall(-3, -1, 0.5)), {}, "unknown"
    ),
    "outer wall of a tube": ((wall(-1, 1), wall(-1, 1, 0.8), ring(-1, 0.8, 1), ring(1, 0.8, 1)), {}, "convex"),
    "inner wall of a tube": ((wall(-1, 1), wall(-1, 1, 1.2), ring(-1, 1, 1.2), ring(1, 1, 1.2)), {}, "concave"),
    "tube without rims": ((wall(-1, 1), wall(-1, 1, 0.8)), {}, "unknown"),
    "column between floor and ceiling": ((wall(-5, 5), ring(-5, 1, 4), ring(5, 1, 4)), {"half": 5.0}, "unknown"),
    "stem on the ground beside a bush": ((wall(-4, 4), ring(-4, 1, 4), things(-1, 1, 1.8)), {"half": 4.0}, "convex"),
    "pipe beside things": ((wall(-4, 4), things(-1, 1, 1.8)), {"half": 4.0}, "convex"),
    "tunnel with things in it": ((wall(-4, 4), things(-1, 1, 0.4)), {"half": 4.0}, "concave"),
    "pipe with things in and about it": (
        (wall(-4, 4), things(-1, 1, 0.4), things(-1, 1, 1.8)), {"half": 4.0}, "unknown"
    ),
    "tank with things in it": ((wall(-1, 1), *CAPS, things(-1, 1, 0.4)), {}, "unknown"),
    "half a pipe beside things": (
        (wall(-4, 4, turn_deg=150), things(-1, 1, 1.8)), {"half": 4.0, "turn_deg": 150.0}, "unknown"
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", KINDS)
def test_what_lies_about_it_tells_the_side(name):
    parts, place, expected = KINDS[name]
    assert side(*parts, **place) == expected


@pytest.mark.parametrize("name", ["can", "through bore in a plate", "tunnel with things in it", "bare pipe"])
def test_neither_place_nor_unit_nor_order_matter(name):
    parts, place, expected = KINDS[name]
    rng = np.random.default_rng(3)
    turned, _ = np.linalg.qr(rng.standard_normal((3, 3)))
    assert side(*parts, turned=turned * np.sign(np.linalg.det(turned)), **place) == expected
    assert side(*parts, scale=1000.0, **place) == expected
    assert side(rng.permutation(np.concatenate(parts)), **place) == expected


def test_nothing_has_no_side():
    assert side(wall(5, 9)) == "unknown"
