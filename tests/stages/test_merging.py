"""Pieces of one pipe become one cylinder, and neighbours stay two."""

from dataclasses import replace

import numpy as np
import pytest

from cylx.config import Config
from cylx.geometry.cells import Cells
from cylx.geometry.cylinder import Cylinder
from cylx.records import Finding, IndexedCloud, Noise, Segment
from cylx.scene import make_frame
from cylx.stages.merging import drop_claimed, merge_pieces
from cylx.synthetic.surfaces import Mantle

SIGMA = 0.01


def world(*shapes, n=1500):
    """Give the ground of some cylinders, and a finding for each."""
    rng = np.random.default_rng(0)
    clean = [Mantle(shape, 0.0, 2 * np.pi).sample(rng, n) for shape in shapes]
    points = np.concatenate(clean) + SIGMA * rng.standard_normal((n * len(shapes), 3))
    frame, _ = make_frame(points, Config())
    noise = Noise(np.ones(1), np.array([SIGMA / frame.spacing]))
    indexed = IndexedCloud(Cells(frame.points, frame.codes), np.zeros(len(points)), noise)
    owner = np.repeat(np.arange(len(shapes)), n)[frame.order]
    findings = [finding(shape, np.flatnonzero(owner == k), frame) for k, shape in enumerate(shapes)]
    return indexed, findings, frame


def finding(shape, points, frame, payoff=0.8, error=0.001):
    middle = (shape.point - frame.origin) / frame.spacing
    model = np.concatenate([middle, shape.direction, [shape.radius / frame.spacing]])
    half = 0.5 * shape.height / frame.spacing
    return Finding(
        segment=Segment(model, half, SIGMA / frame.spacing),
        points=points,
        support=10,
        payoff=payoff,
        confidence=0.9,
        coverage=2 * np.pi,
        offset_error=error * model[6],
        tilt_error=error * model[6] / half,
    )


def accept(indexed):
    """Give a judge that believes everything, and takes all points near the surface."""

    def judge(segment, best):
        model = segment.model
        width = 3.0 * indexed.noise.least
        near = indexed.cells.near_cylinder(model, -segment.half, segment.half, model[6] - width, model[6] + width)
        return Finding(segment, near, best.support, best.payoff, 0.9, 2 * np.pi, 0.01, 0.01)

    return judge


def pipe(low, high, x=0.0, radius=1.0, direction=(0, 0, 1)):
    return Cylinder((x, 0, 0.5 * (low + high)), direction, radius, high - low)


@pytest.mark.parametrize("gap", [0.0, 0.5, 3.0])
def test_two_pieces_of_a_pipe_become_one(gap):
    indexed, findings, frame = world(pipe(0, 4), pipe(4 + gap, 8 + gap))
    (whole,) = merge_pieces(findings, indexed, accept(indexed))
    assert np.isclose(2 * whole.segment.half * frame.spacing, 8 + gap, rtol=0.01)
    assert np.isclose(whole.segment.radius * frame.spacing, 1.0, rtol=0.005)
    assert np.allclose(np.cross(whole.segment.direction, [0, 0, 1]), 0, atol=0.005)
    assert len(whole.points) > 2900


def test_three_pieces_become_one_in_any_order():
    indexed, findings, _ = world(pipe(0, 3), pipe(3, 6), pipe(6, 9))
    for order in ([0, 1, 2], [0, 2, 1], [2, 0, 1]):
        assert len(merge_pieces([findings[k] for k in order], indexed, accept(indexed))) == 1


@pytest.mark.parametrize(
    "other",
    [
        pipe(0, 4, x=2.1),
        pipe(5, 9, x=0.5),
        pipe(5, 9, radius=0.7),
        pipe(5, 9, direction=(0.2, 0, 1)),
    ],
    ids=["beside", "displaced", "thinner", "bent"],
)
def test_neighbours_stay_two(other):
    indexed, findings, _ = world(pipe(0, 4), other)
    kept = merge_pieces(findings, indexed, accept(indexed))
    assert sorted(map(id, kept)) == sorted(map(id, findings))


def test_pieces_too_far_to_tell_stay_two():
    indexed, (one, other), frame = world(pipe(0, 2), pipe(30, 32))
    vague = [
        finding(shape, part.points, frame, error=0.1) for shape, part in ((pipe(0, 2), one), (pipe(30, 32), other))
    ]
    assert len(merge_pieces(vague, indexed, accept(indexed))) == 2
    assert len(merge_pieces([one, other], indexed, accept(indexed))) == 1


@pytest.mark.parametrize(("x", "kept"), [(0.0, 1), (0.3, 1), (2.1, 2)], ids=["in line", "nearly", "beside"])
def test_ends_of_a_long_pipe_are_joined_if_they_point_at_each_other(x, kept):
    shapes = pipe(0, 6), pipe(206, 212, x=x)
    indexed, parts, frame = world(*shapes)
    # one alone tells the place of the other to 0.6 radii, which would not suffice to know it from a neighbour
    vague = [finding(shape, part.points, frame, error=0.009) for shape, part in zip(shapes, parts, strict=True)]
    assert len(merge_pieces(vague, indexed, accept(indexed))) == kept


