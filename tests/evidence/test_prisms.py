"""Beams, whose corners are too far off to be points of the cylinder in them."""

import numpy as np
import pytest

from cylx.evidence.measures import Shell
from cylx.evidence.prisms import prism_share
from tests.evidence.test_measures import RADIUS, SHAPES, SIGMA, shell


def beam(sides, sigma, seed=0, count=4000, turn=0.3):
    """Draw the residuals of a regular prism about the cylinder that fits its sides best, corners included."""
    rng = np.random.default_rng(seed)
    wide = 2 * np.pi / sides
    along = np.tan(0.5 * wide) * rng.uniform(-1, 1, count)  # a side at distance 1
    angles = turn + np.arctan(along) + wide * rng.integers(0, sides, count)
    distances = np.hypot(1.0, along) + sigma * rng.standard_normal(count)
    radius = float(np.median(distances))
    angles = (angles + np.pi) % (2 * np.pi) - np.pi
    on = np.abs(distances - radius) < 3 * sigma
    return Shell(np.arange(count), rng.uniform(-1, 1, count), distances - radius, angles, on, ~on, sigma), radius


@pytest.mark.parametrize("sides", [4, 5, 6, 8])
@pytest.mark.parametrize("share", [0.02, 0.15, 0.3])
def test_a_prism_explains_a_beam_whose_corners_the_surface_has_not(sides, share):
    # noise as a share of how far the corners stand out
    sigma = share * (1.0 / np.cos(np.pi / sides) - 1.0)
    seen, radius = beam(sides, sigma)
    assert prism_share(seen, radius, sigma) > 0.6


@pytest.mark.parametrize("name", SHAPES)
def test_a_prism_does_not_explain_what_is_round(name):
    assert prism_share(shell(SHAPES[name]), RADIUS, SIGMA) < 0.4
    assert prism_share(shell(), RADIUS, SIGMA) == 0.0
    none = np.empty(0)
    assert prism_share(Shell(none.astype(int), none, none, none, none > 0, none > 0, SIGMA), RADIUS, SIGMA) == 0.0


def test_the_share_of_a_prism_has_no_unit():
    seen, radius = beam(4, 0.08)
    large = Shell(seen.indices, seen.heights, 1e4 * seen.residuals, seen.angles, seen.on, seen.flat, 800.0)
    assert prism_share(large, 1e4 * radius, 800.0) == pytest.approx(prism_share(seen, radius, 0.08))


@pytest.mark.parametrize("sides", [4, 5])
@pytest.mark.parametrize("seed", range(3))
def test_few_points_on_each_side_do_not_hide_a_beam(sides, seed):
    # what points scatter about their neighbours holds the form of the sides, too, and is told as more than the noise
    sigma = 0.35 * (1.0 / np.cos(np.pi / sides) - 1.0)
    seen, radius = beam(sides, sigma, seed, count=900)
    assert prism_share(seen, radius, 1.5 * sigma) == 1.0


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("seed", range(3))
def test_a_rough_cylinder_is_no_beam(name, seed):
    rng = np.random.default_rng(seed)
    rough = shell(SHAPES[name])
    residuals = rough.residuals + 0.1 * RADIUS * rng.standard_normal(len(rough.residuals))
    seen = Shell(rough.indices, rough.heights, residuals, rough.angles, rough.on, rough.flat, 0.1 * RADIUS)
    assert prism_share(seen, RADIUS, 0.1 * RADIUS) < 0.4
