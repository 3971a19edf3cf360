"""Clusters of two walls: the windows of one of them stay, and those of the other go back."""

import numpy as np
import pytest

from cylx.config import AveragingConfig, Config
from cylx.geometry.cells import Cells
from cylx.records import Candidates, Cluster, IndexedCloud, Noise
from cylx.scene import make_frame
from cylx.stages.averaging import average_cluster
from cylx.stages.consensus import of_one_place, of_one_surface

SIGMA = 0.001
"""Noise; the radius is 1."""


def cluster_of(radii, seed=0, scatter=0.03, sigma=SIGMA):
    """Give candidates of windows laid on a surface of these radii, and the cloud; they scatter more than points."""
    rng = np.random.default_rng(seed)
    count = len(radii)
    turn = rng.uniform(-np.pi, np.pi, count)
    places = np.column_stack([radii * np.cos(turn), radii * np.sin(turn), rng.uniform(-3, 3, count)])
    frame, _ = make_frame(np.concatenate([places, 3 * rng.standard_normal((500, 3))]), Config())
    noise = Noise(np.ones(1), np.array([sigma / frame.spacing]))
    indexed = IndexedCloud(Cells(frame.points, frame.codes), np.zeros(len(frame.points)), noise)
    rows = np.zeros((count, 9))
    rows[:, :3] = [0.0, 0.0, 1.0] * places
    rows[:, :2] += 0.3 * scatter * rng.standard_normal((count, 2))
    rows[:, 5] = 1.0
    rows[:, 6] = radii * (1 + scatter * rng.standard_normal(count))
    # a few see the wall as it is
    rows[: count // 8, :2], rows[: count // 8, 6] = 0.0, radii[: count // 8]
    rows[:, :3] = (rows[:, :3] - frame.origin) / frame.spacing
    rows[:, 6] /= frame.spacing
    rows[:, 7], rows[:, 8] = 50, 1.0 / frame.spacing
    candidates = Candidates.of_windows(rows, 1.0 / frame.spacing, (places - frame.origin) / frame.spacing)
    return candidates, indexed


def split(candidates, indexed):
    weights = np.full(len(candidates), 1 / len(candidates))
    weights[: len(candidates) // 8] *= 2.0  # the best ones agree with most
    cluster = Cluster(np.arange(len(candidates)), weights / weights.sum(), 0.8)
    average = average_cluster(candidates, cluster, AveragingConfig())
    return of_one_surface(candidates, cluster, average, indexed)


def mixed(outer, inner, apart, seed):
    """Give the radii of windows on two walls, in random order."""
    return np.random.default_rng(seed).permutation(np.repeat([1.0, 1.0 - apart], [outer, inner]))


@pytest.mark.parametrize("apart", [0.05, 0.08])
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("outer", "inner"), [(60, 60), (60, 40)])
def test_a_cluster_of_two_walls_is_split(apart, seed, outer, inner):
    radii = mixed(outer, inner, apart, seed)
    one, others = split(*cluster_of(radii, seed))
    assert len(np.unique(radii[one.members])) == 1
    assert len(np.unique(radii[others])) == 1
    assert radii[one.members][0] != radii[others][0]
    assert sorted([*one.members, *others]) == list(range(len(radii)))
    assert one.weights.sum() == pytest.approx(1.0)
    assert one.payoff == 0.8


@pytest.mark.parametrize("seed", range(3))
def test_a_cluster_of_one_wall_stays_whole(seed):
    assert split(*cluster_of(np.ones(100), seed)) is None


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("rough", [0.02, 0.05])
def test_a_rough_surface_stays_whole(seed, rough):
    radii = 1 + rough * np.random.default_rng(seed).standard_normal(100)
    assert split(*cluster_of(radii, seed)) is None


@pytest.mark.parametrize("seed", range(3))
def test_a_surface_that_is_rough_in_part_stays_whole(seed):
    rng = np.random.default_rng(seed)
    radii = rng.permutation(np.concatenate([np.full(54, 1.0), rng.uniform(1.01, 1.08, 66)]))
    radii[:15] = 1.0
    assert split(*cluster_of(radii, seed)) is None


def test_a_few_windows_are_not_split():
    assert split(*cluster_of(mixed(3, 2, 0.05, 0))) is None


def test_candidates_without_places_are_not_split():
    candidates, indexed = cluster_of(mixed(60, 60, 0.05, 0))
    bare = Candidates(
        candidates.models, candidates.parents, candidates.extents, candidates.inliers, np.ones(len(candidates))
    )
    assert np.isnan(bare.places).all()
    assert split(bare, indexed) is None


def along_axis(heights, extent=0.2, radius=1.0):
    """Give candidates about one axis at these heights, and what becomes of their cluster."""
    rows = np.zeros((len(heights), 9))
    rows[:, 2], rows[:, 5], rows[:, 6], rows[:, 7], rows[:, 8] = heights, 1.0, radius, 50, extent
    candidates = Candidates.of_windows(rows, 0.5 * radius, rows[:, :3] + [radius, 0.0, 0.0])
    cluster = Cluster(np.arange(len(heights)), np.full(len(heights), 1 / len(heights)), 0.8)
    return of_one_place(candidates, cluster, average_cluster(candidates, cluster, AveragingConfig()))


@pytest.mark.parametrize("gap", [2.0, 5.0, 50.0])
def test_two_discs_far_apart_on_one_axis_are_two_places(gap):
    rng = np.random.default_rng(0)
    heights = np.concatenate([0.1 * rng.random(9), gap + 0.1 * rng.random(6)])
    order = rng.permutation(15)
    one, others = along_axis(heights[order])
    assert sorted(order[one.members]) == list(range(9))
    assert sorted(order[others]) == list(range(9, 15))
    assert one.weights.sum() == pytest.approx(1.0)


@pytest.mark.parametrize(
    "heights",
    [np.linspace(0, 50, 40), [*np.linspace(0, 3, 9), *np.linspace(6, 9, 9)], [0.0, 0.1, 40.0, 40.1], [0.0] * 20],
    ids=["all along", "long pieces", "too few", "one place"],
)
def test_a_pipe_is_in_one_place(heights):
    assert along_axis(np.array(heights)) is None
