"""The mean shift of Tran et al.: groups of cylinders are modes."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from cylx.baselines.tran import shift_to_modes

seeds = st.integers(0, 2**32 - 1)

laws = settings(max_examples=30, deadline=None)


def group(rng, n, point, direction, radius):
    """Draw cylinders that scatter by a tenth of a bandwidth, directions either way."""
    points = np.array(point) + 0.005 * radius * rng.standard_normal((n, 3))
    directions = np.array(direction) + 0.005 * rng.standard_normal((n, 3))
    directions *= (rng.choice([-1.0, 1.0], n) / np.linalg.norm(directions, axis=1))[:, None]
    along = rng.uniform(-3, 3, (n, 1)) * directions  # an axis is the same wherever its point is
    return np.column_stack([points + 0.1 * along, directions, radius + 0.005 * radius * rng.standard_normal(n)])


@laws
@given(seeds)
def test_two_groups_of_cylinders_are_two_modes(seed):
    rng = np.random.default_rng(seed)
    upright, lying = group(rng, 30, (0, 0, 0), (0, 0, 1), 1.0), group(rng, 20, (4, 0, 0), (0, 1, 0), 2.0)
    models = np.concatenate([upright, lying])
    modes = shift_to_modes(models, np.radians(5), 0.1)
    assert [len(members) for _, members in modes] == [30, 20]
    assert [sorted(members) for _, members in modes] == [list(range(30)), list(range(30, 50))]
    for (mode, members), own, true in zip(
        modes, (upright, lying), (((0, 0, 0), (0, 0, 1), 1.0), ((4, 0, 0), (0, 1, 0), 2.0)), strict=True
    ):
        error = 0.005 / np.sqrt(len(members))
        assert abs(mode[6] - true[2]) < 5 * error * true[2]
        assert abs(mode[3:6] @ true[1]) > 1 - (5 * error) ** 2
        assert np.linalg.norm(np.cross(mode[:3] - true[0], true[1])) < 5 * error * (true[2] + 1)
        assert own[:, 6].min() <= mode[6] <= own[:, 6].max()


@laws
@given(seeds)
def test_the_signs_of_directions_do_not_matter(seed):
    rng = np.random.default_rng(seed)
    models = np.concatenate([group(rng, 12, (0, 0, 0), (0, 0, 1), 1.0), group(rng, 8, (0, 3, 0), (0, 0, 1), 1.0)])
    turned = models.copy()
    turned[:, 3:6] *= rng.choice([-1.0, 1.0], (20, 1))
    for (one, own), (other, others) in zip(
        shift_to_modes(models, 0.1, 0.1), shift_to_modes(turned, 0.1, 0.1), strict=True
    ):
        assert np.array_equal(own, others)
        assert np.allclose(one, other, rtol=0, atol=1e-9)


def test_modes_of_nothing_and_of_one():
    assert shift_to_modes(np.empty((0, 7)), 0.1, 0.1) == []
    ((mode, members),) = shift_to_modes(np.array([[1, 2, 3, 0, 0, -1, 4.0]]), 0.1, 0.1)
    assert members.tolist() == [0]
    assert np.allclose(mode, [1, 2, 3, 0, 0, 1, 4])
