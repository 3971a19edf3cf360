"""The first run after an installation compiles the kernels; show that as a stage of its own."""

from __future__ import annotations

import numpy as np

from cylx.geometry.morton import find_cell


def kernels_are_cold() -> bool:
    """Tell whether the kernels have yet to be compiled: the smallest of them is called, and says where it came from."""
    before = sum(find_cell.stats.cache_misses.values())
    find_cell(np.zeros(1, np.int64), 0)
    return bool(sum(find_cell.stats.cache_misses.values()) > before)


def practice_cloud() -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """Give a small cloud that calls every kernel: two cylinders and a floor, shape (N, 3)."""
    rng = np.random.default_rng(0)
    turn, height = 2.0 * np.pi * rng.random(2500), 4.0 * rng.random(2500)
    cylinder = np.column_stack([np.cos(turn), np.sin(turn), height])
    floor = np.column_stack([12.0 * rng.random((2500, 2)) - 4.0, np.zeros(2500)])
    points = np.concatenate([cylinder, cylinder + np.array([4.0, 0.0, 0.0]), floor])
    return np.asarray(points + 0.005 * rng.standard_normal(points.shape))
