"""The cross product against numpy's."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cylx.geometry.numerics import cross

SHAPES = [
    ((3,), (3,)),
    ((5, 3), (5, 3)),
    ((5, 3), (3,)),
    ((3,), (5, 3)),
    ((4, 1, 3), (6, 3)),
    ((2, 1, 3), (1, 7, 3)),
    ((0, 3), (3,)),
    ((1, 3), (0, 3)),
]


@settings(max_examples=20, deadline=None)
@pytest.mark.parametrize(("one", "other"), SHAPES)
@given(seed=st.integers(0, 2**32 - 1))
def test_it_is_the_general_one_with_its_broadcasting(one, other, seed):
    rng = np.random.default_rng(seed)
    a, b = rng.standard_normal(one), rng.standard_normal(other)
    expected = np.cross(a, b)
    found = cross(a, b)
    assert found.shape == expected.shape
    assert found.dtype == np.float64
    assert np.array_equal(found, expected)


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(-150, 150))
def test_it_is_square_to_both_as_long_as_their_area_and_turns_with_their_order(seed, exponent):
    rng = np.random.default_rng(seed)
    a, b = 10.0**exponent * rng.standard_normal((20, 3)), rng.standard_normal((20, 3))
    found, size = cross(a, b), np.linalg.norm(a, axis=1) * np.linalg.norm(b, axis=1)
    assert np.array_equal(cross(b, a), -found)
    assert (np.abs((found * b).sum(axis=1)) <= 1e-14 * size * np.linalg.norm(b, axis=1)).all()
    assert np.allclose(np.linalg.norm(found, axis=1) / size, np.sqrt(1 - ((a * b).sum(axis=1) / size) ** 2), atol=1e-7)
    assert not cross(a, a).any()
