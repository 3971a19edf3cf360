"""What the tiles have not accepted: what a cloud in one piece has not, too, and each thing by one tile."""

import numpy as np
import pytest

import cylx
from tests.support.tiled import outcome_of, pipe, plane, scene


@pytest.fixture(scope="module")
def points():
    """A pipe over two tiles, and a narrow strip of a wide bend, which is no pipe, in each of them."""
    rng = np.random.default_rng(4)
    strips = [pipe(rng, (x, 1.0, 0.0), (x + 1.0, 1.0, 0.0), 0.3, 1500, 0.5) for x in (0.3, 2.6)]
    return scene(rng, pipe(rng, (0, 0, 0), (4, 0.1, 0), 0.1, 3000), *strips, plane(rng, (0, -1, -1), (4, 2, -1), 3000))


def test_the_rejected_are_those_of_the_cloud_in_one_piece(points, tmp_path):
    whole = cylx.extract(points)
    with outcome_of(points, tmp_path, size=2.05, rejected=True) as outcome:
        rejected = outcome.extraction.rejected
    assert {one.reason for one in rejected} & {one.reason for one in whole.rejected}
    kinds = [type(value) for one in rejected for value in one.fit.evidence.values()]
    assert kinds
    assert set(kinds) == {float}
    trust = [one.fit.confidence or 0.0 for one in rejected]
    assert trust == sorted(trust, reverse=True)
    measured = [one for one in rejected if one.fit.evidence]
    twins = [
        (one, two)
        for i, one in enumerate(measured)
        for two in measured[:i]
        if np.allclose(one.fit.cylinder.point, two.fit.cylinder.point, atol=1e-9)
    ]
    assert twins == []


def test_they_are_not_kept_unless_somebody_asks(points, tmp_path):
    asked = [len(cylx.extract_tiled(points, tile=2.05, scratch=tmp_path, rejected=one).rejected) for one in (0, 1)]
    assert asked[0] == 0
    assert asked[1] > 0
