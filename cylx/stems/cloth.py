"""A cloth over the upturned cloud: the ground filter of Zhang et al. (Remote Sensing 8, 2016), by its own library."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from cylx.geometry.arrays import FloatArray, MaskArray
from cylx.optional.extras import require

NEAR = 0.3
"""Points this near to the cloth are ground, metres."""
ROUNDS = 500


def on_cloth(z: FloatArray, u: FloatArray, v: FloatArray, cell: float) -> MaskArray:
    """Return which of the lowest points of cells lie on the cloth.

    Parameters
    ----------
    z : ndarray of shape (n, m)
        Heights, metres; NaN where a cell has no point.
    u, v : ndarray of shape (n, m)
        Places, in cells.
    cell : float
        Side of a cell, and of the meshes of the cloth, metres.

    Raises
    ------
    UsageError
        If the library is not installed.
    """
    require("CSF", place="--ground cloth", needed_by="it")
    import CSF  # noqa: PLC0415  an extra

    there = np.isfinite(z)
    points = np.column_stack([cell * u[there], cell * v[there], z[there] - z[there].min(initial=np.inf)])
    out = np.zeros(z.shape, np.bool_)
    if not len(points):
        return out
    with _silent():
        filter_ = CSF.CSF()
        filter_.params.bSloopSmooth = True
        filter_.params.cloth_resolution = cell
        filter_.params.class_threshold = NEAR
        filter_.params.interations = ROUNDS
        filter_.params.rigidness = 1
        filter_.setPointCloud(points)
        ground, others = CSF.VecInt(), CSF.VecInt()
        filter_.do_filtering(ground, others, False)
        indices = np.array(list(ground), dtype=np.int64)
    chosen = np.zeros(len(points), np.bool_)
    chosen[indices] = True
    out[there] = chosen
    return out


@contextmanager
def _silent() -> Iterator[None]:
    """Keep what the library prints off standard output, which is for the answer."""
    sys.stdout.flush()
    kept = os.dup(1)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 1)
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)
        os.close(nowhere)
