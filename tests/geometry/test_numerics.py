"""The numerics of the kernels, against those of NumPy: linear algebra, order statistics, the cross product."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cylx.geometry.numerics import cross, fill_basis, median_of_positive, solve_in_place, sort_in_place, symmetric_eigen

seeds = st.integers(0, 2**32 - 1)
laws = settings(max_examples=50, deadline=None)
numbers = st.floats(allow_nan=False, width=64) | st.sampled_from([0.0, 1.0, -1.0, np.inf, -np.inf])
lists = st.lists(numbers, max_size=40)
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


@laws
@given(seeds, st.integers(1, 6), st.floats(-8, 8))
def test_it_solves_as_numpy_does(seed, n, exponent):
    rng = np.random.default_rng(seed)
    matrix, right = 10.0**exponent * rng.standard_normal((n, n)), rng.standard_normal(n)
    condition = np.linalg.cond(matrix)
    expected = np.linalg.solve(matrix, right)
    assert solve_in_place(matrix.copy(), solution := right.copy())
    assert np.allclose(solution, expected, rtol=0, atol=1e-14 * condition * np.abs(expected).max())


@laws
@given(seeds)
def test_rows_may_stand_in_any_order(seed):
    rng = np.random.default_rng(seed)
    matrix, right, order = rng.standard_normal((5, 5)), rng.standard_normal(5), rng.permutation(5)
    condition = np.linalg.cond(matrix)
    solve_in_place(matrix.copy(), one := right.copy())
    solve_in_place(matrix[order], other := right[order])
    assert np.allclose(one, other, rtol=0, atol=1e-14 * condition * np.abs(one).max())


def test_a_part_of_the_scratch_is_a_system_of_its_own():
    rng = np.random.default_rng(1)
    matrix, right = rng.standard_normal((6, 6)), rng.standard_normal(6)
    expected = np.linalg.solve(matrix[:4, :4], right[:4])
    rest = right[4:].copy()
    assert solve_in_place(matrix, right[:4])
    assert np.allclose(right[:4], expected)
    assert np.array_equal(right[4:], rest)


@pytest.mark.parametrize(
    "matrix",
    [
        np.zeros((3, 3)),
        np.ones((3, 3)),
        np.array([[1.0, 2, 3], [2, 4, 6], [1, 0, 1]]),
        np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 1e-17]]),
    ],
)
@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_a_singular_matrix_is_told(matrix, scale):
    assert not solve_in_place(scale * matrix, np.ones(3))


def test_a_zero_on_the_diagonal_is_no_singularity():
    matrix, right = np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, 2]]), np.array([1.0, 2, 4])
    assert solve_in_place(matrix, right)
    assert right.tolist() == [2, 1, 2]


def symmetric(seed, spread):
    """Give a symmetric matrix with eigenvalues over a few orders of magnitude."""
    rng = np.random.default_rng(seed)
    basis = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    return (basis * (10.0 ** rng.uniform(-spread, spread, 3) * rng.choice([-1, 1], 3))) @ basis.T


@laws
@given(seeds, st.floats(0, 5))
def test_it_diagonalises_as_numpy_does(seed, spread):
    matrix = symmetric(seed, spread)
    matrix = 0.5 * (matrix + matrix.T)
    values, vectors = matrix.copy(), np.empty((3, 3))
    symmetric_eigen(values, vectors)
    largest = np.abs(matrix).max()
    assert np.allclose(np.sort(np.diag(values)), np.linalg.eigvalsh(matrix), rtol=0, atol=1e-14 * largest)
    assert np.allclose(vectors.T @ vectors, np.eye(3), rtol=0, atol=1e-14)
    assert np.allclose(matrix @ vectors, vectors * np.diag(values), rtol=0, atol=1e-14 * largest)


@pytest.mark.parametrize("matrix", [np.zeros((3, 3)), np.eye(3), np.diag([3.0, 1, 1]), np.ones((3, 3))])
def test_equal_eigenvalues_are_no_trouble(matrix):
    values, vectors = matrix.copy(), np.empty((3, 3))
    symmetric_eigen(values, vectors)
    assert np.allclose(np.sort(np.diag(values)), np.linalg.eigvalsh(matrix), atol=1e-15)
    assert np.allclose((vectors * np.diag(values)) @ vectors.T, matrix, atol=1e-15)


DIRECTIONS = [
    *np.eye(3),
    *-np.eye(3),
    np.ones(3),
    np.array([1, 1, 0.0]),
    np.array([0, -1, 1.0]),
    np.array([1e-9, 1, 0]),
]


@pytest.mark.parametrize("direction", [*DIRECTIONS, *np.random.default_rng(5).standard_normal((10, 3))])
def test_a_frame_is_right_handed_and_unit(direction):
    direction = direction / np.linalg.norm(direction)
    frame = np.empty((2, 3))
    fill_basis(direction, frame)
    whole = np.vstack([frame, direction])
    assert np.allclose(whole @ whole.T, np.eye(3), rtol=0, atol=1e-14)
    assert np.linalg.det(whole) > 0


# order statistics


@settings(max_examples=100, deadline=None)
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


@settings(max_examples=100, deadline=None)
@given(st.lists(st.floats(-1e6, 1e6), max_size=40), st.integers(0, 5))
def test_the_median_is_that_of_the_positive_ones(values, others):
    array = np.array(values + [1e9] * others, dtype=np.float64)
    before = array.copy()
    positive = [value for value in values if value > 0]
    found = median_of_positive(array, len(values), np.empty(len(array)))
    assert found == (np.median(positive) if positive else 0.0)
    assert np.array_equal(array, before)


# the cross product


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
    assert np.allclose(found, expected, rtol=0, atol=1e-14)


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
