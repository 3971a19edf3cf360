"""Surfaces that deviate from cylinders: stems are no pipes, and those that cannot be told are as the others are."""

import math

import numpy as np

from cylx.runs.pipes import Pipe, Surroundings
from cylx.runs.roughness import MOST, deviation_of, is_rough, rough_ones

R = 0.1


def cloud_of(*kinds, noise=0.003, seed=0):
    """Make upright cylinders with waves on their surface, of an amplitude in radii, and of so many points each."""
    rng = np.random.default_rng(seed)
    parts, labels, pipes = [], [], []
    for k, (amplitude, count) in enumerate(kinds):
        height, angle = 2.0 * rng.random(count), 2.0 * math.pi * rng.random(count)
        radius = R * (1.0 + amplitude * np.sin(3.0 * angle + 9.0 * height)) + noise * rng.standard_normal(count)
        parts.append(np.column_stack([radius * np.cos(angle) + 2.0 * k, radius * np.sin(angle), height]))
        labels.append(np.full(count, k, np.int32))
        spread = math.hypot(noise, 0.7 * amplitude * R)
        known = np.diag([1e-8, 1e-8, 1e-8, 1e-8, 1e-8])
        pipes.append((np.array([2.0 * k, 0.0, 0.0]), np.array([2.0 * k, 0.0, 2.0]), spread, known, k))
    near = Surroundings(np.concatenate(parts), np.concatenate(labels), 0.01, noise)
    made = [Pipe(low - near.origin, high - near.origin, R, spread, known, k) for low, high, spread, known, k in pipes]
    return made, near


def test_the_deviation_is_that_of_the_waves_whatever_the_noise():
    for noise in (0.001, 0.004):
        (pipe,), near = cloud_of((0.05, 6000), noise=noise)
        mean, std = deviation_of(pipe, near)
        # the fifth of the pieces that deviate most is left out
        assert 0.4 * 0.5 * 0.05**2 < mean < 0.5 * 0.05**2
        assert std < 0.2 * mean
        assert is_rough(pipe, near)
        (pipe,), near = cloud_of((0.0, 6000), noise=noise)
        assert deviation_of(pipe, near)[0] < 0.2 * MOST**2
        assert not is_rough(pipe, near)


def test_what_cannot_be_told_is_as_the_others_are():
    few = (0.03, 200)
    pipes, near = cloud_of((0.05, 6000), (0.05, 6000), few)
    assert not is_rough(pipes[2], near)
    assert rough_ones(pipes, near) == {0, 1, 2}
    pipes, near = cloud_of((0.0, 6000), (0.0, 6000), few)
    assert rough_ones(pipes, near) == frozenset()


def test_a_pipe_among_stems_stays_one():
    pipes, near = cloud_of((0.05, 6000), (0.05, 6000), (0.0, 20000))
    assert rough_ones(pipes, near) == {0, 1}
    assert rough_ones([], near) == frozenset()