@pytest.mark.parametrize(
    ("low", "radius", "error", "kept"),
    [(10, 1.0, 0.001, 1), (10, 1.04, 0.001, 2), (10, 1.04, 0.02, 1), (5, 1.04, 0.001, 1)],
    ids=["of one size", "of another", "as far as is known", "near"],
)
def test_over_a_gap_longer_than_themselves_only_pieces_of_one_size_are_joined(monkeypatch, low, radius, error, kept):
    """The noise hides the difference in any case."""
    monkeypatch.setattr("tests.stages.test_merging.SIGMA", 0.05)
    indexed, findings, _ = world(pipe(0, 4), pipe(low, low + 4, radius=radius), n=4000)
    findings = [replace(one, offset_error=error * one.segment.radius) for one in findings]
    assert len(merge_pieces(findings, indexed, accept(indexed))) == kept


def test_the_judge_has_the_last_word():
    indexed, findings, _ = world(pipe(0, 4), pipe(4, 8))
    assert len(merge_pieces(findings, indexed, lambda segment, best: None)) == 2


def test_nothing_and_one_are_not_merged():
    indexed, findings, _ = world(pipe(0, 4))
    assert merge_pieces([], indexed, accept(indexed)) == []
    assert merge_pieces(findings, indexed, accept(indexed)) == findings


def claims(*parts):
    """Give findings with these points and payoffs."""
    segment = Segment(np.array([0.0, 0, 0, 0, 0, 1, 1]), 1.0, 0.1)
    return [Finding(segment, np.arange(*span), 5, payoff, 0.9, 6.0, 0.1, 0.1) for span, payoff in parts]


@pytest.mark.parametrize(
    ("parts", "kept"),
    [
        ([((0, 100), 0.9), ((100, 150), 0.9)], [0, 1]),
        ([((0, 100), 0.9), ((60, 110), 0.9)], [0]),
        ([((0, 100), 0.9), ((75, 125), 0.9)], [0, 1]),
        ([((0, 100), 0.3), ((0, 90), 0.9)], [1]),
        ([((0, 100), 0.9), ((40, 140), 0.8), ((110, 200), 0.9)], [0, 2]),
        ([], []),
    ],
    ids=["apart", "mostly claimed", "half claimed", "the better payoff", "a chain", "none"],
)
def test_what_better_ones_have_claimed_is_dropped(parts, kept):
    findings = claims(*parts)
    assert {id(one) for one in drop_claimed(findings, 200)} == {id(findings[k]) for k in kept}


def test_what_others_have_claimed_before_is_dropped():
    findings = claims(((0, 60), 1.0), ((60, 120), 1.0))
    assert drop_claimed(findings, 200, findings[:1]) == findings[1:]
    assert drop_claimed(findings, 200, findings) == []
    assert {id(one) for one in drop_claimed(findings, 200, [])} == {id(one) for one in drop_claimed(findings, 200)}


def far_pieces(between, tilt=0.0012):
    """Give what becomes of two pieces so far apart that their directions alone do not say they are one."""
    rng = np.random.default_rng(3)
    ends = [Mantle(pipe(*ends), 0.0, 2 * np.pi).sample(rng, 300) for ends in ((0.0, 3.0), (400.0, 403.0))]
    clean = np.concatenate([*ends, between])
    points = clean + SIGMA * rng.standard_normal(clean.shape)
    frame, _ = make_frame(points, Config())
    noise = Noise(np.ones(1), np.array([SIGMA / frame.spacing]))
    indexed = IndexedCloud(Cells(frame.points, frame.codes), np.zeros(len(points)), noise)
    findings = []
    for k, (low, sign) in enumerate(((0.0, 1.0), (400.0, -1.0))):
        direction = (np.sin(sign * tilt), 0, np.cos(tilt))
        own = np.flatnonzero((frame.order >= 300 * k) & (frame.order < 300 * (k + 1)))
        shape = pipe(low, low + 3.0, direction=direction)
        findings.append(replace(finding(shape, own, frame, error=0.01), tilt_error=0.004))
    return merge_pieces(findings, indexed, accept(indexed))


def test_far_pieces_are_joined_if_there_are_points_between_them():
    rng = np.random.default_rng(4)
    assert len(far_pieces(Mantle(pipe(3.0, 400.0), 0.0, 2 * np.pi).sample(rng, 40))) == 1
    assert len(far_pieces(np.empty((0, 3)))) == 2
    beside = rng.uniform([-1.5, -1.5, 3.0], [1.5, 1.5, 400.0], (400, 3))
    assert len(far_pieces(beside)) == 2


def test_pieces_side_by_side_are_joined_however_uncertain_their_direction():
    indexed, findings, _ = world(pipe(0.0, 2.0), pipe(2.5, 4.5))
    findings = [replace(one, tilt_error=2.0) for one in findings]
    assert len(merge_pieces(findings, indexed, accept(indexed))) == 1
