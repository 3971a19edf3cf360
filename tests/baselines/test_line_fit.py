"""The line through the centres of the ellipses."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cylx.baselines.line_fit import fit_line_of_centres
from cylx.config import LineFitConfig
from cylx.geometry.ellipse import Ellipse
from cylx.geometry.plane import Plane
from cylx.records import EllipseFit
from tests.support.drawn import random_model

seeds = st.integers(0, 2**32 - 1)

laws = settings(max_examples=30, deadline=None)


def test_a_line_needs_two_centres():
    assert fit_line_of_centres([], None, LineFitConfig()) == []
    assert fit_line_of_centres([[], []], None, LineFitConfig()) == []


@laws
@given(seeds)
def test_the_line_goes_through_the_centres_of_the_best_ellipses(seed):
    rng = np.random.default_rng(seed)
    point, direction, _, _ = random_model(rng)
    heights = rng.uniform(-5, 5, 12)
    slices = []
    for k, height in enumerate(heights):
        normal = rng.standard_normal(3)
        plane = Plane(point + rng.standard_normal(3), normal / np.linalg.norm(normal))
        # put the centre on the axis, into a plane through it
        plane = Plane(
            plane.point + ((point + height * direction - plane.point) @ plane.normal) * plane.normal, plane.normal
        )
        center = plane.project(point + height * direction)
        best = EllipseFit(Ellipse(center, 20.0, 1.0 + k, 0.3), plane, 50)
        slices.append([EllipseFit(Ellipse(center + 5, 3.0, 2.0, 0.0), plane, 49), best] if k % 2 else [best])
    (found,) = fit_line_of_centres([*slices, []], None, LineFitConfig(refine=False))
    model = found.segment.model
    assert found.support == 12
    assert model[6] == pytest.approx(1 + 5.5)  # the mean of 1 to 12
    assert np.linalg.norm(np.cross(model[:3] - point, direction)) < 1e-9
    assert abs(model[3:6] @ direction) == pytest.approx(1.0, abs=1e-12)
    assert np.isclose(found.segment.half, 0.5 * np.ptp(heights))
    assert np.allclose(model[:3], point + 0.5 * (heights.min() + heights.max()) * direction)
