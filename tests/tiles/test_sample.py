"""What a page shows of a cloud in tiles: all points of a small cloud, some of a large one, each with its label."""

import numpy as np
import pytest

from cylx.tiles import sample
from cylx.tiles.sample import sampled
from tests.support.tiled import outcome_of, pipe, plane, scene

LONG, SHORT = ((0, 0, 0), (6, 0.2, 0), 0.1), ((1, 0.9, 0.3), (1.6, 0.9, 0.3), 0.08)


@pytest.fixture(scope="module")
def points():
    rng = np.random.default_rng(3)
    return scene(rng, pipe(rng, *LONG, 4500), pipe(rng, *SHORT, 500), plane(rng, (0, -1, -0.5), (6, 1, -0.5), 2500))


@pytest.fixture
def outcome(points, tmp_path):
    with outcome_of(points, tmp_path, size=2.0) as made:
        yield made


def test_a_small_cloud_is_shown_whole_in_the_order_of_its_rows(points, outcome):
    some = sampled(outcome.extraction, outcome.labels)
    ids, residuals = (np.concatenate(one) for one in zip(*outcome.labels.pieces(0, len(points), 1000), strict=True))
    assert (some.cloud.points == points).all()
    assert (some.labels == ids).all()
    assert np.array_equal(some.residuals, residuals, equal_nan=True)
    assert some.scene.spacing == outcome.extraction.scene.spacing
    assert outcome.labels.points == len(points)


def test_of_a_large_one_are_shown_some_and_more_of_small_cylinders(points, outcome, monkeypatch):
    monkeypatch.setattr(sample, "MOST_POINTS", 1000)
    monkeypatch.setattr(sample, "LEAST_OF_EACH", 300)
    some = sampled(outcome.extraction, outcome.labels)
    of_all, of_some = (np.bincount(one + 1) for one in (_labels(outcome, len(points)), some.labels))
    assert of_all[1:].min() < 600 < of_all[1:].max()  # the short one is shown better than its share
    assert of_some[0] == pytest.approx(of_all[0] / 8, rel=0.3)
    for whole, shown in zip(of_all[1:], of_some[1:], strict=True):
        assert 0.7 * 150 < shown < 1.3 * max(300, whole / 8)
    assert some.scene.spacing == pytest.approx(
        outcome.extraction.scene.spacing * np.sqrt(len(points) / len(some.labels)), rel=1e-9
    )
    rows = [int(np.flatnonzero((points == one).all(axis=1))[0]) for one in some.cloud.points]
    assert rows == sorted(rows)


def _labels(outcome, count):
    return next(iter(outcome.labels.pieces(0, count, count)))[0]
