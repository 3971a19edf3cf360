"""Clouds in cells: which points may lie on a cylinder, by the flatness about them and by their normals."""

import numpy as np
import pytest

from cylx.config import Config
from cylx.geometry.cells import Cells
from cylx.records import IndexedCloud, Noise
from cylx.scene import make_frame

COUNT = 3000


def indexed_pipe(normals=None, flat=0.0):
    """Give a pipe of a turn about the z axis in cells, its model and its radius, frame units; normals of each point."""
    rng = np.random.default_rng(0)
    turn = 2 * np.pi * rng.random(COUNT)
    frame, _ = make_frame(np.column_stack([np.cos(turn), np.sin(turn), 4 * rng.random(COUNT)]), Config())
    middle = -frame.origin / frame.spacing
    radial = frame.points - middle
    radial[:, 2] = 0.0
    radial /= np.linalg.norm(radial, axis=1, keepdims=True)
    own = None if normals is None else normals(radial).astype(np.float32)
    noise = Noise(np.ones(1), np.array([0.01]))
    radius = 1.0 / frame.spacing
    indexed = IndexedCloud(Cells(frame.points, frame.codes), np.full(COUNT, flat * radius), noise, own)
    return indexed, np.array([*middle, 0.0, 0.0, 1.0, radius])


def turned(angle_deg):
    """Give the function that tilts normals towards the axis."""
    angle = np.radians(angle_deg)
    return lambda radial: np.cos(angle) * radial + np.sin(angle) * np.array([0.0, 0.0, 1.0])


@pytest.mark.parametrize(("angle_deg", "may"), [(0, True), (30, True), (45, False), (90, False), (180, True)])
def test_points_whose_normal_is_not_radial_belong_to_what_meets_it(angle_deg, may):
    indexed, model = indexed_pipe(turned(angle_deg))
    assert (indexed.may_be_on(np.arange(COUNT), model) == may).all()


def test_points_of_which_no_normal_is_known_may_lie_anywhere():
    half = np.arange(COUNT) % 2 == 0
    indexed, model = indexed_pipe(lambda radial: np.where(half[:, None], 0.0, turned(90)(radial)))
    assert (indexed.may_be_on(np.arange(COUNT), model) == half).all()
    assert indexed_pipe()[0].may_be_on(np.arange(COUNT), model).all()


def test_only_those_that_are_asked_for_are_told():
    indexed, model = indexed_pipe(lambda radial: np.where(np.arange(COUNT)[:, None] < 100, turned(90)(radial), radial))
    assert indexed.may_be_on(np.array([5, 500, 99, 100]), model).tolist() == [False, True, False, True]
    assert len(indexed.may_be_on(np.empty(0, np.int64), model)) == 0


def test_a_smaller_share_lets_less_flat_points_through():
    indexed, model = indexed_pipe(flat=0.5)
    limit = indexed.too_flat(model[6]) / model[6]
    for share in (1.0, 0.6, 0.3, 0.1):
        assert indexed.may_be_on(np.arange(COUNT), model, share).all() == (share * limit > 0.5)
        assert indexed.may_be_on(np.arange(COUNT), model, share).any() == (share * limit > 0.5)
