"""The weighing of the measures: what counts, and what is excused."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cylx.evidence.weights import TERMS, weigh

EDGE = dict(  # noqa: C408  keys without quotes read better
    noise_ratio=1.0, lack_of_fit=1.0, structure=0.0, structure_radii=0.0, inside=0.0, outside=0.0, tangent=0.0,
    flank=0.3, coverage=3.0, inliers=90.0, places=12.0, height_radii=9.0, payoff=0.6, agreement=0.8, radius_noises=9.0,
    slope=0.0, slope_error=0.01, bulge=0.0, bend=0.0, bend_error=0.01,
)  # fmt: skip
"""What is thin, seen from one side, and has a flank."""


def confidence(**changes):
    """Give the confidence in an edge, or in what differs from it."""
    return weigh({**EDGE, **changes})[0]


def test_a_flank_speaks_against_what_is_thin_and_seen_from_one_side():
    assert weigh(EDGE)[1] == "flank"
    assert confidence() < 0.2
    assert confidence(flank=0.0) > 0.8
    assert confidence(flank=0.1) > confidence(flank=0.2) > confidence() == confidence(flank=2.0)


def test_a_flank_does_not_count_where_the_surface_goes_on_behind_it():
    coverage = np.radians([180, 230, 330, 360])
    worth = [confidence(coverage=angle, flank=0.0) - confidence(coverage=angle) for angle in coverage]
    assert min(worth[:2]) > 0.5
    assert worth[2:] == [0.0, 0.0]


def test_the_noise_hides_more_of_a_thinner_edge():
    seen = np.radians(270)
    thin, thicker = (
        confidence(coverage=seen, radius_noises=radius, flank=0.0) - confidence(coverage=seen, radius_noises=radius)
        for radius in (4.0, 19.0)
    )
    assert thin > 5.0 * thicker > 0.0


def test_the_smeared_outline_of_a_thick_cylinder_is_excused():
    lost = [confidence(flank=0.0) - confidence(radius_noises=radius) for radius in (10.0, 40.0, 300.0)]
    assert lost[0] > lost[1] > lost[2]
    assert lost[2] < 0.01


@pytest.mark.parametrize("name", ["flank", "tangent", "inside", "noise_ratio", "lack_of_fit", "bend", "bulge", "slope"])
@given(less=st.floats(0, 2), more=st.floats(0, 2), coverage=st.floats(0.3, 6.28), radius=st.floats(1, 1e4))
def test_more_of_what_speaks_against_it_never_helps(name, less, more, coverage, radius):
    low, high = sorted([less, more])
    here = {"coverage": coverage, "radius_noises": radius, "flank": 0.0}
    assert confidence(**{**here, name: high}) <= confidence(**{**here, name: low})


def test_every_term_has_a_weight_and_a_reason_of_its_own():
    assert len({term.reason for term in TERMS}) == len(TERMS)
    assert all(term.weight for term in TERMS)
