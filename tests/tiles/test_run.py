"""One result, wherever the borders of the tiles lie."""

import numpy as np
import pytest

import cylx
from cylx.config import Config, load_config
from cylx.errors import ConfigError, InputError, UsageError
from cylx.evaluation import Tolerances, compare, evaluate
from cylx.tiles.run import check_method, points_for
from tests.support.tiled import document, in_tiles, pipe, plane, scene, truth

EXACT = Tolerances(angle_deg=0.1, offset=0.02, radius=0.01, height=0.02, inliers=0.02)


def found_exactly(extraction, *cylinders):
    """Tell that these cylinders were found, from end to end, and nothing else."""
    found = compare(truth(*cylinders), document(extraction), tolerances=EXACT)
    return [one for one in found.differences if one.of == "cylinders"]


@pytest.fixture
def rng():
    return np.random.default_rng(0)


def test_a_pipe_over_five_tiles_is_one(rng, tmp_path):
    long = ((0, 0, 0), (5, 0.15, 0.1), 0.1)
    points = scene(rng, pipe(rng, *long, 3500), plane(rng, (0, -1, -0.5), (5, 1, -0.5), 1500))
    extraction, labels, residuals = in_tiles(points, tmp_path, size=1.0)
    assert extraction.tiling.count >= 5
    assert extraction.tiling.joined == 1
    assert found_exactly(extraction, long) == []
    (fit,) = extraction.cylinders
    assert fit.inliers == (labels == 0).sum() > 3350
    assert fit.rmse == pytest.approx(np.sqrt((residuals[labels == 0].astype(float) ** 2).mean()), rel=1e-4)
    assert np.isnan(residuals[labels < 0]).all()
    # a pipe five times as long is known as much better as all of its points say
    part = cylx.extract(points[points[:, 0] < 1.0]).cylinders[0]
    assert fit.angle_sd < 0.2 * part.angle_sd
    assert list(tmp_path.iterdir()) == []


def test_tiles_and_no_tiles_say_the_same(rng, tmp_path):
    pieces = [
        pipe(rng, (0, 1, 1), (6, 1.2, 1.1), 0.1, 3000),
        pipe(rng, (4, 0, 2), (4, 4, 2), 0.15, 3000, np.pi),
        pipe(rng, (2, 2, 0), (2, 2, 3), 0.2, 3000),
        pipe(rng, (5, 3, 0.5), (6, 3, 0.5), 0.08, 1000),
        plane(rng, (0, 0, 0), (6, 4, 0), 3000),
    ]
    points = scene(rng, *pieces)
    whole = cylx.extract(points)
    extraction, labels, _ = in_tiles(points, tmp_path, size=2.1)
    both = compare(cylx.to_dict(whole), document(extraction), tolerances=EXACT)
    assert [one for one in both.differences if one.what != "height"] == []
    assert ((labels >= 0) == (whole.labels >= 0)).mean() > 0.99
    sds = [
        [fit.radius_sd for fit in sorted(one.cylinders, key=lambda f: f.cylinder.radius)] for one in (whole, extraction)
    ]
    assert sds[0] == pytest.approx(sds[1], rel=0.1)


def test_a_pipe_along_a_border(rng, tmp_path):
    along = ((0, 2.0, 0), (6, 2.0, 0), 0.15)
    points = scene(rng, pipe(rng, *along, 3000), plane(rng, (0, 0, -0.6), (6, 4, -0.6), 2000))
    extraction, *_ = in_tiles(points, tmp_path, size=2.0)
    assert found_exactly(extraction, along) == []


def test_pipes_that_cross_on_a_corner(rng, tmp_path):
    first, second = ((0, 0, 0), (4, 4, 0), 0.1), ((0, 4, 0.25), (4, 0, 0.25), 0.12)
    floor = plane(rng, (0, 0, -0.6), (4, 4, -0.6), 4000)
    points = scene(rng, pipe(rng, *first, 5000), pipe(rng, *second, 5000), floor)
    extraction, *_ = in_tiles(points, tmp_path, size=2.1)  # from the corner of the cloud, at -0.1
    assert extraction.tiling.count == 4
    assert found_exactly(extraction, first, second) == []


