"""The rounded edges of bars are four small arcs, not two half rounds; small ones are found between their planes."""

import numpy as np
import pytest

from cylx.config import Config
from cylx.pipeline import extract_cylinders
from cylx.records import PointCloud

SPACING = 0.4


def rounded_bar(rng, wide, high, length, sigma):
    """Draw points of a bar with edges of radius one, evenly over its four sides; its ends are open."""
    flats, quarter = np.array([wide, high, wide, high]), 0.5 * np.pi
    lengths = np.ravel(np.column_stack([flats, np.full(4, quarter)]))
    count = int(lengths.sum() * length / SPACING**2)
    s = rng.uniform(0.0, lengths.sum(), count)
    starts = np.concatenate([[0.0], np.cumsum(lengths)])
    which = np.clip(np.searchsorted(starts, s, "right") - 1, 0, 7)
    s, side = s - starts[which], which // 2
    turn = side * quarter
    corner = 0.5 * np.array([[wide, high], [-wide, high], [-wide, -high], [wide, -high]])
    # each flat ends where the next edge begins; they go about the bar from its upper side on, leftwards
    flat = which % 2 == 0
    along = np.column_stack([-np.cos(turn), -np.sin(turn)])
    out = np.column_stack([-np.sin(turn), np.cos(turn)])
    angle = turn + quarter + s
    points = np.where(
        flat[:, None],
        corner[side] + out + s[:, None] * along,
        corner[(side + 1) % 4] + np.column_stack([np.cos(angle), np.sin(angle)]),
    )
    whole = np.column_stack([points, rng.uniform(-0.5 * length, 0.5 * length, count)])
    return whole + sigma * rng.standard_normal((count, 3))


@pytest.mark.parametrize("wide", [1.0, 2.0, 6.0])
def test_each_rounded_edge_of_a_bar_is_a_blend_of_its_own(wide):
    rng = np.random.default_rng(5)
    points = rounded_bar(rng, wide, 12.0, 40.0, 0.2 * SPACING)
    turn = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    found = extract_cylinders(PointCloud.from_array(points @ turn), Config())
    assert found.cylinders == ()
    corners = np.array([[x, y, 0.0] for x in (-0.5 * wide, 0.5 * wide) for y in (-6.0, 6.0)]) @ turn
    axis = turn[2]
    met = set()
    for blend in found.blends:
        away = np.asarray(blend.cylinder.point) - corners
        away -= np.outer(away @ axis, axis)
        distances = np.linalg.norm(away, axis=1)
        assert distances.min() < 0.2
        assert blend.cylinder.radius == pytest.approx(1.0, abs=0.12)
        met.add(int(distances.argmin()))
    assert len(met) >= 3
    assert len(found.blends) == len(met)
