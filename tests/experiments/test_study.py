"""Studies: what is done again, the means of trials, and the bound."""

import math

import numpy as np
import pytest

from cylx.experiments import (
    FIGURES,
    Key,
    run_tasks,
    summarize,
    tasks_of,
)
from cylx.experiments.study import bound_of
from cylx.fits.cramer_rao import mean_errors_at_bound
from tests.support.experiments import NAN, cut_down, outcome


def test_what_is_done_is_not_done_again():
    figure = cut_down(7, cells=3)
    a, b, c = figure.cells
    assert [(task.cell, task.trial) for task in tasks_of(figure, 2, {})] == [
        (a, 0),
        (b, 0),
        (c, 0),
        (a, 1),
        (b, 1),
        (c, 1),
    ]
    done = {Key.of(b, 0): outcome(), Key.of(a, 1): outcome(), Key.of(c, 5): outcome()}
    assert [(task.cell, task.trial) for task in tasks_of(figure, 2, done)] == [(a, 0), (c, 0), (b, 1), (c, 1)]
    assert tasks_of(figure, 0, done) == []
    assert list(run_tasks([], 1, None)) == []


def test_means_and_standard_errors_are_those_by_hand():
    figure = cut_down(7, cells=3)
    a, b, _ = figure.cells
    done = {
        Key.of(a, 0): outcome(1, 1.0, 2.0, NAN, 10.0),
        Key.of(a, 1): outcome(0, 2.0, NAN, NAN, 20.0),
        Key.of(a, 2): outcome(1, 6.0, 4.0, NAN, 60.0),
        Key.of(b, 0): outcome(1, 7.0, 8.0, 9.0, 1.0),
    }
    one, two, three = summarize(figure, done)
    assert (one.trials, one.found) == (3, pytest.approx(2 / 3))
    assert one.means == pytest.approx((3.0, 3.0, NAN, 30.0), nan_ok=True)
    # variances of (1, 2, 6), (2, 4) and (10, 20, 60): 7, 2 and 700
    assert one.errors == pytest.approx((math.sqrt(7 / 3), 1.0, NAN, math.sqrt(700 / 3)), nan_ok=True)
    assert (two.trials, two.found, two.means) == (1, 1.0, (7.0, 8.0, 9.0, 1.0))
    assert np.isnan(two.errors).all()
    assert three.trials == 0
    assert np.isnan([three.found, *three.means, *three.errors]).all()
    assert [summary.cell for summary in (one, two, three)] == list(figure.cells)


@pytest.mark.parametrize("number", FIGURES)
def test_the_bound_is_that_of_the_scene(number):
    figure = FIGURES[number]
    if figure.kind != "cylinder":
        assert all(bound_of(figure, cell) is None for cell in figure.cells)
        return
    for cell in figure.cells[::7]:
        scene = {"theta_deg": 360, **dict(cell.scene)}
        expected = mean_errors_at_bound(
            scene["points"],
            scene["height"],
            math.radians(scene["theta_deg"]),
            scene["sigma"],
            scene["sigma_o"],
            scene["p"],
        )
        assert bound_of(figure, cell) == expected
