"""The part of a short cylinder's height over which its wall is level."""

import numpy as np
import pytest

from cylx.stages.level_part import level_run

SIGMA, RADIUS = 0.2, 20.0


def wall(profile, half, seed=0, per_spacing=125):
    """Draw heights and residuals of a wall whose distance from the cylinder is a function of the height."""
    rng = np.random.default_rng(seed)
    heights = half * rng.uniform(-1.0, 1.0, round(2 * half * per_spacing))
    return heights, profile(heights) + SIGMA * rng.standard_normal(len(heights))


def rounded(begins, radius):
    """Give the profile of a wall that goes on into a round at its upper end."""

    def profile(heights):
        beyond = np.clip(heights - begins, 0.0, 0.99 * radius)
        return np.sqrt(radius**2 - beyond**2) - radius

    return profile


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("begins", [0.0, 1.5])
def test_it_ends_where_a_round_begins(seed, begins):
    found = level_run(*wall(rounded(begins, 6.0), 5.0, seed), 5.0, SIGMA)
    assert found is not None
    assert found[0] == pytest.approx(-5.0, abs=1.01)
    assert found[1] == pytest.approx(begins, abs=1.6)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize(
    "profile",
    [
        np.zeros_like,  # all of it is level
        lambda heights: 0.3 * heights,  # a cone has no level part
        lambda heights: np.sqrt(RADIUS**2 - heights**2) - RADIUS,  # the band of a ball
    ],
    ids=["cylinder", "cone", "ball"],
)
def test_what_is_level_cone_or_ball_has_no_part(profile, seed):
    assert level_run(*wall(profile, 5.0, seed), 5.0, SIGMA) is None


def test_a_few_points_or_slices_say_nothing():
    heights, residuals = wall(rounded(0.0, 6.0), 5.0)
    assert level_run(heights[:10], residuals[:10], 5.0, SIGMA) is None
    assert level_run(heights[:0], residuals[:0], 5.0, SIGMA) is None
    assert level_run(0.2 * heights, residuals, 1.0, SIGMA) is None


def test_it_has_no_unit_in_the_residuals():
    heights, residuals = wall(rounded(0.0, 6.0), 5.0)
    assert level_run(heights, 1e-3 * residuals, 5.0, 1e-3 * SIGMA) == level_run(heights, residuals, 5.0, SIGMA)
