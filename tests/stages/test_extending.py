"""A pipe goes on where its points are sparse, and ends where it ends."""

import numpy as np
import pytest

from cylx.config import Config
from cylx.geometry.cells import Cells
from cylx.geometry.cylinder import Cylinder
from cylx.records import Finding, IndexedCloud, Noise, Segment
from cylx.scene import make_frame
from cylx.stages.extending import extend
from cylx.synthetic.surfaces import Mantle

SIGMA = 0.02
PIECE = 2.0
"""Half the height of the piece that is known; its radius is one."""


def mantle(low, high, n, seed=0):
    shape = Cylinder((0, 0, 0.5 * (low + high)), (0, 0, 1), 1.0, high - low)
    return Mantle(shape, 0.0, 2 * np.pi).sample(np.random.default_rng(seed), n)


def extended(*others, tilt=0.01, confidence=0.9):
    """Extend a piece of 800 points by other points; give low and high end, and the direction."""
    clean = np.concatenate([mantle(-PIECE, PIECE, 800, 1), *others])
    points = clean + SIGMA * np.random.default_rng(2).standard_normal(clean.shape)
    frame, _ = make_frame(points, Config())
    indexed = IndexedCloud(
        Cells(frame.points, frame.codes),
        np.zeros(len(points)),
        Noise(np.ones(1), np.array([SIGMA / frame.spacing])),
    )
    model = np.concatenate([-frame.origin / frame.spacing, [np.sin(tilt), 0, np.cos(tilt)], [1.0 / frame.spacing]])
    segment = Segment(model, PIECE / frame.spacing, SIGMA / frame.spacing)
    own = np.flatnonzero(frame.order < 800)
    piece = Finding(segment, own, 10, 0.8, 0.9, 6.0, 0.01 * model[6], 0.02)

    def judge(longer, best):
        width = 3.0 * indexed.noise.least
        near = indexed.cells.near_cylinder(
            longer.model, -longer.half, longer.half, longer.model[6] - width, longer.model[6] + width
        )
        return Finding(longer, near, best.support, best.payoff, confidence, 6.0, 0.01 * longer.model[6], 0.005)

    found = extend(piece, indexed, judge)
    shape = found.segment
    middle = shape.model[:3] * frame.spacing + frame.origin
    half = shape.half * frame.spacing
    return middle[2] - half, middle[2] + half, shape.model[3:6]


def test_it_goes_on_to_where_the_sparse_points_end_and_learns_its_direction():
    low, high, direction = extended(mantle(PIECE, 30.0, 60))
    assert high == pytest.approx(30.0, abs=2.0)
    assert low == pytest.approx(-PIECE, abs=0.1)
    assert np.hypot(*direction[:2]) < 0.002  # it began with 0.01


def test_it_goes_on_at_both_ends():
    low, high, _ = extended(mantle(PIECE, 20.0, 40, 3), mantle(-15.0, -PIECE, 40, 4))
    assert high == pytest.approx(20.0, abs=2.0)
    assert low == pytest.approx(-15.0, abs=2.0)


@pytest.mark.parametrize("share", [0.0, 0.3])
def test_it_ends_where_nothing_follows_but_strays(share):
    rng = np.random.default_rng(5)
    strays = rng.uniform([-3, -3, -20], [3, 3, 20], (int(800 * share), 3))
    low, high, _ = extended(strays)
    assert (low, high) == (pytest.approx(-PIECE, abs=0.1), pytest.approx(PIECE, abs=0.1))


def test_what_crosses_behind_a_gap_is_not_its_own():
    rng = np.random.default_rng(6)
    bar = np.column_stack([rng.uniform(-3, 3, 600), rng.uniform(-3, 3, 600), rng.uniform(15.0, 15.5, 600)])
    ring = mantle(24.0, 24.5, 30, 7)
    low, high, _ = extended(bar)
    assert high == pytest.approx(PIECE, abs=0.1)
    low, high, _ = extended(ring)
    assert (low, high) == (pytest.approx(-PIECE, abs=0.1), pytest.approx(PIECE, abs=0.1))


def test_too_few_points_and_a_judge_in_doubt_leave_it_as_it_is():
    assert extended(mantle(PIECE, 30.0, 8))[1] == pytest.approx(PIECE, abs=0.1)
    assert extended(mantle(PIECE, 30.0, 60), confidence=0.5)[1] == pytest.approx(PIECE, abs=0.1)