def test_a_tank_larger_than_a_tile(rng, tmp_path):
    tank, thin = ((3, 3, 0), (3, 3, 4), 1.75), ((0, 0, 1), (5.5, 0, 1), 0.1)
    floor = plane(rng, (0, 0, 0), (5.5, 5.5, 0), 1500)
    points = scene(rng, pipe(rng, *tank, 5000), pipe(rng, *thin, 2000), floor)
    extraction, *_ = in_tiles(points, tmp_path, size=2.0)
    assert evaluate(truth(tank, thin), document(extraction)).f1 == 1.0
    assert found_exactly(extraction, tank, thin) == []


def test_one_of_all_tiles_is_empty_and_one_is_flat(rng, tmp_path):
    left, right = ((0, 0, 0), (0, 2, 0), 0.1), ((9, 0, 0), (9, 2, 0), 0.1)
    points = scene(rng, pipe(rng, *left, 4000), pipe(rng, *right, 4000), plane(rng, (4, 0, 0), (5, 2, 0), 3000))
    extraction, *_ = in_tiles(points, tmp_path, size=2.0)
    assert found_exactly(extraction, left, right) == []


def test_all_points_in_one_tile(rng, tmp_path):
    one = ((0, 0, 0), (1, 0, 0), 0.1)
    points = scene(rng, pipe(rng, *one, 3000))
    extraction, *_ = in_tiles(points, tmp_path, size=50.0)
    assert (extraction.tiling.count, extraction.tiling.joined) == (1, 0)
    assert found_exactly(extraction, one) == []


def test_strays_far_away(rng, tmp_path):
    long = ((0, 0, 0), (6, 0, 0), 0.1)
    strays = 1e6 * rng.standard_normal((20, 3))
    points = np.concatenate([scene(rng, pipe(rng, *long, 5000)), strays])
    extraction, labels, _ = in_tiles(points, tmp_path, size=2.0)
    assert extraction.tiling.count < 40
    assert found_exactly(extraction, long) == []
    assert (labels[-20:] == -1).all()


def test_the_number_of_points_cuts_where_they_are_dense(rng, tmp_path, monkeypatch):
    long, short = ((0, 0, 0), (4, 0, 0), 0.1), ((1.5, 0.8, 0), (2, 0.8, 0), 0.1)
    points = scene(rng, pipe(rng, *long, 1500), pipe(rng, *short, 1500))
    extraction, labels, _ = in_tiles(points, tmp_path, most=800, monkeypatch=monkeypatch)
    assert extraction.tiling.count >= 4
    assert extraction.tiling.most_points <= 800
    assert extraction.tiling.size is None
    assert found_exactly(extraction, long, short) == []
    again = in_tiles(points, tmp_path, most=800, monkeypatch=monkeypatch)
    assert document(again[0]) == document(extraction)
    assert (again[1] == labels).all()


def test_max_cylinders_is_that_of_the_whole(rng, tmp_path):
    long, other = ((0, 0, 0), (6, 0, 0), 0.1), ((0, 1, 0), (6, 1, 0), 0.1)
    points = scene(rng, pipe(rng, *long, 5000), pipe(rng, *other, 4000))
    extraction, labels, _ = in_tiles(points, tmp_path, size=2.0, config=Config(max_cylinders=1))
    assert len(extraction.cylinders) == 1
    assert set(labels) == {-1, 0}


def test_methods_that_cannot_be_joined_are_refused():
    with pytest.raises(ConfigError, match=r"^method: msac does not work in tiles; "):
        check_method(load_config(options={"method": "msac"}))
    with pytest.raises(ConfigError, match=r"^averaging: cylinders that are not fitted"):
        check_method(load_config(preset="paper"))


def test_too_little_memory_is_refused():
    with pytest.raises(UsageError, match=r"^memory: 0\.1 GB for a tile are too little; give at least"):
        points_for(1e8)
    assert points_for(1e12) == points_for(1e11)


def test_a_cloud_without_a_tile_to_search_is_refused(rng, tmp_path):
    with pytest.raises(InputError, match="on one plane"):
        in_tiles(rng.uniform(0, 1, (5000, 3)) * [4, 4, 0], tmp_path, size=1.0)
    assert list(tmp_path.iterdir()) == []
