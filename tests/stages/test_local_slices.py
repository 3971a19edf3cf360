"""Slices through windows: they see thin, sparse pipes, and look only at what nobody has explained."""

import numpy as np
import pytest

import cylx
from cylx.config import Config
from cylx.records import Explained
from cylx.scene import make_frame, radius_range, resolve
from cylx.stages.local_slices import slice_windows

PLANE = 6000
SIDE = np.sqrt(PLANE)  # so that the spacing is 1
LENGTH = 60.0
PIPES = [(0.8, 150), (0.8, 360), (1.0, 200), (1.0, 360), (1.2, 150), (1.2, 360)]
pipes = pytest.mark.parametrize(("radius", "theta_deg"), PIPES)


def thin_pipe(seed, radius, theta_deg, noise=0.08):
    """Give points of a large plane and of a pipe above it, as dense; and the pipe's model. The plane comes first."""
    rng = np.random.default_rng(seed)
    plane = np.column_stack([SIDE * rng.random((PLANE, 2)), np.zeros(PLANE)])
    direction = rng.standard_normal(3) * [1, 1, 0.3]
    direction /= np.linalg.norm(direction)
    first, second, _ = np.linalg.svd(direction[None])[2][[1, 2, 0]]
    n = int(np.radians(theta_deg) * radius * LENGTH)
    angles = rng.uniform(0, 2 * np.pi) + np.radians(theta_deg) * rng.random(n)
    middle = np.array([SIDE / 2, SIDE / 2, 25.0])
    pipe = middle + LENGTH * (rng.random((n, 1)) - 0.5) * direction
    pipe = pipe + radius * (np.cos(angles)[:, None] * first + np.sin(angles)[:, None] * second)
    points = np.concatenate([plane, pipe]) + noise * rng.standard_normal((PLANE + n, 3))
    return points, np.array([*middle, *direction, radius])


def look(points, *, known=None, curved=None, threads=1, seed=0, octave=1.6):
    """Slice the windows of a cloud where nothing is `known` to be flat or curved; candidates in scene units."""
    frame, scene = make_frame(points, Config())
    config = resolve(Config(), scene)
    flatness = np.where(np.arange(len(points)) < PLANE, 9.0, 0.0) if known is None else known
    curved = np.zeros(len(points), bool) if curved is None else curved
    explained = Explained(flatness[frame.order], curved[frame.order])
    supported = config.candidates.min_inliers, config.candidates.min_share
    radii = radius_range(config, frame)
    found, counts = slice_windows(frame, explained, radii, config.slicing, octave, supported, seed, threads)
    models = found.models.copy()
    models[:, :3] = models[:, :3] * frame.spacing + frame.origin
    models[:, 6] *= frame.spacing
    return models, found, counts


def are_near(models, true):
    """Tell which models are the pipe, up to a third of its radius and eight degrees."""
    offsets = np.linalg.norm(np.cross(models[:, :3] - true[:3], true[3:6]), axis=1)
    turns = np.abs(models[:, 3:6] @ true[3:6])
    ratios = np.abs(models[:, 6] / true[6] - 1)
    return (offsets < 0.35 * true[6]) & (turns > np.cos(np.radians(8))) & (ratios < 0.25)


@pipes
def test_a_thin_sparse_pipe_is_what_nearly_all_candidates_say(radius, theta_deg):
    points, true = thin_pipe(8, radius, theta_deg)
    models, found, _ = look(points)
    near = are_near(models, true)
    assert near.mean() > 0.7
    # all along it: some in each of ten pieces
    heights = (models[near, :3] - true[:3]) @ true[3:6]
    assert (np.histogram(heights, 10, (-0.5 * LENGTH, 0.5 * LENGTH))[0] > 0).all()
    assert np.allclose(np.linalg.norm(models[:, 3:6], axis=1), 1.0)
    assert (found.inliers >= 15).all()
    assert len(np.unique(found.parents)) == len(found)


