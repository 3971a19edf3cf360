"""Discs about a pipe: flanges have a pipe between them, and a shaft has collars."""

import numpy as np
import pytest

from tests.support.pipework import Pipework, X, of_kind

R, DISC = 0.04, 0.075


@pytest.mark.parametrize("count", [1, 2])
def test_flanges_have_room_on_a_pipe(count):
    work = Pipework()
    work.pipe([0, 0, 0], [0.9, 0, 0], R)
    for k in range(count):
        work.flange(np.array([0.25 + 0.4 * k, 0, 0]), X, R, DISC, 0.04)
    assert len(of_kind(work.traced(), "flange")) == count


def test_a_shaft_with_collars_has_no_flanges():
    work = Pipework()
    work.pipe([0, 0, 0], [0.8, 0, 0], R)
    for k in range(6):
        work.flange(np.array([0.1 + 0.12 * k, 0, 0]), X, R, DISC, 0.03)
    assert of_kind(work.traced(), "flange") == []
