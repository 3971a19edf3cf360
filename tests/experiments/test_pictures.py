"""The pictures of figures."""

import sys

import numpy as np
import pytest

from cylx.errors import UsageError
from cylx.experiments import (
    FIGURES,
    Key,
    draw,
    summarize,
)
from tests.support.experiments import NAN, outcome


def done_of(figure, cells):
    rng = np.random.default_rng(0)
    return {Key.of(cell, trial): outcome(1, *rng.uniform(0.1, 1, 4)) for cell in cells for trial in range(2)}


@pytest.mark.parametrize("number", [5, 6, 7, 11, 12])
def test_every_kind_of_figure_is_drawn_however_much_of_it_is_there(number):
    figure = FIGURES[number]
    figure = figure._replace(cells=tuple(cell for cell in figure.cells if cell.panel == figure.panels[-1]))
    nothing_found = {Key.of(figure.cells[0], 0): outcome(0, NAN, NAN, NAN, 1.0)}
    states = [{}, nothing_found, done_of(figure, figure.cells[:-1])]
    pictures = [draw(figure, summarize(figure, done), done) for done in states]
    assert all(picture.startswith(b"\x89PNG\r\n") for picture in pictures)
    assert len(set(pictures)) == len(pictures)


def test_without_matplotlib_it_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    with pytest.raises(UsageError) as refused:
        draw(FIGURES[7], summarize(FIGURES[7], {}), {})
    assert str(refused.value) == "the picture: matplotlib is not installed; pip install 'cylx[plots]'"
