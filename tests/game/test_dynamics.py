"""The game: payoffs only rise, both dynamics end in dominant sets, the diagonal decides whether there are clusters."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from cylx.game import SparsePayoff, evolve

seeds = st.integers(0, 2**32 - 1)
laws = settings(max_examples=40, deadline=None)
both = pytest.mark.parametrize("dynamics", ["replicator", "infection-immunization"])
PATIENT = {"replicator": (300000, 1e-13), "infection-immunization": (20000, 1e-9)}


def settle(payoff, dynamics, start=None):
    """Run one of the dynamics to its end."""
    steps, tolerance = PATIENT[dynamics]
    return evolve(payoff, dynamics=dynamics, max_iterations=steps, tolerance=tolerance, start=start)


def random_payoff(seed, n, *, density=1.0, diagonal=0.0):
    """Give a symmetric matrix with entries in [0, 1] and the same number all along the diagonal."""
    rng = np.random.default_rng(seed)
    payoff = np.triu(rng.random((n, n)) * (rng.random((n, n)) < density), 1)
    return payoff + payoff.T + diagonal * np.eye(n)


def camps(seed, sizes, *, within=(0.6, 1.0), between=(0.0, 0.2), diagonal=0.0):
    """Give the payoffs of groups that agree among themselves and hardly with others."""
    rng = np.random.default_rng(seed)
    owner = np.repeat(np.arange(len(sizes)), sizes)
    same = owner[:, None] == owner
    payoff = np.where(same, rng.uniform(*within, same.shape), rng.uniform(*between, same.shape))
    payoff = np.triu(payoff, 1)
    return payoff + payoff.T + diagonal * np.eye(len(owner)), owner


def regret(payoff, population):
    """Give how much anybody could gain, and how much of the population does worse than the mean."""
    fitness = payoff @ population
    mean = population @ fitness
    return (fitness - mean).max(), ((mean - fitness) * population).max()


@both
@laws
@given(seed=seeds, n=st.integers(2, 15), density=st.floats(0.2, 1.0), diagonal=st.sampled_from([0.0, 0.5, 1.0]))
def test_no_step_loses_payoff(dynamics, seed, n, density, diagonal):
    payoff = random_payoff(seed, n, density=density, diagonal=diagonal)
    population = np.random.default_rng(seed + 1).dirichlet(np.ones(n))
    last = population @ payoff @ population
    for _ in range(60):
        after = evolve(payoff, dynamics=dynamics, max_iterations=1, tolerance=1e-15, start=population)
        now = after @ payoff @ after
        assert now >= last - 1e-8  # what is nearly nothing becomes nothing
        if dynamics == "replicator":
            assert (after[population == 0] == 0).all()  # nobody comes back
        population, last = after, now


@laws
@given(seeds, st.integers(2, 10))
def test_a_step_of_the_replicators_is_equation_seven(seed, n):
    payoff = random_payoff(seed, n, diagonal=0.3)
    start = np.random.default_rng(seed).dirichlet(np.ones(n))
    expected = start * (payoff @ start) / (start @ payoff @ start)
    found = evolve(payoff, dynamics="replicator", max_iterations=1, tolerance=1e-15, start=start)
    assert np.allclose(found, expected, rtol=0, atol=1e-8)  # what is nearly nothing becomes nothing


@both
@laws
@given(seeds, st.integers(1, 15), st.floats(0, 1), st.integers(0, 30))
def test_a_population_is_one_at_every_step(dynamics, seed, n, density, steps):
    payoff = random_payoff(seed, n, density=density)
    population = evolve(payoff, dynamics=dynamics, max_iterations=max(steps, 1), tolerance=1e-12)
    assert (population >= 0).all()
    assert np.isclose(population.sum(), 1.0, rtol=1e-12)
    assert population @ payoff @ population >= payoff.mean() - 1e-12  # the uniform one, where it began


@both
@settings(max_examples=25, deadline=None)
@given(seed=seeds, n=st.integers(2, 12), density=st.floats(0.4, 1.0))
def test_the_end_is_a_state_nobody_gains_from_leaving(dynamics, seed, n, density):
    payoff = random_payoff(seed, n, density=density)
    population = settle(payoff, dynamics)
    gain, loss = regret(payoff, population)
    # where two strategies are nearly as good as each other, replicators need for ever
    assert gain < 1e-4
    assert loss < 1e-4


@both
@settings(max_examples=25, deadline=None)
@given(seed=seeds, n=st.integers(2, 12))
def test_members_of_the_end_exclude_nobody_among_them(dynamics, seed, n):
    # of two strategies of a stable state a_ii + a_jj < 2 a_ij, so with a zero diagonal a_ij > 0
    payoff = random_payoff(seed, n, density=0.6)
    assume(payoff.any())
    members = np.flatnonzero(settle(payoff, dynamics) > 1e-3)
    inside = payoff[np.ix_(members, members)]
    assert len(members) >= 2
    if dynamics == "infection-immunization":
        assert (inside[~np.eye(len(members), dtype=bool)] > 0).all()


@settings(max_examples=25, deadline=None)
@given(seeds, st.lists(st.integers(4, 7), max_size=3, unique=True))
def test_both_dynamics_end_in_the_same_state_where_one_camp_is_far_the_best(seed, sizes):
    # of camps nearly as good as each other either may win: there are several stable states
    payoff, _ = camps(seed, [*sizes, 12], within=(0.8, 1.0))
    slow, quick = (settle(payoff, dynamics) for dynamics in PATIENT)
    assert np.allclose(slow, quick, rtol=0, atol=2e-3)
    assert np.isclose(slow @ payoff @ slow, quick @ payoff @ quick, rtol=1e-6)


@both
@settings(max_examples=25, deadline=None)
@given(seed=seeds)
def test_with_a_zero_diagonal_the_largest_camp_wins(dynamics, seed):
    payoff, owner = camps(seed, [12, 5, 6], within=(0.8, 1.0))
    members = settle(payoff, dynamics) > 1e-6
    assert (owner[members] == 0).all()
    assert members.sum() >= 6


@both
@settings(max_examples=15, deadline=None)
@given(seed=seeds, start=st.booleans())
def test_with_a_unit_diagonal_one_strategy_is_left(dynamics, seed, start):
    payoff, owner = camps(seed, [10, 5], diagonal=1.0, within=(0.6, 0.95))
    # infection-immunization steps exactly onto the unstable balance of two, if nothing breaks their symmetry
    random = start or dynamics == "infection-immunization"
    first = np.random.default_rng(seed).dirichlet(np.ones(15)) if random else None
    population = settle(payoff, dynamics, first)
    assert np.sort(population)[-1] > 1 - 1e-6
    if not random:
        assert owner[population.argmax()] == 0


def crowd(diagonal, scale):
    """Give the payoffs of 40 candidates close together and 60 scattered ones, at a sharpness of the kernel."""
    rng = np.random.default_rng(8)
    places = np.vstack([0.05 * rng.standard_normal((40, 5)), rng.uniform(-1, 1, (60, 5)) * [3, 3, 1.5, 1.5, 1.5]])
    payoff = np.exp(-np.linalg.norm(places[:, None] - places, axis=2) / scale)
    np.fill_diagonal(payoff, diagonal)
    return payoff


@pytest.mark.parametrize("scale", [5.0, 0.5, 0.05])
def test_the_diagonal_decides_between_one_candidate_and_a_cluster(scale):
    cluster = settle(crowd(0.0, scale), "infection-immunization")
    assert cluster[:40].sum() > 0.999
    assert (cluster > 1e-3).sum() >= 3
    alone = settle(crowd(1.0, scale), "infection-immunization")
    assert (alone > 1e-3).sum() == 1
    assert alone[:40].sum() > 0.999


def test_with_a_unit_diagonal_the_answer_depends_on_when_one_stops():
    def sizes(diagonal):
        steps = (30, 300, 3000, 30000)
        payoff = crowd(diagonal, 5.0)
        ends = [evolve(payoff, dynamics="replicator", max_iterations=n, tolerance=1e-15) for n in steps]
        return [int((end > 1e-3).sum()) for end in ends]

    clusters, single = sizes(0.0), sizes(1.0)
    assert clusters[1] == clusters[2] == clusters[3] == 40
    assert 40 == single[0] > single[1] > single[2] >= single[3] == 1


@both
@settings(max_examples=20, deadline=None)
@given(seed=seeds, factor=st.floats(-3, 3).map(lambda exponent: 10.0**exponent))
def test_the_end_does_not_know_names_or_the_unit_of_payoff(dynamics, seed, factor):
    payoff, _ = camps(seed, [8, 5])
    order = np.random.default_rng(seed).permutation(13)
    one, other = settle(payoff, dynamics), settle(factor * payoff[np.ix_(order, order)], dynamics)
    assert np.allclose(other, one[order], rtol=0, atol=1e-3)


@both
def test_games_with_nothing_to_win_stay_as_they_are(dynamics):
    assert evolve(np.empty((0, 0)), dynamics=dynamics).shape == (0,)
    assert evolve(np.zeros((1, 1)), dynamics=dynamics).tolist() == [1.0]
    assert evolve(np.zeros((4, 4)), dynamics=dynamics).tolist() == [0.25] * 4


@both
def test_a_state_at_rest_stays_there(dynamics):
    payoff, _ = camps(1, [6, 3])
    rest = settle(payoff, dynamics)
    assert np.allclose(evolve(payoff, dynamics=dynamics, start=rest), rest, rtol=0, atol=1e-6)


@both
def test_the_payoff_and_the_start_are_left_as_they_were(dynamics):
    payoff, start = random_payoff(2, 6), np.full(6, 1 / 6)
    copies = payoff.copy(), start.copy()
    evolve(payoff, dynamics=dynamics, start=start)
    assert np.array_equal(payoff, copies[0])
    assert np.array_equal(start, copies[1])


def sparse(dense):
    rows, columns = np.nonzero(dense)
    pointers = np.concatenate(([0], np.cumsum(np.bincount(rows, minlength=len(dense)))))
    return SparsePayoff(pointers.astype(np.int64), columns.astype(np.int64), dense[rows, columns])


@laws
@given(seeds, st.integers(1, 30), st.floats(0, 1))
def test_a_sparse_payoff_is_the_dense_one(seed, n, density):
    dense = random_payoff(seed, n, density=density)
    payoff = sparse(dense)
    rng = np.random.default_rng(seed)
    assert np.allclose(payoff.degrees(), dense.sum(axis=1), rtol=1e-14)
    for _ in range(3):  # the scratch of one block is clean for the next
        nodes = rng.permutation(n)[: rng.integers(0, n + 1)].astype(np.int64)
        assert np.array_equal(payoff.block(nodes), dense[np.ix_(nodes, nodes)])
    for i in range(n):
        columns, values = payoff.row(i)
        assert np.array_equal(columns, np.flatnonzero(dense[i]))
        assert np.array_equal(values, dense[i, columns])


def local_game(seed, n, density):
    """Give a random sparse payoff, and the one of the best connected strategy and its neighbours in it."""
    whole = random_payoff(seed, n, density=density)
    payoff = sparse(whole)
    best = int(payoff.degrees().argmax())
    nodes = np.concatenate([[best], payoff.row(best)[0]])
    return whole, nodes, payoff.block(nodes)


def is_nash(payoff, population, tolerance):
    """Tell whether nobody could gain, and all who are left do as well as the mean."""
    fitness = payoff @ population
    mean = population @ fitness
    there = population > 0
    return (fitness <= mean + tolerance).all() and (
        np.abs(fitness - mean)[there] <= tolerance / population[there]
    ).all()


@settings(max_examples=25, deadline=None)
@given(seed=seeds, n=st.integers(5, 60), density=st.floats(0.1, 0.6))
def test_the_end_of_a_local_game_is_a_nash_equilibrium(seed, n, density):
    _, nodes, block = local_game(seed, n, density)
    assume(len(nodes) >= 2)
    population = settle(block, "infection-immunization")
    assert is_nash(block, population, 1e-6)
    # and as good as any pair, since the payoffs only rise and the best connected one has one
    assert population @ block @ population >= 0.5 * block.sum() / len(nodes) ** 2


@settings(max_examples=25, deadline=None)
@given(seed=seeds, n=st.integers(5, 40), density=st.floats(0.1, 0.6))
def test_the_end_of_a_local_game_is_stable_against_every_mutant(seed, n, density):
    _, nodes, block = local_game(seed, n, density)
    assume(len(nodes) >= 2)
    population = settle(block, "infection-immunization")
    members = np.flatnonzero(population > 1e-6)
    inside = block[np.ix_(members, members)]
    # a mutation among the members has shares of sum 0, and loses: the payoff is negative definite on those
    basis = np.linalg.svd(np.ones((1, len(members))))[2][1:]
    assert (np.linalg.eigvalsh(basis @ inside @ basis.T) < 1e-6).all()
    rng = np.random.default_rng(seed)
    mean = population @ block @ population
    for share in (1e-3, 1e-2):
        for mutant in (*np.eye(len(nodes)), *rng.dirichlet(np.full(len(nodes), 0.3), 10)):
            invaded = (1 - share) * population + share * mutant
            # the many do at least as well among the invaded as the mutant does
            assert (population - mutant) @ block @ invaded >= -1e-6
    assert mean > 0


@settings(max_examples=25, deadline=None)
@given(seed=seeds, n=st.integers(5, 40), density=st.floats(0.1, 0.6))
def test_the_replicators_go_to_a_strict_equilibrium_from_nearby_and_stay(seed, n, density):
    _, nodes, block = local_game(seed, n, density)
    assume(len(nodes) >= 2)
    population = settle(block, "infection-immunization")
    fitness, there = block @ population, population > 0
    mean = population @ fitness
    members = np.flatnonzero(there)
    basis = np.linalg.svd(np.ones((1, len(members))))[2][1:]
    curvature = np.linalg.eigvalsh(basis @ block[np.ix_(members, members)] @ basis.T)
    strict = (mean - fitness[~there] > 1e-2).all() and (curvature < -1e-2).all() and population[there].min() > 1e-2
    assume(strict)
    start = 0.99 * population + 0.01 / len(nodes)
    replicated = settle(block, "replicator", start)
    assert np.array_equal(replicated > 1e-6, there)
    assert np.allclose(replicated, population, rtol=0, atol=1e-4)


@pytest.mark.parametrize("seed", range(4))
def test_both_dynamics_of_a_local_game_of_one_camp_end_alike(seed):
    whole, owner = camps(seed, [9, 7, 5], within=(0.85, 1.0), between=(0.0, 0.0))
    payoff = sparse(whole)
    best = int(payoff.degrees().argmax())
    nodes = np.concatenate([[best], payoff.row(best)[0]])
    assert (owner[nodes] == owner[best]).all()
    one, other = (settle(payoff.block(nodes), dynamics) for dynamics in PATIENT)
    assert np.array_equal(one > 1e-3, other > 1e-3)
    assert np.allclose(one, other, rtol=0, atol=2e-3)
    # the game within the camp is the game of all, as long as they start there
    start = np.zeros(len(whole))
    start[nodes] = 1 / len(nodes)
    assert np.allclose(settle(whole, "replicator", start)[nodes], other, rtol=0, atol=2e-3)
