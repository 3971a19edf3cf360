"""Order statistics against numpy."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cylx.geometry.numerics import median_of_positive, sort_in_place

numbers = st.floats(allow_nan=False, width=64) | st.sampled_from([0.0, 1.0, -1.0, np.inf, -np.inf])
lists = st.lists(numbers, max_size=40)
laws = settings(max_examples=100, deadline=None)


@laws
@given(lists, st.integers(0, 10))
def test_the_first_values_are_sorted_and_the_others_stay(values, others):
    array = np.array(values + list(range(others)), dtype=np.float64)
    before = array.copy()
    sort_in_place(array, len(values))
    assert np.array_equal(array[: len(values)], np.sort(before[: len(values)]))
    assert np.array_equal(array[len(values) :], before[len(values) :])


@pytest.mark.parametrize("n", [0, 1, 2, 3, 12, 13, 14, 39, 40, 41, 1000, 5000])
@pytest.mark.parametrize("kind", ["random", "ascending", "descending", "few", "equal"])
def test_arrays_of_every_kind_are_sorted(n, kind):
    rng = np.random.default_rng(n)
    values = {
        "random": rng.standard_normal(n),
        "ascending": np.arange(n) - 0.5 * n,
        "descending": 0.5 * n - np.arange(n),
        "few": rng.integers(0, 3, n).astype(float),
        "equal": np.full(n, 0.25),
    }[kind]
    expected = np.sort(values)
    sort_in_place(values, n)
    assert np.array_equal(values, expected)


@laws
@given(st.lists(st.floats(-1e6, 1e6), max_size=40), st.integers(0, 5))
def test_the_median_is_that_of_the_positive_ones(values, others):
    array = np.array(values + [1e9] * others, dtype=np.float64)
    before = array.copy()
    positive = [value for value in values if value > 0]
    found = median_of_positive(array, len(values), np.empty(len(array)))
    assert found == (np.median(positive) if positive else 0.0)
    assert np.array_equal(array, before)
