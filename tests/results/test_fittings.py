"""Fittings and runs in the JSON: what is written is read back, and what is not theirs is refused."""

from dataclasses import fields
from math import radians

import jsonschema
import numpy as np
import pytest

from cylx.errors import InputError
from cylx.geometry.cylinder import Cylinder
from cylx.records import (
    Cap,
    Cross,
    CylinderFit,
    Elbow,
    Flange,
    Inline,
    Joint,
    Junction,
    OpenEnd,
    PipeRun,
    PipeSize,
    Reducer,
)
from cylx.results import Result, ResultCylinder, result_schema
from cylx.results.fittings import ResultRun, fitting_of

PLACE, UP = np.array([1.0, -0.0, 2.0]), np.array([0.0, 0.0, 1.0])
TWO = {"joins": (3, 1), "ends": ("end", "start"), "confidence": 0.9, "inliers": 40, "rms": 0.1, "coverage": 0.5}
FITTINGS = [
    Elbow(
        **TWO,
        std={"bend_radius": 0.01, "angle_deg": 0.2},
        center=PLACE,
        normal=UP,
        bend_radius=0.3,
        angle=radians(90),
        radius=0.1,
        start=PLACE,
        end=UP,
    ),
    Junction(**TWO, center=PLACE, main=(3,), branches=(1,), angle=radians(60)),
    Cross(**TWO, center=PLACE, main=(3,), branches=(1, 2), angle=radians(90)),
    Reducer(**TWO, start=PLACE, end=UP, start_radius=0.2, end_radius=0.1, offset=0.0, concentric=True),
    Flange(**TWO, center=PLACE, axis=UP, radius=0.2, thickness=0.05, pair=True),
    Inline(**TWO, start=PLACE, end=UP),
    Cap(joins=(3,), ends=("end",), confidence=0.6, center=PLACE, axis=UP, radius=0.1),
    Joint(**TWO, start=PLACE, end=UP, length=1.5),
]
RUN = PipeRun(
    (3, 1),
    (0,),
    4.5,
    None,
    (PipeSize(0.1, 0.001, 4.5, (3, 1)),),
    (OpenEnd(3, "start", "hidden"), OpenEnd(1, "end", "leaves_cloud")),
)


def written():
    """Give a result of four cylinders, one fitting of each kind, and a run."""
    pipe = CylinderFit(
        Cylinder((0, 0, 0), (0, 0, 1), 0.1, 2.0), inliers=9, rmse=0.1, coverage=3.0, support=1, payoff=0.5
    )
    return {
        "schema": "cylx.cylinders/1",
        "cylx_version": "0",
        "input": {"file": "a", "format": "ply", "points": 0, "bounds": {"min": [0.0] * 3, "max": [0.0] * 3}},
        "method": "gt",
        "config": {},
        "scene": {"spacing": 1.0, "noise": 0.1},
        "stages": [],
        "cylinders": [ResultCylinder.of(i, pipe).to_object() for i in range(4)],
        "fittings": [fitting_of(i, one).to_object() for i, one in enumerate(FITTINGS)],
        "runs": [ResultRun.of(0, RUN).to_object()],
        "warnings": [],
    }


def test_all_kinds_are_written_and_read_back():
    document = written()
    jsonschema.validate(document, result_schema())
    assert Result.parse(document, "it").to_object() == document
    kinds = {"elbow", "tee", "cross", "reducer", "flange", "inline", "cap", "joint"}
    assert {one["kind"] for one in document["fittings"]} == kinds


@pytest.mark.parametrize("fitting", FITTINGS, ids=lambda one: one.kind)
def test_every_field_has_its_key(fitting):
    keys = set(fitting_of(0, fitting).to_object())
    assert keys == {field.name for field in fields(fitting)} - {"angle"} | {"id", "kind"} | (
        {"angle_deg"} if hasattr(fitting, "angle") else set()
    )


def test_numbers_are_plain_and_angles_in_degrees():
    elbow = fitting_of(0, FITTINGS[0]).to_object()
    assert elbow["angle_deg"] == pytest.approx(90.0)
    assert str(elbow["center"]) == "[1.0, 0.0, 2.0]"


@pytest.mark.parametrize(
    ("change", "place"),
    [
        ({"kind": "spiral"}, "fittings.0"),
        ({"bend_radius": -1.0}, "bend_radius"),
        ({"axis": [0.0, 0.0, 1.0]}, "axis"),
    ],
)
def test_what_is_no_fitting_is_refused(change, place):
    document = written()
    document["fittings"][0] |= change
    with pytest.raises(InputError, match=place):
        Result.parse(document, "it")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"cylinders": []}, "fitting 0 joins cylinder 3, which is not there"),
        ({"fittings": []}, "run 0 has fitting 0, which is not there"),
        ({"fittings": [], "cylinders": []}, "run 0 has cylinder 3, which is not there"),
    ],
)
def test_what_refers_to_what_is_not_there_is_refused(change, said):
    with pytest.raises(InputError, match=said):
        Result.parse(written() | change, "it")
