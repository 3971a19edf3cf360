"""The points of a page: which are chosen, how they are packed, in which colours."""

import base64

import numpy as np
import pytest

from cylx.records import PointCloud
from cylx.report.points import (
    LEAST_OF_EACH_CYLINDER,
    STEPS_ACROSS_BOX,
    choose_points,
    original_colors,
    pack_labels,
    pack_residuals,
    quantise,
)


def unpacked(text, dtype):
    return np.frombuffer(base64.b64decode(text), dtype)


def test_coordinates_are_off_by_half_a_step_at_most():
    points = np.random.default_rng(3).normal(size=(5000, 3)) * [100, 1, 1e-3] + [4e6, -5e5, 0]
    steps, low, size = quantise(points)
    assert (steps.dtype, steps.min(), steps.max()) == (np.dtype("<u2"), 0, STEPS_ACROSS_BOX)
    assert (np.abs(low + steps / STEPS_ACROSS_BOX * size - points) <= size / STEPS_ACROSS_BOX * 0.5001 + 1e-9).all()


def test_a_flat_cloud_has_a_box_without_thickness():
    steps, _, size = quantise(np.array([[0.0, 1, 2], [1, 1, 2]]))
    assert size.tolist() == [1, 0, 0]
    assert steps.tolist() == [[0, 0, 0], [STEPS_ACROSS_BOX, 0, 0]]


def test_few_points_are_all_shown():
    labels = np.array([0, -1, 1], np.int32)
    assert sorted(choose_points(labels, 3, np.random.default_rng(0))) == [0, 1, 2]


def test_many_points_are_chosen_evenly_and_every_cylinder_keeps_some():
    labels = np.repeat(np.array([-1, 0, 1, 2], np.int32), [800_000, 190_000, 9_970, 30])
    chosen = choose_points(labels, 50_000, np.random.default_rng(7))
    assert 49_990 < len(chosen) <= 50_000
    assert len(np.unique(chosen)) == len(chosen)
    counts = np.bincount(labels[chosen] + 1)
    assert counts[3] == 30
    assert counts[2] >= LEAST_OF_EACH_CYLINDER
    assert counts[:2] / counts.sum() == pytest.approx([0.8, 0.19], abs=0.02)
    others = np.sort(chosen[labels[chosen] == -1])
    assert np.diff(others).max() < 2.1 * 800_000 / len(others)  # no stretch of the order is left out
    assert np.mean(chosen[:5000]) == pytest.approx(np.mean(chosen), rel=0.03)  # any beginning is an even choice
    again = choose_points(labels, 50_000, np.random.default_rng(7))
    assert np.array_equal(chosen, again)


def test_as_many_cylinders_as_points_may_be_shown_are_no_mistake():
    labels = np.arange(300, dtype=np.int32) % 100
    chosen = choose_points(labels, 100, np.random.default_rng(0))
    assert 0 < len(chosen) <= 100


def test_labels_take_two_bytes_where_one_is_not_enough():
    labels = np.array([-1, 0, 254], np.int32)
    assert pack_labels(labels, 255).tolist() == [255, 0, 254]
    assert pack_labels(labels, 256).tolist() == [65535, 0, 254]
    assert pack_labels(labels, 256).dtype == np.dtype("<u2")


def test_residuals_are_steps_of_their_limit():
    assert pack_residuals(np.array([np.nan, 0, 1, -1, 9, -0.5]), 1.0).tolist() == [-128, 0, 127, -127, 127, -64]


def rgb(*columns):
    return dict(zip(("red", "green", "blue"), columns, strict=True))


@pytest.mark.parametrize(
    ("columns", "expected"),
    [
        (rgb(np.uint8([1, 2]), np.uint8([3, 4]), np.uint8([5, 6])), [[1, 3, 5], [2, 4, 6]]),
        (rgb(np.uint16([257, 0]), np.uint16([0, 0]), np.uint16([65535, 0])), [[1, 0, 255], [0, 0, 0]]),
        (rgb(np.float32([1, 0]), np.float32([0.5, 0]), np.float32([0, np.nan])), [[255, 128, 0], [0, 0, 0]]),
        ({"rgb": np.uint32([0x010203, 0xFF0000]).view(np.float32)}, [[1, 2, 3], [255, 0, 0]]),
        ({"intensity": np.float32([1, 2])}, None),
        ({"red": np.uint8([1, 2])}, None),
    ],
)
def test_the_colours_of_the_input_are_understood(columns, expected):
    table = np.zeros(3, [(name, "f8") for name in "xyz"] + [(name, values.dtype) for name, values in columns.items()])
    for name, values in columns.items():
        table[name][[0, 2]] = values
    valid = np.array([True, False, True])
    colors = original_colors(PointCloud(np.zeros((2, 3)), table, valid))
    assert (colors if colors is None else colors.tolist()) == expected
