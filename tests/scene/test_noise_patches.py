"""Noise of patches: the mode of what they say."""

import numpy as np

from cylx.scene.noise_patches import half_sample_mode


def test_the_mode_is_where_most_values_are():
    rng = np.random.default_rng(2)
    values = np.concatenate([np.exp(0.05 * rng.standard_normal(600)), rng.uniform(1.5, 8, 900)])
    assert np.isclose(half_sample_mode(values), 1.0, rtol=0.06)
    assert np.isclose(half_sample_mode(1e6 * values), 1e6 * half_sample_mode(values), rtol=1e-9)
    assert np.isclose(half_sample_mode(rng.permutation(values)), half_sample_mode(values), rtol=1e-12)
    assert np.isclose(half_sample_mode(np.array([3.0])), 3.0)
    assert np.isclose(half_sample_mode(np.full(7, 3.0)), 3.0)
