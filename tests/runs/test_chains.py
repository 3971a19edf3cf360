"""Elbows with short pipes between them: what all their points say of each axis is said once."""

import math

import numpy as np
import pytest

from tests.support.pipework import Pipework, X, Y, Z, of_kind

R = 0.04


def chain(seed, between=0.07):
    """Make two elbows of 90 and 45 degrees with a pipe between them that is shorter than its diameter."""
    work = Pipework(seed, seen=0.5)
    work.pipe([-0.8, 0, 0], [0, 0, 0], R, over=(0, 0.02))
    end, onward = work.bend([0, 0, 0], X, Y, 0.11, math.pi / 2, R)
    last = end + between * onward
    work.pipe(end, last, R, known=False)
    end, away = work.bend(last, onward, Z, 0.15, math.pi / 4, R)
    work.pipe(end, end + 0.8 * away, R, over=(0.02, 0))
    return work


def errors_of(seed):
    """Give the errors of both angles in degrees, of both bend radii in themselves, and what they are said to be."""
    elbows = sorted(of_kind(chain(seed).traced(), "elbow"), key=lambda one: -one.angle)
    known = ((90.0, 0.11), (45.0, 0.15))
    angles = [math.degrees(one.angle) - angle for one, (angle, _) in zip(elbows, known, strict=True)]
    bends = [one.bend_radius / bend - 1.0 for one, (_, bend) in zip(elbows, known, strict=True)]
    return [*angles, *bends], [one.std["angle_deg"] for one in elbows]


def test_the_elbows_at_both_ends_of_a_short_pipe_are_as_exact_as_all_points_allow():
    found = [errors_of(seed) for seed in range(8)]
    errors, said = (np.array([one[k] for one in found]) for k in (0, 1))
    assert np.abs(errors[:, :2]).max() < 1.5
    assert np.sqrt((errors[:, :2] ** 2).mean()) < 0.7
    assert np.sqrt((errors[:, 2:] ** 2).mean()) < 0.04
    assert 0.4 < np.sqrt(((errors[:, :2] / said) ** 2).mean()) < 1.8


def test_the_short_pipe_ends_where_both_elbows_begin():
    traced = chain(3).traced()
    assert len(traced.cylinders) == 3
    short = traced.cylinders[2].cylinder
    assert short.height == pytest.approx(0.07, abs=0.02)
    places = [place for one in of_kind(traced, "elbow") for place in (one.start, one.end)]
    for end in (short.start, short.end):
        assert min(np.linalg.norm(end - place) for place in places) < 0.02 * R
