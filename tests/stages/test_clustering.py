"""Clusters: candidates of one cylinder come together, nobody comes twice, and what agrees with nobody is left."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cylx.config import ClusteringConfig, load_config
from cylx.game.agreement import Neighbourhood
from cylx.records import Candidates, Segment
from cylx.stages.clustering import CandidateGame, thin_candidates

seeds = st.integers(0, 2**32 - 1)
PAPER = load_config(preset="paper").clustering
AXES = np.array([[0, 0, 0, 0, 0, 1, 1], [12, 0, 0, 0, 1, 0, 2], [0, 15, 0, 0.6, 0, 0.8, 0.5]], dtype=float)
GROUPS = (30, 20, 10)


def make(models, parents=None, extents=0.0, inliers=30):
    count = len(models)
    return Candidates(
        np.asarray(models, dtype=float),
        np.arange(count) if parents is None else np.asarray(parents),
        np.full(count, extents),
        np.broadcast_to(np.asarray(inliers), count).copy(),
        np.ones(count),
    )


def scattered(rng, count):
    """Give candidates that agree with nobody."""
    directions = rng.standard_normal((count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return np.column_stack([rng.uniform(-20, 20, (count, 3)), directions, rng.uniform(0.3, 3, count)])


def crowd(seed, strays=60, noise=0.01):
    """Give candidates of three cylinders and strays in random order, and whose each is (-1: a stray)."""
    rng = np.random.default_rng(seed)
    owner = np.repeat([0, 1, 2], GROUPS)
    models = AXES[owner]
    models[:, :3] += rng.uniform(-2, 2, (len(owner), 1)) * models[:, 3:6] * models[:, 6:]
    models[:, :3] += noise * models[:, 6:] * rng.standard_normal((len(owner), 3))
    models[:, 3:6] += noise * rng.standard_normal((len(owner), 3))
    models[:, 3:6] *= rng.choice([-1, 1], (len(owner), 1)) / np.linalg.norm(models[:, 3:6], axis=1, keepdims=True)
    models[:, 6] *= 1 + noise * rng.standard_normal(len(owner))
    models = np.concatenate([models, scattered(rng, strays)])
    owner = np.concatenate([owner, np.full(strays, -1)])
    order = rng.permutation(len(owner))
    return make(models[order]), owner[order]


def play(candidates, config):
    game, clusters = CandidateGame(candidates, config), []
    while (cluster := game.next_cluster()) is not None:
        clusters.append(cluster)
        assert len(clusters) <= len(candidates)
    return clusters, game


@settings(max_examples=15, deadline=None)
@given(seeds)
def test_candidates_of_one_cylinder_come_together(seed):
    candidates, owner = crowd(seed)
    clusters, _ = play(candidates, ClusteringConfig())
    assert all(len(set(owner[cluster.members])) == 1 for cluster in clusters)
    largest = {}
    for cluster in clusters:
        name = int(owner[cluster.members[0]])
        largest[name] = max(largest.get(name, 0), len(cluster.members))
    assert set(largest) >= {0, 1, 2}
    assert all(largest[name] > 0.6 * GROUPS[name] for name in (0, 1, 2))
    assert largest.get(-1, 0) <= 3


@pytest.mark.parametrize(
    "config",
    [
        ClusteringConfig(),
        ClusteringConfig(dynamics="replicator"),
        ClusteringConfig(population="whole"),
        PAPER,
        PAPER.model_copy(update={"diagonal": 0.0}),
        PAPER.model_copy(update={"diagonal": 0.0, "dynamics": "infection-immunization"}),
    ],
    ids=["auto", "replicator", "whole", "paper", "paper with zero diagonal", "and quick"],
)
def test_nobody_comes_twice_and_shares_add_up(config):
    candidates, _ = crowd(1)
    clusters, game = play(candidates, config)
    assert clusters
    members = np.concatenate([cluster.members for cluster in clusters])
    assert len(np.unique(members)) == len(members)
    for cluster in clusters:
        assert len(cluster.members) == len(cluster.weights) >= config.min_support
        assert np.isclose(cluster.weights.sum(), 1.0)
        assert (cluster.weights > 0).all()
        assert config.min_payoff <= cluster.payoff <= 1.0
    report = game.report()
    assert (report.name, report.considered, report.kept) == ("clustering", len(candidates), len(clusters))
    assert game.next_cluster() is None


def test_the_paper_takes_one_cylinder_after_the_other():
    candidates, owner = crowd(2, strays=0)
    clusters, _ = play(candidates, PAPER)
    firsts = [set(owner[cluster.members]) for cluster in clusters[:3]]
    assert sorted(map(tuple, firsts)) == [(0,), (1,), (2,)]


def test_those_withdrawn_do_not_come_back():
    candidates, owner = crowd(3)
    game = CandidateGame(candidates, ClusteringConfig())
    game.withdraw(np.flatnonzero(owner == 0))
    game.withdraw(np.flatnonzero(owner == 0))  # once is enough
    clusters = []
    while (cluster := game.next_cluster()) is not None:
        clusters.append(set(owner[cluster.members]))
    assert {0} not in clusters
    assert {1} in clusters


def test_candidates_of_one_slice_make_no_cluster():
    models = np.repeat(AXES[:1], 12, axis=0)
    for config in (ClusteringConfig(), PAPER.model_copy(update={"min_support": 2})):
        assert len(play(make(models), config)[0]) == 1
        assert play(make(models, np.zeros(12, int)), config)[0] == []


@pytest.mark.parametrize("config", [ClusteringConfig(), PAPER], ids=["auto", "paper"])
def test_no_candidates_are_no_clusters(config):
    assert play(make(np.empty((0, 7))), config)[0] == []


@pytest.mark.parametrize("strict", [{"min_support": 100}, {"min_payoff": 0.999}])
def test_small_and_loose_clusters_are_dropped_and_counted(strict):
    candidates, _ = crowd(4)
    clusters, game = play(candidates, ClusteringConfig(**strict))
    assert clusters == []
    assert sum(game.report().rejected.values()) > 0


def test_a_cylinder_explains_the_candidates_that_say_so():
    candidates, owner = crowd(5)
    game = CandidateGame(candidates, ClusteringConfig())
    segment = Segment(AXES[0].copy(), 2.0, 0.01)
    assert set(np.flatnonzero(owner == 0)) <= set(game.explained_by(segment))
    assert not set(game.explained_by(segment)) & set(np.flatnonzero((owner == 1) | (owner == 2)))
    assert set(game.explained_by(segment, closely=True)) <= set(game.explained_by(segment))
    far = Segment(AXES[0] + [0, 0, 50, 0, 0, 0, 0], 2.0, 0.01)
    assert not set(game.explained_by(far)) & set(np.flatnonzero(owner == 0))
    game.withdraw(np.flatnonzero(owner == 0))
    assert not set(game.explained_by(segment)) & set(np.flatnonzero(owner == 0))


def test_agreement_counts_the_windows_inside_a_cylinder():
    candidates, owner = crowd(6, strays=0)
    segment = Segment(AXES[0].copy(), 2.0, 0.01)
    assert Neighbourhood(candidates).agreement(segment) == (30, 30)
    turned = candidates.models.copy()
    turned[np.flatnonzero(owner == 0)[:12], 6] *= 1.12
    assert Neighbourhood(make(turned)).agreement(segment) == (18, 30)
    assert Neighbourhood(make(np.empty((0, 7)))).agreement(segment) == (0, 0)


@settings(max_examples=20, deadline=None)
@given(seeds, st.integers(1, 5))
def test_thinning_keeps_the_best_supported_of_those_that_say_the_same(seed, most):
    rng = np.random.default_rng(seed)
    models = np.repeat([AXES[0] + 0.3, AXES[1] + [0.2, 0.3, 0.3, 0, 0, 0, 0]], 20, axis=0)
    models[:, 3:6] /= np.linalg.norm(models[:, 3:6], axis=1, keepdims=True)
    inliers = rng.permutation(40) + 10
    thinned = thin_candidates(make(models, inliers=inliers), most)
    expected = np.concatenate([np.sort(part)[::-1][:most] for part in (inliers[:20], inliers[20:])])
    assert sorted(thinned.inliers) == sorted(expected)
    again = thin_candidates(thinned, most)
    assert np.array_equal(again.models, thinned.models)


def test_thinning_leaves_different_candidates_alone():
    candidates = make(scattered(np.random.default_rng(7), 200))
    assert len(thin_candidates(candidates)) == 200
    assert np.array_equal(thin_candidates(candidates).models, candidates.models)
    assert len(thin_candidates(make(np.empty((0, 7))))) == 0


def test_those_restored_come_again_but_once():
    candidates, owner = crowd(5)
    game = CandidateGame(candidates, ClusteringConfig())
    first = game.next_cluster()
    game.restore(first.members)
    again = game.next_cluster()
    assert sorted(again.members) == sorted(first.members)
    assert again.weights[np.argsort(again.members)] == pytest.approx(first.weights[np.argsort(first.members)])
    game.restore(first.members)  # once is enough
    rest = []
    while (cluster := game.next_cluster()) is not None:
        rest.append(cluster)
    assert not np.isin(np.concatenate([each.members for each in rest]), first.members).any()
    assert {owner[each.members[0]] for each in rest} == {0, 1, 2} - {owner[first.members[0]]}


def test_restoring_those_who_never_left_changes_nothing():
    candidates, _ = crowd(6)
    one, other = (CandidateGame(candidates, ClusteringConfig()) for _ in range(2))
    other.restore(np.arange(len(candidates)))
    while (cluster := one.next_cluster()) is not None:
        same = other.next_cluster()
        assert np.array_equal(cluster.members, same.members)
        assert np.array_equal(cluster.weights, same.weights)
    assert other.next_cluster() is None
