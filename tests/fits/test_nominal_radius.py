"""Which entry of a catalogue a radius is of: laws of the decision, and a table of cases."""

import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from cylx.fits.nominal_radius import DECISIVE, MOST_RATIO, NEAR_IN_DEVIATIONS, Catalogue, choose_entry

lengths = st.floats(1e-6, 1e6)
shares = st.floats(1e-6, 0.5)
one_entry = Catalogue((1.0,), (2e-3,))
ROUNDING = 1e-9
"""Of a ratio, relative: the logarithm in it may be of the order of 100."""


@st.composite
def catalogues(draw):
    """Any catalogue, about any length."""
    unit = draw(lengths)
    radii = tuple(unit * radius for radius in draw(st.lists(st.floats(0.1, 10), min_size=1, max_size=6, unique=True)))
    return Catalogue(radii, tuple(draw(shares) * radius for radius in radii))


@pytest.mark.parametrize(
    ("radius", "deviation", "radii", "tolerances", "decision", "entry"),
    [
        (1.0, 1e-3, (1.0,), (1e-3,), "snapped", 0),
        (1.0, 1e-3, (0.5, 1.0, 2.0), (1e-3, 1e-3, 1e-3), "snapped", 1),
        (1.0029, 0.0, (1.0,), (1e-3,), "ambiguous", 0),  # within three tolerances, 5 times as likely as anywhere else
        (1.0031, 0.0, (1.0,), (1e-5,), "none", 0),
        (1.0035, 1e-3, (1.0,), (1e-6,), "none", 0),
        (1.002, 1e-3, (1.0, 1.003), (1e-4, 1e-4), "ambiguous", 1),  # closer than the points can tell
        (1.0001, 1e-4, (1.0, 1.003), (1e-4, 1e-4), "snapped", 0),
        (1.5, 1e-3, (1.0, 2.0), (2e-3, 4e-3), "none", 1),
        (1.0, 0.2, (1.0,), (2e-3,), "ambiguous", 0),  # the points say next to nothing
        (1.0, 5.0, (1.0,), (2e-3,), "none", 0),
        (0.3, 0.25, (1.0,), (2e-3,), "none", 0),  # half of it and less is no refuge
        (1e-9, 1e-12, (1.0, 30.0), (2e-3, 0.1), "none", 0),
        (1e9, 1.0, (1.0, 30.0), (2e-3, 0.1), "none", 1),
        (1e300, 1e290, (1e300, 1e-300), (1e298, 1e-302), "snapped", 0),
        (1e-300, 0.0, (1e300, 1e-300), (1e298, 1e-320), "snapped", 1),
    ],
)
def test_a_table_of_decisions(radius, deviation, radii, tolerances, decision, entry):
    choice = choose_entry(radius, deviation, Catalogue(radii, tolerances))
    assert (choice.decision, choice.entry) == (decision, entry)
    assert (choice.radius, choice.deviation) == (radius, deviation)


@given(lengths, shares, catalogues())
def test_the_ratio_is_finite_and_the_decision_follows_from_it(radius, share, catalogue):
    choice = choose_entry(radius, share * radius, catalogue)
    assert 1 / MOST_RATIO * (1 - 1e-9) <= choice.ratio <= MOST_RATIO * (1 + 1e-9)
    spread = math.hypot(share * radius, catalogue.tolerances[choice.entry])
    away = abs(radius - catalogue.radii[choice.entry]) / spread
    if choice.decision == "snapped":
        assert choice.ratio >= DECISIVE * (1 - 1e-9)
        assert away <= NEAR_IN_DEVIATIONS
    elif away <= NEAR_IN_DEVIATIONS:
        assert choice.ratio < DECISIVE * (1 + 1e-9)


@given(shares, catalogues(), st.integers(-40, 40))
def test_the_unit_does_not_matter(share, catalogue, power):
    radius, unit = 1.01 * catalogue.radii[0], 2.0**power
    one = choose_entry(radius, share * radius, catalogue)
    scaled = Catalogue(*(tuple(unit * x for x in part) for part in catalogue))
    other = choose_entry(unit * radius, unit * share * radius, scaled)
    assert (other.entry, other.ratio) == (one.entry, pytest.approx(one.ratio, rel=1e-9))
    millimetres = Catalogue(*(tuple(1000 * x for x in part) for part in catalogue))
    assert choose_entry(1000 * radius, 1000 * share * radius, millimetres).ratio == pytest.approx(one.ratio, rel=1e-6)


@given(shares, catalogues(), st.randoms(use_true_random=False))
def test_the_order_of_the_entries_does_not_matter(share, catalogue, random):
    radius = 0.99 * catalogue.radii[0]
    order = random.sample(range(len(catalogue.radii)), len(catalogue.radii))
    shuffled = Catalogue(*(tuple(part[i] for i in order) for part in catalogue))
    one, other = (choose_entry(radius, share * radius, each) for each in (catalogue, shuffled))
    assume(one.ratio > 1 + 1e-9)  # no draw
    assert (other.decision, other.ratio) == (one.decision, pytest.approx(one.ratio, rel=ROUNDING))
    assert shuffled.radii[other.entry] == catalogue.radii[one.entry]


@given(st.floats(0, 0.5), st.floats(0, 0.5), st.floats(0, 0.05))
def test_the_nearer_the_likelier(one, other, deviation):
    near, far = sorted((one, other))
    below = [choose_entry(1.0 - away, deviation, one_entry).ratio for away in (near, far)]
    assert below[0] >= below[1] * (1 - ROUNDING)
    # above, "none" gets less likely, too, with the larger radius; from where that is made up for, farther is less
    turn = math.hypot(deviation, one_entry.tolerances[0]) ** 2
    above = [choose_entry(1.0 + turn + away, deviation, one_entry).ratio for away in (near, far)]
    assert above[0] >= above[1] * (1 - ROUNDING)


@given(st.floats(1e-3, 0.1), st.floats(1.001, 10))
def test_less_certain_points_are_less_decisive_at_a_nominal_radius(deviation, factor):
    sharp, blunt = (choose_entry(1.0, d, one_entry).ratio for d in (deviation, factor * deviation))
    assert sharp > blunt * (1 - ROUNDING)


@given(catalogues(), st.floats(0.2, 5), shares)
def test_one_more_entry_never_makes_another_one_more_likely(catalogue, factor, share):
    radius = catalogue.radii[0]
    rival = factor * radius
    assume(rival not in catalogue.radii)
    more = Catalogue((*catalogue.radii, rival), (*catalogue.tolerances, share * rival))
    one, other = (choose_entry(radius, share * radius, each) for each in (catalogue, more))
    assume(one.entry == other.entry)
    widest = max(more.radii) / min(more.radii) / (max(catalogue.radii) / min(catalogue.radii))
    assert other.ratio <= one.ratio * (1 + math.log(widest) / math.log(4)) * (1 + 1e-9)
