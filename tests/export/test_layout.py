"""Straights and fittings meet: at the same places, also where the measured axes do not, and nothing is lost."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cylx.errors import InputError
from cylx.export import draw
from cylx.export.layout import lay_out
from cylx.export.parts import piping_of
from tests.support.piping import FITTINGS, LINKS, VOLUMES, R, piping

TURNS = [np.eye(3), *Rotation.random(3, random_state=5).as_matrix()]


def made(**how):
    cylinders, fittings, runs = piping(**how)
    return piping_of(cylinders, [(0, 0, 0)] * len(cylinders), fittings, runs)


def gaps(content):
    for (one, port), (other, its) in content.links:
        yield content.parts[one].ports[port], content.parts[other].ports[its]


@pytest.mark.parametrize("turn", TURNS)
def test_what_is_joined_meets_face_to_face(turn):
    content = made(rotation=turn, origin=(100.0, -50.0, 3.0), scale=10.0)
    assert {part.name for part in content.parts} == set(VOLUMES)
    assert len(content.links) == LINKS
    for one, other in gaps(content):
        np.testing.assert_allclose(one.place, other.place, atol=1e-9)
        # the ends of a mitre and of an eccentric reducer are as square to the pipe as all others
        assert one.outward @ other.outward == pytest.approx(-1.0, abs=1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_axes_that_do_not_quite_meet_are_drawn_as_if_they_did(seed):
    content = made(rotation=TURNS[seed % 4], jitter=0.002, rng=np.random.default_rng(seed))
    assert len(content.links) == LINKS
    for one, other in gaps(content):
        np.testing.assert_allclose(one.place, other.place, atol=1e-12)
    right = {part.name: part for part in made(rotation=TURNS[seed % 4]).parts}
    for part in content.parts:
        for port, known in zip(part.ports, right[part.name].ports, strict=True):
            assert np.linalg.norm(port.place - known.place) < 0.02  # a few times the jitter


def test_each_part_is_in_one_run_and_next_to_what_it_is_joined_with():
    content = made()
    assert content.names == ("run 0", "run 1", "run 2", "run 3")
    assert sorted(k for system in content.systems for k in system) == list(range(len(content.parts)))
    joined = {frozenset((one, other)) for (one, _), (other, _) in content.links}
    for system in content.systems:
        for k, part in enumerate(system[1:], start=1):
            assert any(frozenset((part, before)) in joined for before in system[:k])
    assert [content.parts[k].name for k in content.systems[0][:4]] == ["cap 0", "cylinder 0", "inline 1", "cylinder 1"]


def test_what_joins_a_cylinder_that_is_left_out_is_left_out():
    cylinders, fittings, runs = piping()
    kept = [one for one in cylinders if one.id != 4]
    content = piping_of(kept, [(0, 0, 0)] * len(kept), fittings, runs)
    names = {part.name for part in content.parts}
    assert "tee 5" not in names
    assert {"cylinder 3 piece 0", "cylinder 3 piece 1", "cross 6"} <= names
    assert len(content.links) == LINKS - 3


def test_of_two_that_claim_one_end_the_second_is_left_out():
    cylinders, fittings, _ = piping()
    twin = fittings[4].model_copy(update={"id": 15, "bend_radius": 0.3})
    layout = lay_out(cylinders, [*fittings, twin])
    assert set(layout.fittings) == set(range(len(FITTINGS)))


def test_a_flange_leaves_the_end_to_what_goes_on_from_it():
    cylinders, fittings, runs = piping()
    flange = fittings[10].model_copy(update={"id": 15, "joins": [8], "center": fittings[9].start})
    content = piping_of(cylinders, [(0, 0, 0)] * len(cylinders), [flange, *fittings], runs)
    joint = next(k for k, part in enumerate(content.parts) if part.name == "joint 9")
    beside = {one if other == joint else other for (one, _), (other, _) in content.links if joint in (one, other)}
    assert {content.parts[k].name for k in beside} == {"flange 15", "cylinder 9"}
    disc = next(part for part in content.parts if part.name == "flange 15")
    assert disc.solids[0].height == pytest.approx(0.01)  # the half that is not beyond the end


def test_junctions_side_by_side_share_the_room_between_them():
    cylinders, fittings, runs = piping()
    near = fittings[5].model_copy(update={"id": 15, "joins": [3, 5], "branches": [5], "center": [6.2, 1.05, 0.0]})
    chosen = [one for one in fittings if one.id != 6]
    content = piping_of(cylinders, [(0, 0, 0)] * len(cylinders), [*chosen, near], runs)
    first, second = (next(part for part in content.parts if part.name == name) for name in ("tee 5", "tee 15"))
    np.testing.assert_allclose(first.ports[1].place, second.ports[0].place, atol=1e-12)
    assert 1.0 < first.ports[1].place[1] < 1.05


def test_a_result_without_fittings_keeps_its_cylinders():
    cylinders, _, _ = piping()
    layout = lay_out(cylinders, [])
    assert [one.cylinder for one in layout.straights] == list(R)
    for straight, found in zip(layout.straights, cylinders, strict=True):
        np.testing.assert_allclose([straight.start, straight.end], [found.start, found.end], atol=1e-12)


def changed(number, **values):
    """Give the content with one fitting changed."""
    cylinders, fittings, runs = piping()
    new = type(fittings[number]).model_validate({**fittings[number].model_dump(), **values})
    return cylinders, [new if one.id == number else one for one in fittings], runs


@pytest.mark.parametrize(
    ("number", "values", "kept"),
    [
        (4, {"normal": [0.0, 0.0, 0.0]}, True),
        (4, {"start": [6.0, 0.2, 0.0]}, True),  # the middle of the bend
        (4, {"bend_radius": 0.01}, True),  # the tube would go through itself
        (4, {"ends": ["end", "side"]}, False),
        (4, {"joins": [2, 2], "ends": ["start", "end"]}, False),
        (4, {"joins": [2]}, False),
        (5, {"angle_deg": 1e-300}, True),
        (5, {"main": []}, False),
        (5, {"branches": [9]}, False),
        (0, {"ends": ["side"]}, False),
        (10, {"joins": [14]}, False),
    ],
)
def test_fittings_that_are_not_quite_possible_are_drawn_or_left_out(number, values, kept):
    cylinders, fittings, runs = changed(number, **values)
    content = piping_of(cylinders, [(0, 0, 0)] * len(cylinders), fittings, runs)
    assert any(part.fitting is not None and part.fitting.id == number for part in content.parts) == kept
    assert {part.cylinder.id for part in content.parts if part.cylinder is not None} == set(R)
    for one, other in gaps(content):
        np.testing.assert_allclose(one.place, other.place, atol=1e-9)
    for part in content.parts:
        assert all(np.isfinite(port.place).all() for port in part.ports)


def test_fittings_where_no_pipe_can_be_are_refused():
    cylinders, fittings, runs = changed(4, center=[1e300, 0.0, 0.0])
    with pytest.raises(InputError, match=r"plant\.json: fittings: they are where no pipes can be, or of no size; give"):
        draw(cylinders, np.zeros((14, 3), np.uint8), place="plant.json", fittings=fittings, runs=runs)
