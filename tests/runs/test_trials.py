"""Kernels that score many bends and reducers, against their plain formulas."""

import math
from dataclasses import replace

import numpy as np
import pytest

from cylx.runs.bend import Bend
from cylx.runs.trials import fill_bend_scores, fill_cone_costs, fill_radius_costs, fill_reducer_scores

R, SPREAD, SHELL = 0.05, 0.003, 0.015
RATIO = math.log(2.0 * SHELL / (math.sqrt(2.0 * math.pi) * SPREAD))
SURFACE = np.array([R, SPREAD, SHELL, RATIO])


def gains(errors):
    return np.where(np.abs(errors) < SHELL, np.maximum(RATIO - 0.5 * (errors / SPREAD) ** 2, -RATIO), 0.0)


def test_costs_of_bend_radii_count_the_points_that_some_bend_explains():
    x, y, _ = np.eye(3)
    bend = Bend(np.zeros(3), x, y, 0.0)
    points = np.random.default_rng(0).uniform([-0.3, -0.1, -0.08], [0.1, 0.3, 0.08], (500, 3))
    radii, width, costs = np.array([0.0, 0.1, 0.15, 0.22]), 0.012, np.empty(4)
    corner = np.stack([bend.meeting, bend.first, bend.second, bend.normal, bend.inward])
    fill_radius_costs(points, corner, bend.angle, radii, R, width, costs)
    distances = np.stack([replace(bend, bend_radius=radius).coordinates(points)[1] for radius in radii.tolist()])
    squares = np.minimum(((distances - R) / width) ** 2, 1.0)
    assert costs == pytest.approx(squares[:, (squares < 1.0).any(axis=0)].sum(axis=1))


def test_the_best_bend_from_an_end_is_where_points_are():
    rng = np.random.default_rng(1)
    size, count = 0.15, 600
    turn, about = 0.5 * math.pi * rng.random(count), 2.0 * math.pi * rng.random(count)
    out = size - (R + SPREAD * rng.standard_normal(count)) * np.cos(about)
    inward = size - out * np.cos(turn)
    local = np.column_stack([out * np.sin(turn), np.zeros(count), inward])
    local[:, 1] = -(R * np.sin(about))
    turns, radii = np.arange(8) * (math.pi / 4.0), np.array([0.1, 0.15, 0.25])
    scores = np.empty((8, 3, 3))
    fill_bend_scores(local, turns, radii, np.array([-0.02, 0.0]), SURFACE, 56, 0.25 * R, scores)
    best = np.unravel_index(scores[:, :, 0].argmax(), (8, 3))
    assert best == (2, 1)
    assert scores[2, 1, 1] == 0.0
    assert scores[2, 1, 2] == pytest.approx(0.5 * math.pi, abs=0.1)
    y = size - local[:, 2]
    errors = np.hypot(np.hypot(local[:, 0], y) - size, local[:, 1]) - R
    assert scores[2, 1, 0] == pytest.approx(gains(errors)[local[:, 0] > 0].sum(), rel=0.02)


def test_scores_of_reducers_are_sums_up_to_where_they_are_largest():
    rng = np.random.default_rng(2)
    local = np.column_stack([rng.uniform(-0.1, 0.4, 300), rng.normal(0, 0.04, 300), rng.normal(0, 0.04, 300)])
    tried = np.array([[0.0, 0.1, 0.03, 0.0, 0.0], [0.05, 0.08, 0.04, 0.01, -0.005]])
    back, step, scores = -0.1, 0.0125, np.empty((2, 2))
    fill_reducer_scores(local, tried, SURFACE, back, step, scores)
    rows = ((local[:, 0] - back) / step).astype(int)
    for (begin, length, radius, a, b), (score, stop) in zip(tried, scores, strict=True):
        share = np.clip((local[:, 0] - begin) / length, 0.0, 1.0)
        errors = np.hypot(local[:, 1] - share * a, local[:, 2] - share * b) - (R + share * (radius - R))
        total = np.cumsum(np.bincount(rows, weights=gains(errors)))
        assert score == pytest.approx(total.max())
        assert stop == pytest.approx(back + (total.argmax() + 1) * step)


def test_costs_of_cones_are_those_of_a_pipe_a_cone_and_a_pipe():
    rng = np.random.default_rng(3)
    local = np.column_stack([rng.uniform(-0.2, 0.4, 400), rng.normal(0, 0.04, 400), rng.normal(0, 0.04, 400)])
    # the second axis is parallel to the first, 1 cm beside it
    second = np.array([0.01, 0.0, 0.0, 1.0, 0.0, 0.0])
    tried, costs = np.array([[0.0, 0.1], [-0.05, 0.2]]), np.empty(2)
    fill_cone_costs(local, tried, np.array([R, 0.03]), second, 0.01, costs)
    for (low, high), cost in zip(tried, costs, strict=True):
        share = np.clip((local[:, 0] - low) / (high - low), 0.0, 1.0)
        errors = np.hypot(local[:, 1] - share * 0.01, local[:, 2]) - (R + share * (0.03 - R))
        slope = (0.03 - R) / (high - low)
        errors[(local[:, 0] > low) & (local[:, 0] < high)] /= math.sqrt(1.0 + slope**2)
        assert cost == pytest.approx(np.minimum((errors / 0.01) ** 2, 1.0).sum())
