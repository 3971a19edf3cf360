"""`cylx.extract_tiled`: files, several files, and pieces of any store give the same."""

import numpy as np
import pytest

import cylx
from tests.support.tiled import document, pipe, plane, scene


@pytest.fixture(scope="module")
def points():
    rng = np.random.default_rng(5)
    return scene(rng, pipe(rng, (0, 0, 0), (4, 0, 0), 0.1, 3500), plane(rng, (0, -1, -0.5), (4, 1, -0.5), 2000))


def test_pieces_and_files_give_the_same(points, tmp_path):
    pieces = (points[i : i + 999] for i in range(0, len(points), 999))
    found = cylx.extract_tiled(pieces, tile=2.0, labels=tmp_path / "labels.npy", scratch=tmp_path)
    labels = np.load(tmp_path / "labels.npy")
    assert (labels["cylinder_id"] == 0).sum() == found.cylinders[0].inliers > 3200
    assert np.isnan(labels["residual"][labels["cylinder_id"] < 0]).all()
    assert repr(found) == f"1 cylinder in 5500 points in {found.tiling.count} tiles"
    assert found.to_arrays()["radii"] == pytest.approx([0.1], abs=1e-3)
    for name, part in (("a", points[:2000]), ("b", points[2000:])):
        np.save(tmp_path / f"{name}.npy", part)
    both = cylx.extract_tiled([tmp_path / "a.npy", tmp_path / "b.npy"], tile=2.0, scratch=tmp_path)
    one, other = document(found), document(both)
    assert one["cylinders"] == other["cylinders"]
    assert [held["points"] for held in other["input"]["files"]] == [2000, 3500]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.npy", "b.npy", "labels.npy"]


def test_a_part_of_it(points, tmp_path):
    np.save(tmp_path / "a.npy", points)
    found = cylx.extract_tiled(tmp_path / "a.npy", crop=((None, None, -0.2), (2.0, None, None)), tile=3.0)
    assert found.bounds[1, 0] <= 2.0
    assert found.cylinders[0].cylinder.height == pytest.approx(2.0, abs=0.05)
