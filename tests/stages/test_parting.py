"""What was followed across a gap is parted where both sides of it end in a cut."""

import numpy as np
import pytest

from cylx.records import Finding
from cylx.segments.refitting import refit
from cylx.stages.parting import parted
from tests.evidence.test_ends import STEP, findings_of, piece, ragged


def whole_of(*pieces, **how):
    """Give the cloud of pieces, and one finding of all of them."""
    indexed, found, unit = findings_of(np.concatenate(pieces), **how)
    return indexed, found[0], unit


def plated(*pieces, **how):
    """The same with plates at the ends of all pieces."""
    indexed, found, unit = findings_of(*pieces, **how)
    _, whole, _ = whole_of(*pieces, plates=False)
    points = np.sort(np.concatenate([one.points for one in found]))
    low = min(one[:, 2].min() for one in pieces)
    high = max(one[:, 2].max() for one in pieces)
    segment = whole.segment
    first = found[0].segment
    model = first.model.copy()
    model[2] += (0.5 * (low + high) - 0.5 * (pieces[0][:, 2].min() + pieces[0][:, 2].max())) * unit
    segment = type(first)(model, 0.5 * (high - low) * unit, first.spread)
    return indexed, Finding(segment, points, 10, 0.8, 0.9, 2 * np.pi, 0.01, 0.01), unit


def believe(segment, best):
    """Accept every segment as it is."""
    return Finding(segment, best.points, best.support, best.payoff, best.confidence, best.coverage, 0.01, 0.01)


def heights(found, unit):
    return sorted(2 * one.segment.half / unit for one in found)


@pytest.mark.parametrize("gap", [0.6, 2.0])
def test_two_bores_in_line_are_two(gap):
    indexed, whole, unit = plated(piece(0, 3), piece(3 + gap, 5 + gap, seed=1))
    assert heights(parted(whole, indexed, believe), unit) == pytest.approx([2, 3], abs=0.1)


def test_three_collars_are_three():
    indexed, whole, unit = plated(piece(0, 3), piece(4, 6, seed=1), piece(7, 8.5, seed=2))
    assert heights(parted(whole, indexed, believe), unit) == pytest.approx([1.5, 2, 3], abs=0.1)


def test_a_pipe_whose_middle_is_hidden_stays_one():
    pieces = piece(0, 3), piece(4, 7, seed=1)
    indexed, *_ = findings_of(*pieces, plates=False)
    _, whole, _ = plated(*pieces, plates=False)
    assert parted(whole, indexed, believe) == [whole]
    indexed, whole, _ = plated(piece(0, 3, upper=ragged(1.0)), piece(4, 7, seed=1))
    assert parted(whole, indexed, believe) == [whole]


def test_a_pipe_without_a_gap_stays_one():
    indexed, whole, _ = plated(piece(0, 6))
    assert parted(whole, indexed, believe) == [whole]
    indexed, whole, _ = plated(piece(0, 3), piece(3 + STEP / 2, 6, seed=1))
    assert parted(whole, indexed, believe) == [whole]


def test_if_a_piece_is_no_cylinder_the_whole_stays():
    indexed, whole, _ = plated(piece(0, 3), piece(4, 7, seed=1))
    refused = iter([None, whole])
    assert parted(whole, indexed, lambda segment, best: next(refused)) == [whole]


def in_line(radius, strip_deg=40.0, gap=9.0):
    """Give two pipes of 3 and of `radius` 2.4 in line, with what touches them in the gap, and one finding of all."""
    other = piece(3 + gap, 5.4 + gap, seed=1)
    other[:, :2] *= radius
    low = 3 + 0.3 * gap, 3 + 0.9 * gap
    strips = [piece(z, z + 0.2, strip_deg, seed=k, step=0.03) for k, z in enumerate(low)]
    pieces = [piece(0, 3), *strips, other]
    indexed, _, unit = findings_of(*pieces, plates=False, sigma=0.03)
    _, whole, _ = plated(*pieces, plates=False)
    return indexed, whole, unit


@pytest.mark.parametrize(
    ("how", "error", "lengths"),
    [
        ({"radius": 1.05}, 0.003, [2.4, 3]),
        ({"radius": 1.0}, 0.003, [14.4]),
        ({"radius": 1.05, "gap": 2.9}, 0.003, [8.3]),
        ({"radius": 1.05}, 0.02, [14.4]),
        ({"radius": 1.05, "strip_deg": 360.0}, 0.003, [14.4]),
    ],
    ids=["of two sizes", "of one size", "near", "as far as is known", "with pieces between"],
)
def test_pipes_that_lie_in_line_by_chance_are_two_if_their_sizes_differ(how, error, lengths):
    indexed, whole, unit = in_line(**how)

    def judge(segment, best):
        fitted = refit(segment, indexed)
        return Finding(fitted, best.points, 10, 0.8, 0.9, best.coverage, error * unit, 0.001)

    found = parted(whole, indexed, judge)
    assert heights(found, unit) == pytest.approx(lengths, abs=0.1)
    if len(found) > 1:
        assert sorted(one.segment.radius / unit for one in found) == pytest.approx([1.0, how["radius"]], abs=0.01)
