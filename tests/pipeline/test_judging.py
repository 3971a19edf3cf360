"""What a segment is judged to be: a cylinder, the pieces of it that are cylinders, or nothing."""

import numpy as np
import pytest

from cylx.config import Config
from cylx.game.agreement import Neighbourhood
from cylx.pipeline.judging import SHORTEST_PIECE, Judge
from cylx.records import Candidates, Finding, IndexedCloud, PointCloud, RejectedSegment, Segment
from cylx.scene import prepare
from cylx.segments.refitting import refit

SIGMA = 0.03
"""Scatter of bark, in radii."""
SUPPORT, PAYOFF = 40, 0.9


def trunk(length, bow=0.0, taper=0.0, count=12000, seed=0):
    """Draw a trunk of unit radius about the z axis, off it by the bow at its middle and thinner at its upper end."""
    rng = np.random.default_rng(seed)
    turn, z = 2 * np.pi * rng.random(count), length * (rng.random(count) - 0.5)
    radius = 1 - taper * (z / length) + SIGMA * rng.standard_normal(count)
    points = np.column_stack([radius * np.cos(turn), radius * np.sin(turn), z])
    points[:, 0] += bow * (1 - (2 * z / length) ** 2)
    return points


def judged(points, length, tilt=0.0):
    """Judge a segment along the whole of it; give what comes of it, and the unit of its lengths."""
    prepared = prepare(PointCloud(points), Config(), threads=1)
    frame = prepared.frame
    indexed = IndexedCloud.of(frame, np.zeros(len(points)))
    axis = np.array([np.sin(tilt), 0.0, np.cos(tilt)])
    model = np.concatenate([-frame.origin / frame.spacing, axis, [1 / frame.spacing]])
    model[:3] += np.array([points[:, 0].mean(), 0.0, 0.0]) / frame.spacing
    fitted = refit(Segment(model, 0.5 * length / frame.spacing, SIGMA / frame.spacing), indexed)
    judge = Judge(prepared, indexed, Neighbourhood(agreeing(fitted)))
    return judge.in_pieces(fitted, SUPPORT, PAYOFF), frame.spacing


def agreeing(segment, count=60):
    """Give candidates of windows all along a segment that say the same."""
    rows = np.zeros((count, 9))
    rows[:, :7] = segment.model
    rows[:, :3] += np.linspace(-1, 1, count)[:, None] * segment.half * segment.direction
    rows[:, 7], rows[:, 8] = 50, segment.radius
    # each laid on the surface
    turn = np.linspace(0, 20 * np.pi, count)
    one = np.cross(segment.direction, [0.0, 1.0, 0.0])
    one /= np.linalg.norm(one)
    other = np.cross(segment.direction, one)
    places = rows[:, :3] + segment.radius * (np.cos(turn)[:, None] * one + np.sin(turn)[:, None] * other)
    return Candidates.of_windows(rows, 0.6 * segment.radius, places)


@pytest.mark.parametrize("length", [3.0, 12.0, 40.0])
def test_a_straight_pipe_comes_whole(length):
    (found,), spacing = judged(trunk(length), length)
    assert isinstance(found, Finding)
    assert 2 * found.segment.half * spacing == pytest.approx(length)
    assert found.segment.radius * spacing == pytest.approx(1.0, abs=0.003)
    assert (found.support, found.payoff) == (SUPPORT, PAYOFF)


@pytest.mark.parametrize("bow", [0.3, 0.6])
@pytest.mark.parametrize("seed", range(3))
def test_a_trunk_that_bends_and_tapers_comes_in_pieces(bow, seed):
    length = 24.0
    pieces, spacing = judged(trunk(length, bow, 0.1, seed=seed), length)
    assert len(pieces) > 1
    assert all(isinstance(one, Finding) for one in pieces)
    assert min(one.confidence for one in pieces) >= 0.5
    assert min(2 * one.segment.half * spacing for one in pieces) >= SHORTEST_PIECE
    pieces = sorted(pieces, key=lambda one: one.segment.point[2])
    middles = np.array([one.segment.point[2] for one in pieces])
    halves = np.array([one.segment.half for one in pieces])
    # they lie one after the other, and do not overlap
    assert (np.diff(middles) > 0.99 * (halves[1:] + halves[:-1])).all()
    # a piece has the radius of the trunk where it is
    radii = np.array([one.segment.radius for one in pieces])
    assert (np.diff(radii) < 0).all()
    assert np.abs(radii * spacing - 1).max() < 0.06


@pytest.mark.parametrize("seed", range(2))
def test_what_is_too_short_for_two_pieces_is_refused_whole(seed):
    length = 0.95 * 2 * SHORTEST_PIECE
    (found,), spacing = judged(trunk(length, 0.5, seed=seed), length)
    assert isinstance(found, RejectedSegment)
    assert 2 * found.segment.half * spacing == pytest.approx(length)


def test_a_trunk_that_is_nowhere_a_cylinder_is_refused_whole():
    length = 24.0
    points = trunk(length)
    turn = np.arctan2(points[:, 1], points[:, 0])
    points[:, :2] *= (1 + 0.08 * np.cos(2 * turn))[:, None]  # as an ellipse
    (found,), spacing = judged(points, length)
    assert isinstance(found, RejectedSegment)
    assert 2 * found.segment.half * spacing == pytest.approx(length)
