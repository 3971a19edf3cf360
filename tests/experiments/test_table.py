"""Tables of trials: what is written reads back, and what is damaged or of others is passed over."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import cylx
from cylx.experiments import (
    Key,
    Outcome,
    header_line,
    parse_trials,
    trial_lines,
)
from tests.support.experiments import NAN, outcome

numbers = st.floats(0, 1e6) | st.just(NAN)

keys = st.builds(
    Key,
    st.sampled_from(["", 'least angle of normal and (0, 1, 0), "°"', "p = 0.1\n"]),
    st.sampled_from(["gt", "gt 50°"]),
    st.sampled_from([0.001, 0.05, 10.0, 300.0, 1000.0]),
    st.integers(0, 99),
)

outcomes = st.builds(Outcome, st.integers(0, 5), numbers, numbers, numbers, numbers)


@settings(max_examples=40, deadline=None)
@given(st.dictionaries(keys, outcomes, max_size=20))
def test_a_table_reads_back(done):
    text = header_line() + trial_lines(done.items())
    back = parse_trials(text)
    assert list(back) == list(done)
    for key, one in done.items():
        assert back[key].found == one.found
        assert np.allclose(back[key], one, rtol=1e-5, atol=0, equal_nan=True)  # six digits
    assert header_line() + trial_lines(back.items()) == text
    for cut in range(len(text) - 2, max(0, len(text) - 12), -1):  # within the last line
        kept = parse_trials(text[:cut])
        assert kept is not None or not done
        assert not done or list(kept) == list(done)[:-1]


DONE = {Key("", "gt", 0.01, 0): outcome(), Key("", "gt", 0.01, 1): outcome(angle=NAN)}


def test_lines_of_other_versions_and_damaged_ones_are_passed_over():
    text = header_line() + trial_lines(DONE.items())
    first, second = text.splitlines()[1:]
    for other in (
        first.replace(cylx.__version__, "0.0.1"),
        first.replace("0.01", "x"),
        first.replace("0.5", "?"),
        "a,b",
        "",
    ):
        assert list(parse_trials(f"{header_line()}{other}\n{second}\n")) == list(DONE)[1:]
    assert parse_trials(header_line()) == parse_trials("") == {}


@pytest.mark.parametrize(
    "text",
    [
        "x,y,z\n1,2,3\n",
        "precious",
        header_line().upper(),
        "\n" + header_line(),
        "a" * 200_000,
        header_line() + "a" * 200_000,
    ],
    ids=["other columns", "words", "capitals", "empty line first", "long field", "long field below"],
)
def test_a_foreign_file_is_none(text):
    assert parse_trials(text) is None


def test_trials_made_with_another_scan_are_not_taken_for_those_of_this_one():
    text = header_line() + trial_lines(DONE.items(), "0.1.0 aaaaaaaa")
    assert list(parse_trials(text, "0.1.0 aaaaaaaa")) == list(parse_trials(text, None)) == list(DONE)
    assert parse_trials(text, "0.1.0 bbbbbbbb") == parse_trials(text) == {}
