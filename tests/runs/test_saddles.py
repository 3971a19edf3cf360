"""What points say of a branch on its main."""

import pytest

from tests.support.pipework import NOISE, Pipework, of_kind

R = 0.05


def test_a_tee_is_told_by_the_points_about_its_saddle():
    work = Pipework()
    work.pipe([-1, 0, 0], [1, 0, 0], R)
    work.pipe([0, R, 0], [0, 1, 0], 0.03)
    (tee,) = of_kind(work.traced(), "tee")
    assert tee.inliers > 25
    assert tee.rms == pytest.approx(NOISE, rel=0.3)
    assert tee.coverage > 0.6
    assert tee.confidence > 0.8
