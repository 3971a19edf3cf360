"""The weighing of the measures: what counts, and what is excused."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cylx.evidence.weights import BLEND_TERMS, TERMS, weigh, weigh_blend

EDGE = dict(  # noqa: C408  keys without quotes read better
    scatter_radii=1 / 9, form_radii=0.0, roughness=1.0, noise_ratio=1.0, lack_of_fit=1.0, structure=0.0,
    structure_radii=0.0, ovality=0.0, explained=0.0, facets=0.0, prism=0.0, deviation_radii=1 / 9, inside=0.0,
    outside=0.0, tangent=0.0, tangent_both=0.0, flank=0.3, coverage=3.0, inliers=90.0, places=12.0, curvature=90.0,
    radius_noises=9.0, height_radii=9.0, windows=20.0, payoff=0.8, agreement=0.8, slope=0.0, slope_error=0.01,
    bulge=0.0, bulge_error=0.01, bend=0.0, bend_error=0.01, ball=0.0,
)  # fmt: skip
"""What is thin, seen from one side, and has a flank."""


def confidence(**changes):
    """Give the confidence in an edge, or in what differs from it."""
    return weigh({**EDGE, **changes})[0]


def test_a_flank_speaks_against_what_is_thin_and_seen_from_one_side():
    assert weigh(EDGE)[1] == "flank"
    assert confidence() < confidence(flank=0.0) - 0.3
    assert confidence(flank=0.0) > 0.8
    assert confidence(flank=0.1) > confidence(flank=0.2) > confidence() == confidence(flank=2.0)


def test_a_flank_does_not_count_where_the_surface_goes_on_behind_it():
    coverage = np.radians([180, 230, 330, 360])
    worth = [confidence(coverage=angle, flank=0.0) - confidence(coverage=angle) for angle in coverage]
    assert min(worth[:2]) > 0.3
    assert worth[2:] == [0.0, 0.0]


def test_the_noise_hides_more_of_a_thinner_edge():
    seen = np.radians(270)
    thin, thicker = (
        confidence(coverage=seen, scatter_radii=1 / radius, flank=0.0)
        - confidence(coverage=seen, scatter_radii=1 / radius)
        for radius in (4.0, 19.0)
    )
    assert thin > 5.0 * thicker > 0.0


def test_the_smeared_outline_of_a_thick_cylinder_is_excused():
    lost = [
        confidence(flank=0.0, scatter_radii=1 / radius) - confidence(scatter_radii=1 / radius)
        for radius in (10.0, 40.0, 300.0)
    ]
    assert lost[0] > lost[1] > lost[2]
    assert lost[2] < 0.01


AGAINST = (
    "flank",
    "tangent",
    "inside",
    "outside",
    "structure_radii",
    "explained",
    "lack_of_fit",
    "bend",
    "bulge",
    "slope",
)


@pytest.mark.parametrize("name", AGAINST)
@given(less=st.floats(0, 2), more=st.floats(0, 2), coverage=st.floats(0.3, 6.28), radius=st.floats(1, 1e4))
def test_more_of_what_speaks_against_it_never_helps(name, less, more, coverage, radius):
    low, high = sorted([less, more])
    here = {"coverage": coverage, "scatter_radii": 1 / radius, "flank": 0.0}
    assert confidence(**{**here, name: high}) <= confidence(**{**here, name: low})


@given(factor=st.floats(0.01, 100))
def test_the_noise_about_it_has_no_say(factor):
    """All that the noise of the cloud enters is reported, and not weighed: it may be wrong by much."""
    changed = {name: EDGE[name] * factor for name in ("noise_ratio", "radius_noises", "structure")}
    assert weigh({**EDGE, **changed}) == weigh(EDGE)
    assert weigh_blend({**EDGE, **changed}) == weigh_blend(EDGE)


@pytest.mark.parametrize("terms", [TERMS, BLEND_TERMS], ids=["cylinders", "blends"])
def test_every_term_has_a_weight_and_a_reason_of_its_own(terms):
    assert len({term.reason for term in terms}) == len(terms)
    assert all(term.weight for term in terms)


@pytest.mark.parametrize("name", ["structure_radii", "ovality", "lack_of_fit", "bend"])
@given(less=st.floats(0, 2), more=st.floats(0, 2))
def test_more_of_what_speaks_against_a_blend_never_helps(name, less, more):
    low, high = sorted([less, more])
    assert weigh_blend({**EDGE, name: high}) <= weigh_blend({**EDGE, name: low})


def test_a_blend_may_go_on_tangentially():
    on = {"tangent": 1.0, "tangent_both": 0.9, "flank": 0.0, "payoff": 0.9}
    assert weigh_blend({**EDGE, **on}) == weigh_blend({**EDGE, **on, "tangent": 0.0, "tangent_both": 0.0})
    assert weigh({**EDGE, **on})[0] < weigh({**EDGE, **on, "tangent": 0.0, "tangent_both": 0.0})[0]


@pytest.mark.parametrize("facets", [0.0, 1.0])
def test_a_prism_is_refused_whether_or_not_the_noise_hides_its_faces(facets):
    # the deviations of a cylinder out of round are explained by no prism
    rounded = {"flank": 0.0, "coverage": 6.3, "inliers": 900.0, "structure_radii": 0.02, "facets": facets}
    assert confidence(**rounded, prism=0.95) < 0.5 < confidence(**rounded, prism=0.3)