@pytest.mark.parametrize(("radius", "theta_deg"), [pipe for pipe in PIPES if pipe != (0.8, 150)])
def test_a_thin_sparse_pipe_is_found(radius, theta_deg):
    points, true = thin_pipe(1, radius, theta_deg)
    (fit,) = cylx.extract(points, threads=1).cylinders
    shape = fit.cylinder
    assert np.linalg.norm(np.cross(shape.point - true[:3], true[3:6])) < 0.15 * radius
    assert np.linalg.norm(np.cross(shape.direction, true[3:6])) < np.radians(0.5)
    assert np.isclose(shape.radius, radius, rtol=0.1)


def test_every_slice_is_counted():
    points, _ = thin_pipe(1, 1.0, 200)
    _, found, counts = look(points)
    assert set(counts) == {"slices", "too few points", "no ellipse", "does not fit"}
    assert counts["slices"] % 4 == 0  # one across and three in any direction
    assert all(number >= 0 for number in counts.values())
    rejected = sum(number for name, number in counts.items() if name != "slices")
    assert 0 < len(found) <= counts["slices"] - rejected


def test_nothing_is_proposed_where_everything_is_explained():
    points, _ = thin_pipe(2, 1.0, 200)
    everything = np.full(len(points), 4.0)
    models, found, counts = look(points, known=everything)
    assert len(models) == len(found) == counts["slices"] == 0
    models, _, counts = look(points, curved=np.ones(len(points), bool))
    assert len(models) == counts["slices"] == 0


def test_windows_are_laid_only_where_nothing_is_explained_but_see_the_curved_points():
    points, true = thin_pipe(3, 1.0, 360)
    heights = (points - true[:3]) @ true[3:6]
    half = (heights > 0) & (np.arange(len(points)) >= PLANE)
    models, found, counts = look(points, curved=half)
    _, everywhere, all_counts = look(points)
    assert 0 < counts["slices"] < all_counts["slices"]
    assert 0 < len(found) < len(everywhere)
    # a window sees twice its radius, and its candidate speaks for the place next to its middle
    beyond = (models[:, :3] - true[:3]) @ true[3:6] - found.windows
    assert (beyond[are_near(models, true)] < 1.5).all()


def test_a_plane_and_noise_propose_next_to_nothing():
    rng = np.random.default_rng(4)
    plane, _ = thin_pipe(4, 1.0, 360)
    nothing = np.concatenate([plane[:PLANE], SIDE * rng.random((600, 3))])
    _, found, counts = look(nothing)
    assert counts["slices"] > 100
    assert len(found) <= 0.02 * counts["slices"]


@pytest.mark.parametrize("threads", [2, 5])
def test_threads_make_no_difference(threads):
    points, _ = thin_pipe(5, 0.8, 200)
    one, other = look(points), look(points, threads=threads)
    assert len(one[0]) > 50
    assert np.array_equal(one[0], other[0])
    for name in ("models", "parents", "extents", "inliers", "windows"):
        assert np.array_equal(getattr(one[1], name), getattr(other[1], name)), name
    assert one[2] == other[2]


def test_the_unit_and_the_order_make_no_difference():
    points, _ = thin_pipe(6, 1.2, 200)
    models, found, counts = look(points)
    order = np.random.default_rng(6).permutation(len(points))
    mixed, _, mixed_counts = look(points[order], known=np.where(order < PLANE, 9.0, 0.0))
    assert mixed_counts == counts
    assert np.allclose(mixed, models, rtol=0, atol=1e-6)
    for scale in (1000.0, 0.0254):
        scaled, other, scaled_counts = look(scale * points)
        assert scaled_counts == counts
        assert np.allclose(scaled[:, 3:6], models[:, 3:6], rtol=0, atol=1e-6)
        assert np.allclose(scaled[:, [0, 1, 2, 6]], scale * models[:, [0, 1, 2, 6]], rtol=0, atol=1e-6 * scale)
        assert np.abs(other.inliers - found.inliers).max() <= 1  # a point at the very border


def test_another_seed_draws_other_slices_of_the_same_pipe():
    points, true = thin_pipe(7, 1.0, 360)
    one, other = look(points)[0], look(points, seed=1)[0]
    assert not np.array_equal(one, other)
    assert are_near(one, true).mean() > 0.7
    assert are_near(other, true).mean() > 0.7
