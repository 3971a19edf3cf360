"""One point of each voxel, chosen piece by piece and share by share, is that of the cloud as a whole."""

import numpy as np
import pytest

from cylx.errors import InputError
from cylx.io import open_scratch, stream_arrays
from cylx.records import PointCloud, Selection, SilentObserver
from cylx.scene import select
from cylx.tiles import thinning
from tests.support.tiled import document, outcome_of, pipe, plane, scene


@pytest.fixture
def rng():
    return np.random.default_rng(3)


def used(pieces, selection, folder, *, resume=False):
    """Give which rows are used of a cloud in pieces, and the names of what is left in the scratch folder."""
    rows = sum(map(len, pieces))
    with open_scratch(folder, "result", {}, resume=resume) as scratch:
        clouds = [stream_arrays([piece], scratch.path(f"spool-{i}")) for i, piece in enumerate(pieces)]
        kept = thinning.thin(clouds, selection, scratch, SilentObserver())
        names = {path.name for path in scratch.folder.iterdir() if "voxel" in path.name}
        return kept(0, rows), kept(5, 3), names


@pytest.mark.parametrize("side", [0.02, 0.3, 100.0])
def test_the_points_are_those_of_the_whole(rng, tmp_path, monkeypatch, side):
    monkeypatch.setattr(thinning, "A_SHARE", 700)
    monkeypatch.setattr(thinning, "A_RANGE", 900)
    monkeypatch.setattr(thinning, "FLUSHED", 400)
    # many lie on the same places, and as far from the middle of a voxel as others
    points = np.concatenate([np.round(rng.uniform(-1, 1, (3000, 3)), 2), rng.uniform(-1, 1, (1000, 3))])
    points = np.concatenate([points, points[:500]])[rng.permutation(4500)]
    points[17] = np.nan
    selection = Selection(voxel=side, crop=((-0.5, None, None), (None, None, None)))
    pieces = np.split(points, [1000, 1001, 3100])
    marks, some, names = used(pieces, selection, tmp_path)
    expected = np.zeros(len(points), np.bool_)
    whole = select(PointCloud.from_array(points), selection)
    expected[np.flatnonzero(whole.valid)] = True
    assert 0 < expected.sum() < 4000
    assert (marks == expected).all()
    assert (some == expected[5:8]).all()
    assert names == set()


def test_what_was_left_by_a_killed_run_does_not_count(rng, tmp_path):
    points = rng.uniform(0, 1, (2000, 3))
    first, *_ = used([points], Selection(voxel=0.2), tmp_path)
    killed = open_scratch(tmp_path, "result", {}, resume=True)
    scratch = killed.__enter__()
    for name in (thinning.THINNED, "voxel-points-0", "voxel-rows-0", "voxel-range-0"):
        scratch.append(name, np.zeros(24, np.int64))
    killed.__exit__(RuntimeError, RuntimeError(), None)
    again, *_ = used([points], Selection(voxel=0.2), tmp_path, resume=True)
    assert (again == first).all()


def test_voxels_too_small_for_the_coordinates_are_refused(tmp_path):
    with pytest.raises(InputError, match="voxels of 1e-20 are too small"):
        used([np.ones((10, 3))], Selection(voxel=1e-20), tmp_path)


def test_a_thinned_cloud_in_tiles_is_that_of_its_points(rng, tmp_path):
    pieces = pipe(rng, (0, 0, 0), (5, 0.15, 0.1), 0.1, 9000), plane(rng, (0, -1, -0.5), (5, 1, -0.5), 4000)
    points = scene(rng, *pieces)
    selection = Selection(voxel=0.03)
    with outcome_of(points, tmp_path, size=2.0, selection=selection) as outcome:
        thinned = document(outcome.extraction)
        (labels, _), *_ = outcome.labels.pieces(0, len(points), len(points))
    marks = select(PointCloud.from_array(points), selection).valid
    with outcome_of(points[marks], tmp_path, size=2.0) as outcome:
        alone = document(outcome.extraction)
    assert thinned["cylinders"] == alone["cylinders"]
    assert thinned["input"]["voxel"] == 0.03
    assert (labels[~marks] == -1).all()
    assert (labels >= 0).sum() == alone["cylinders"][0]["inliers"]
