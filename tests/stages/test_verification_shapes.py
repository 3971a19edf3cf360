"""Pieces of elbows, cones and barrels are no cylinders, however little of them is seen; cylinders as short are."""

import numpy as np
import pytest

from cylx.config import Config, VerificationConfig
from cylx.geometry.cells import Cells
from cylx.geometry.cylinder import Cylinder
from cylx.records import IndexedCloud, Noise, Segment
from cylx.scene import make_frame
from cylx.segments.refitting import refit
from cylx.stages.verification import verify
from cylx.synthetic.surfaces import Frustum, Mantle

UP = np.array([0.0, 0.0, 1.0])
COUNT = 3000


def elbow(rng, half, ring):
    """Draw from a torus of tube radius one, whose ring is so many times wider."""
    turn, along = rng.uniform(-np.pi, np.pi, 3 * COUNT), rng.uniform(-half / ring, half / ring, 3 * COUNT)
    kept = rng.random(3 * COUNT) * (ring + 1) < ring + np.cos(turn)
    turn, along = turn[kept][:COUNT], along[kept][:COUNT]
    away = ring + np.cos(turn)
    return np.column_stack([away * np.cos(along) - ring, np.sin(turn), away * np.sin(along)])


def cone(rng, half, slope):
    return Frustum(np.zeros(3), UP, 1 + slope * half, 1 - slope * half, 2 * half).sample(rng, COUNT)


def barrel(rng, half, bow):
    """Draw from a barrel whose side has so many times its radius."""
    z, turn = rng.uniform(-half, half, COUNT), rng.uniform(-np.pi, np.pi, COUNT)
    radius = np.sqrt(bow**2 - z**2)
    radius += 1 - radius.mean()
    return np.column_stack([radius * np.cos(turn), radius * np.sin(turn), z])


def pipe(rng, half, arc_deg):
    return Mantle(Cylinder((0, 0, 0), UP, 1.0, 2 * half), 0.0, np.radians(arc_deg)).sample(rng, COUNT)


def judged(draw, half, size, sigma, seed=0):
    """Fit a cylinder to a piece of a thing, and verify it as one that all windows agree with."""
    rng = np.random.default_rng(seed)
    points = draw(rng, half, size) + sigma * rng.standard_normal((COUNT, 3))
    frame, _ = make_frame(points, Config())
    noise = Noise(np.ones(1), np.array([sigma / frame.spacing]))
    indexed = IndexedCloud(Cells(frame.points, frame.codes), np.zeros(COUNT), noise)
    model = np.concatenate([-frame.origin / frame.spacing, UP, [1 / frame.spacing]])
    fitted = refit(Segment(model, half / frame.spacing, sigma / frame.spacing), indexed)
    return verify(fitted, indexed, 0.85, (60, 62), VerificationConfig())


@pytest.mark.parametrize(
    ("draw", "sizes"),
    [(elbow, (6.0, 12.0)), (cone, (0.03, 0.1)), (barrel, (5.0, 20.0))],
    ids=["elbow", "cone", "barrel"],
)
@pytest.mark.parametrize("half", [1.0, 2.0])
def test_a_piece_of_what_is_no_cylinder_is_refused(draw, sizes, half):
    for size in sizes:
        verdict = judged(draw, half, size, 0.005)
        assert verdict.reason, size
        assert verdict.confidence < 0.1, size


@pytest.mark.parametrize(
    ("draw", "size"),
    [(elbow, 6.0), (cone, 0.03), (cone, 0.1), (barrel, 3.0), (barrel, 5.0), (barrel, 10.0)],
)
def test_the_less_noise_there_is_the_less_needs_to_be_seen(draw, size):
    assert judged(draw, 0.5, size, 0.001).confidence < 0.1


@pytest.mark.parametrize("arc_deg", [150.0, 250.0, 360.0])
@pytest.mark.parametrize("sigma", [0.001, 0.01])
def test_a_cylinder_as_short_passes(arc_deg, sigma):
    for half in (0.15, 0.5, 2.0):
        verdict = judged(pipe, half, arc_deg, sigma)
        assert verdict.reason == "", half
        assert verdict.confidence > 0.9, half
