"""Arcs between planes: fitted with the planes that touch them; and what lies beyond them is not of the arc."""

from dataclasses import replace

import numpy as np
import pytest

from cylx.config import Config
from cylx.evidence.measures import edge_gain, look_at
from cylx.geometry.cells import Cells
from cylx.records import IndexedCloud, Noise, Segment
from cylx.scene import make_frame
from cylx.segments.refitting import refit
from cylx.stages.arcs import arcs_of
from cylx.stages.verification import may_be_arc, verify

SIGMA, LENGTH, HALF = 0.02, 2.0, 2.0
"""Noise, length of the planes and half the height of the arc; its radius is 1."""


def rounded_edge(turn_deg=90.0, count=6000, seed=0):
    """Draw an arc about the z axis between two planes that touch it; its middle is on the x axis."""
    rng = np.random.default_rng(seed)
    half = 0.5 * np.radians(turn_deg)
    along = rng.uniform(-half - LENGTH, half + LENGTH, count)
    turn = np.clip(along, -half, half)
    past = along - turn
    points = np.column_stack([np.cos(turn) - past * np.sin(turn), np.sin(turn) + past * np.cos(turn)])
    points = np.column_stack([points, rng.uniform(-HALF, HALF, count)])
    return points + SIGMA * rng.standard_normal(points.shape), np.abs(past) == 0.0


def pipe(count=6000, seed=0):
    rng = np.random.default_rng(seed)
    turn = 2 * np.pi * rng.random(count)
    points = np.column_stack([np.cos(turn), np.sin(turn), rng.uniform(-HALF, HALF, count)])
    return points + SIGMA * rng.standard_normal(points.shape)


def in_frame(points, radius=1.0, x=0.0):
    """Give the cloud, a segment about an axis parallel to z, and the frame."""
    frame, _ = make_frame(points, Config())
    noise = Noise(np.ones(1), np.array([SIGMA / frame.spacing]))
    indexed = IndexedCloud(Cells(frame.points, frame.codes), np.zeros(len(points)), noise)
    middle = (np.array([x, 0.0, 0.0]) - frame.origin) / frame.spacing
    model = np.concatenate([middle, [0.0, 0.0, 1.0], [radius / frame.spacing]])
    return indexed, Segment(model, HALF / frame.spacing, SIGMA / frame.spacing), frame


def arcs_in(points, radius, x):
    indexed, segment, frame = in_frame(points, radius, x)
    return arcs_of(segment, indexed, lambda one: refit(one, indexed)), indexed, frame


@pytest.mark.parametrize("turn_deg", [60, 90, 120])
@pytest.mark.parametrize("seed", range(2))
def test_an_arc_is_fitted_with_its_planes(turn_deg, seed):
    points, _ = rounded_edge(turn_deg, seed=seed)
    # a circle that is 15 % too large and touches the same planes
    arcs, indexed, frame = arcs_in(points, 1.15, -0.15 / np.cos(0.5 * np.radians(turn_deg)))
    arc = arcs[0]
    assert arc.radius * frame.spacing == pytest.approx(1.0, abs=0.03)
    middle = arc.point * frame.spacing + frame.origin
    assert middle[:2] == pytest.approx([0, 0], abs=0.05)
    assert arc.wedge[:3] == pytest.approx([1, 0, 0], abs=0.05)
    assert np.degrees(np.arccos(arc.wedge[3])) == pytest.approx(0.5 * turn_deg, abs=2)
    assert arc.half * frame.spacing == pytest.approx(HALF)
    shell = look_at(arc, indexed)
    assert edge_gain(shell, arc, shell.deviation) > 100


def test_a_pipe_is_fitted_with_no_planes():
    arcs, _, _ = arcs_in(pipe(), 1.0, 0.0)
    assert [arc.wedge for arc in arcs] == [None] * len(arcs)


def test_where_nothing_lies_there_is_no_arc_with_planes():
    arcs, _, _ = arcs_in(pipe(), 0.2, 30.0)
    assert [arc.wedge for arc in arcs] == [None] * len(arcs)


@pytest.mark.parametrize("ratio", [0.8, 1.3, 1.6])
def test_an_arc_is_found_from_a_circle_that_is_far_too_small_or_too_large(ratio):
    points, _ = rounded_edge()
    arcs, _, frame = arcs_in(points, ratio, 1.0 - ratio)
    assert arcs[0].radius * frame.spacing == pytest.approx(1.0, abs=0.03)


@pytest.mark.parametrize("tilt_deg", [1.0, 3.0])
def test_the_axis_is_that_of_the_planes_though_the_segment_leans(tilt_deg):
    points, _ = rounded_edge()
    indexed, segment, _ = in_frame(points, 1.1, -0.1)
    model = segment.model.copy()
    model[3:6] = [0.0, np.sin(np.radians(tilt_deg)), np.cos(np.radians(tilt_deg))]
    leaning = Segment(model, segment.half, segment.spread)
    arc = arcs_of(leaning, indexed, None)[0]
    assert arc.wedge is not None
    assert np.degrees(np.arccos(min(1.0, arc.direction[2]))) < 0.2 * tilt_deg + 0.1


def test_without_a_refit_there_are_only_arcs_with_planes():
    indexed, segment, _ = in_frame(pipe())
    assert arcs_of(segment, indexed, None) == []


def beam(count=6000, seed=0):
    """Draw one side of an I-beam about the z axis: two flanges that face each other, and the web between them."""
    rng = np.random.default_rng(seed)
    along, part = rng.uniform(-1, 1, count), rng.integers(3, size=count)
    sides = np.choose(part, [-1.0, 1.0, along])
    depth = np.where(part < 2, along, -0.2)
    points = np.column_stack([depth, sides, rng.uniform(-HALF, HALF, count)])
    return points + SIGMA * rng.standard_normal(points.shape)


@pytest.mark.parametrize(
    ("points", "turn_deg", "seen"),
    [(rounded_edge(90.0)[0], 90.0, True), (rounded_edge(170.0)[0], 170.0, True), (beam(), 180.0, False)],
    ids=["edge", "end of a slot", "beam"],
)
def test_an_arc_is_seen_between_its_planes(points, turn_deg, seen):
    indexed, segment, _ = in_frame(points)
    arc = replace(segment, wedge=np.array([1.0, 0.0, 0.0, np.cos(0.5 * np.radians(turn_deg))]))
    verdict = verify(arc, indexed, 0.8, (40, 42), Config().verification, arc=True)
    assert verdict.measures["tangent"] > 0.25
    assert may_be_arc(verdict) == seen
