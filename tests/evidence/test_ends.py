"""Cuts across the axis at the ends of pieces: two that face each other across a gap make two cylinders."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cylx.config import Config
from cylx.evidence.ends import are_distinct, ends_in_cut
from cylx.geometry.cells import Cells
from cylx.records import Finding, IndexedCloud, Noise, Segment
from cylx.scene import make_frame

SIGMA, STEP = 0.005, 0.12
"""Noise and spacing; the radius is 1."""


def piece(low, high, turn_deg=360.0, lower=0.0, upper=0.0, step=STEP, seed=0, sigma=SIGMA):
    """Draw a piece of a pipe about the z axis, whose ends are pushed in by a function of the angle."""
    rng = np.random.default_rng(seed)
    turn = np.radians(turn_deg) * rng.random(round(np.radians(turn_deg) * (high - low) / step**2))
    bounds = [limit(turn) if callable(limit) else limit for limit in (lower, upper)]
    height = low + bounds[0] + (high - low - bounds[0] - bounds[1]) * rng.random(len(turn))
    own = 1 + sigma * rng.standard_normal(len(turn))
    return np.column_stack([own * np.cos(turn), own * np.sin(turn), height])


def plate(height, seed, step=None, sigma=0.0, inner=0.75, outer=1.3):
    """Draw what adjoins the mouth of a bore."""
    rng = np.random.default_rng(100 + seed)
    count = 400 if step is None else round(np.pi * (outer**2 - inner**2) / step**2)
    turn, distance = 2 * np.pi * rng.random(count), np.sqrt(rng.uniform(inner**2, outer**2, count))
    return np.column_stack(
        [distance * np.cos(turn), distance * np.sin(turn), height + sigma * rng.standard_normal(count)]
    )


def findings_of(*pieces, turned=None, scale=1.0, flip=(), plates=True, sigma=SIGMA, **plated):
    """Give the cloud of pieces and of plates at their ends, and a finding of each."""
    up = np.array([0.0, 0.0, 1.0])
    ends = [end for one in pieces for end in (one[:, 2].min(), one[:, 2].max())] if plates else []
    points = scale * np.concatenate([*pieces, *[plate(end, k, **plated) for k, end in enumerate(ends)]])
    if turned is not None:
        points, up = points @ turned.T, turned @ up
    frame, _ = make_frame(points, Config())
    noise = Noise(np.ones(1), np.array([scale * sigma / frame.spacing]))
    indexed = IndexedCloud(Cells(frame.points, frame.codes), np.zeros(len(points)), noise)
    owner = np.repeat(np.arange(len(pieces)), [len(one) for one in pieces])
    owner = np.append(owner, np.full(len(points) - len(owner), -1))[frame.order]
    found = []
    for k, one in enumerate(pieces):
        low, high = one[:, 2].min(), one[:, 2].max()
        middle = (scale * 0.5 * (low + high) * up - frame.origin) / frame.spacing
        model = np.concatenate([middle, -up if k in flip else up, [scale / frame.spacing]])
        segment = Segment(model, scale * 0.5 * (high - low) / frame.spacing, scale * sigma / frame.spacing)
        turn = np.degrees(np.arctan2(one[:, 1], one[:, 0]))
        coverage = np.radians(30.0 * len(np.unique(turn // 30.0)))
        found.append(Finding(segment, np.flatnonzero(owner == k), 10, 0.8, 0.9, coverage, 0.01, 0.01))
    return indexed, found, scale / frame.spacing


def distinct(*pieces, gap, **how):
    indexed, (one, other), unit = findings_of(*pieces, **how)
    both = are_distinct(one, other, indexed, gap * unit), are_distinct(other, one, indexed, gap * unit)
    assert both[0] == both[1]
    return both[0]


def ragged(depth):
    """Give an end that is broken off unevenly."""
    return lambda turn: depth * (0.5 + 0.5 * np.sin(3 * turn)) * (1 + 0.3 * np.cos(5 * turn))


@pytest.mark.parametrize("gap", [1.0, 3.0])
@pytest.mark.parametrize("flip", [(), (0,), (1,), (0, 1)])
def test_two_pieces_cut_across_are_two_whatever_way_their_directions_point(gap, flip):
    assert distinct(piece(0, 3), piece(3 + gap, 6 + gap, seed=1), gap=gap, flip=flip)


@pytest.mark.parametrize("seed", range(3))
def test_attitude_and_unit_are_no_matter(seed):
    turned = Rotation.random(random_state=seed).as_matrix()
    scale = (1e-3, 1.0, 1e4)[seed]
    assert distinct(piece(0, 3), piece(4, 7, seed=1), gap=1.0, turned=turned, scale=scale)
    assert not distinct(piece(0, 3, upper=ragged(1.0)), piece(4, 7), gap=1.0, turned=turned, scale=scale)


def test_a_piece_that_is_broken_off_unevenly_is_not_cut():
    assert not distinct(piece(0, 3, upper=ragged(1.0)), piece(4, 7, seed=1), gap=1.0)
    assert not distinct(piece(0, 3), piece(4, 7, lower=ragged(1.0), seed=1), gap=1.0)
    # the other ends are no matter
    assert distinct(piece(0, 3, lower=ragged(1.0)), piece(4, 7, upper=ragged(1.0), seed=1), gap=1.0)


def test_a_piece_at_whose_end_nothing_adjoins_may_go_on():
    assert not distinct(piece(0, 3), piece(4, 7, seed=1), gap=1.0, plates=False)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("radius", [4.0, 8.0])  # spacings
def test_mouths_of_bores_of_a_few_spacings_are_told_in_noise(radius, seed):
    step = 1 / radius
    how = {"sigma": 0.2 * step, "step": step, "inner": 1.0, "outer": 3.0}
    bores = [
        piece(0, 3, step=step, seed=seed, sigma=0.2 * step),
        piece(12, 15, step=step, seed=10 + seed, sigma=0.2 * step),
    ]
    assert distinct(*bores, gap=9.0, **how)
    # a pipe whose middle was not seen, near a wall that it does not touch
    assert not distinct(*bores, gap=9.0, **{**how, "inner": 2.0})


def test_what_is_hidden_from_one_side_is_not_cut():
    def hidden(turn):
        return np.where(np.abs(turn - np.pi) < 0.9, 1.0, 0.0)

    assert not distinct(piece(0, 3, upper=hidden), piece(4, 7, seed=1), gap=1.0)
    assert not distinct(piece(0, 3, turn_deg=200), piece(4, 7, turn_deg=200, seed=1), gap=1.0)


def test_a_gap_of_a_few_points_is_none():
    assert not distinct(piece(0, 3), piece(3.05, 6, seed=1), gap=0.05)


def test_too_few_points_do_not_tell():
    assert not distinct(piece(0, 3, step=0.7), piece(4, 7, step=0.7, seed=1), gap=1.0)
    indexed, (one,), _ = findings_of(piece(0, 3, step=0.7))
    assert not ends_in_cut(one, indexed, upper=True)


def test_each_end_is_looked_at_by_itself():
    indexed, (one,), _ = findings_of(piece(0, 3, upper=ragged(1.0)))
    assert [ends_in_cut(one, indexed, upper=upper) for upper in (False, True)] == [True, False]
    indexed, (one,), _ = findings_of(piece(0, 3, upper=ragged(1.0)), flip=(0,))
    assert [ends_in_cut(one, indexed, upper=upper) for upper in (False, True)] == [False, True]
