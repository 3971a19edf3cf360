"""The figures of the paper: cells that can be run, at places of their own."""

import pytest

from cylx.config import load_config
from cylx.experiments import (
    FIGURES,
    Key,
    header_line,
    parse_trials,
    trial_lines,
)
from cylx.experiments.figures import CURVES, UNSURE
from cylx.experiments.trials import config_of
from cylx.synthetic import single
from tests.support.experiments import outcome


def test_figures_5_to_12_are_there():
    assert list(FIGURES) == list(range(5, 13))
    assert [figure.number for figure in FIGURES.values()] == list(range(5, 13))
    assert [number for number, figure in FIGURES.items() if figure.needs_scan] == [11, 12]


@pytest.mark.parametrize("figure", FIGURES.values(), ids=FIGURES)
def test_no_two_cells_are_at_one_place_and_a_file_can_tell_them_apart(figure):
    places = [(cell.panel, cell.curve, float(cell.x)) for cell in figure.cells]
    assert len(set(places)) == len(places) > 0
    keys = [Key.of(cell, 3) for cell in figure.cells]
    assert list(parse_trials(header_line() + trial_lines((key, outcome()) for key in keys))) == keys


@pytest.mark.parametrize("figure", FIGURES.values(), ids=FIGURES)
def test_each_place_has_all_methods_that_can_be_there(figure):
    expected = {5: {"gt", "auto"}, 6: {"gt"}, 11: set(CURVES) - {"line-fit"}, 12: set(CURVES) - {"line-fit"}}
    assert {cell.method for cell in figure.cells} == expected.get(figure.number, set(CURVES))
    if figure.number > 6:
        for panel, x in {(cell.panel, cell.x) for cell in figure.cells}:
            here = [cell for cell in figure.cells if (cell.panel, cell.x) == (panel, x) and cell.curve != UNSURE]
            assert sorted(cell.method for cell in here) == sorted(expected.get(figure.number, CURVES))
            assert len({cell.scene for cell in here}) == 1
            assert all(cell.curve == cell.method for cell in here)


@pytest.mark.parametrize("figure", FIGURES.values(), ids=FIGURES)
def test_the_configuration_of_every_cell_loads(figure):
    extent = 150.0 if figure.needs_scan else None
    for cell in figure.cells:
        config = config_of(cell, 7, most=2, extent=extent)
        assert config.seed == 7
        assert config.method == ("gt" if cell.method == "auto" else cell.method)
        if cell.method == "auto":
            assert config == load_config(overrides=cell.settings, options={"seed": 7})
            assert cell.curve == UNSURE or not cell.settings
            continue
        assert (config.preset, config.max_cylinders) == ("paper", 2)
        # 2 mm and 1.2 radii of the soup can, whose box is 66 x 66 x 101 mm; 0.03 and 1.2 of the unit cylinder
        near, ball = (2.16, 42.9) if figure.needs_scan else (0.03, 1.2)
        if cell.method in {"msac", "tran", "jin"}:
            assert getattr(config, cell.method).distance == pytest.approx(near)
            assert config.jin.neighbourhood == pytest.approx(ball)


@pytest.mark.parametrize("figure", [figure for figure in FIGURES.values() if not figure.needs_scan])
def test_the_scene_of_every_cell_can_be_made(figure):
    for cell in figure.cells:
        assert dict(cell.scene)["points"] == 10_000
        assert single(**{**dict(cell.scene), "points": 50}).points.shape == (50, 3)


def test_the_planes_are_the_papers():
    def planes_of(number):
        return {config_of(cell, 0, most=1).slicing.planes for cell in FIGURES[number].cells if cell.method != "auto"}

    assert planes_of(5) == {10, 20, 30, 40, 60, 90}
    assert planes_of(6) == planes_of(7) == planes_of(8) == {20}
    assert planes_of(9) == {40}
    for cell in FIGURES[6].cells:
        assert config_of(cell, 0, most=1).slicing.inclination_deg == [cell.x - 5, cell.x + 5]
    assert {config_of(cell, 0, most=1).tran.neighbours for cell in FIGURES[8].cells if cell.method == "tran"} == {100}


def test_where_there_are_two_cans_the_default_is_there_once_more_and_less_strict():
    unsure = [cell for figure in FIGURES.values() for cell in figure.cells if cell.curve == UNSURE]
    others = [cell for cell in FIGURES[11].cells if cell.curve == "auto"]
    assert [cell._replace(curve="auto", settings=()) for cell in unsure] == others
    for cell in unsure:
        config = config_of(cell, 3, most=2)
        assert (config.max_cylinders, config.seed) == (None, 3)
        assert config.verification.min_confidence < load_config().verification.min_confidence
