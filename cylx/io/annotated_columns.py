"""The columns of an annotated cloud: ours, and those of the input under the names that they get."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from cylx.io.names import mended_names
from cylx.io.ply import ply_type

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

OURS = {"cylinder_id": "<i4", "residual": "<f4", "red": "u1", "green": "u1", "blue": "u1"}
OF_RUNS = {"fitting_id": "<i4", "run_id": "<i4"}
OF_TREES = {"treeID": "<i4", "red": "u1", "green": "u1", "blue": "u1"}


def kept_columns(
    dtype: np.dtype[np.void] | None, ours: Mapping[str, str] = OURS
) -> dict[str, tuple[str, np.dtype[Any]]]:
    """Return the output name and type of each property of the input, by its input name."""
    if dtype is None:
        return {axis: (axis, np.dtype("<f8")) for axis in "xyz"}
    names = dtype.names or ()
    mended = mended_names(names)
    taken = {*mended, *ours}
    colored = {"red", "green", "blue"} <= set(mended)
    kept = {}
    for name, new in zip(names, mended, strict=True):
        renamed = new
        if new in ours or (new == "alpha" and colored):
            while renamed in taken:
                renamed = f"orig_{renamed}"
            taken.add(renamed)
        kept[name] = (renamed, ply_type(dtype[name]))
    return kept


def rows_of(
    columns: Mapping[str, NDArray[Any]] | NDArray[np.void],
    ours: dict[str, NDArray[Any]],
    kept: dict[str, tuple[str, np.dtype[Any]]],
    dtype: np.dtype[np.void],
    one: str = "cylinder_id",
) -> NDArray[np.void]:
    """Return rows of the output; `one` is any of our properties."""
    block = np.empty(len(ours[one]), dtype)
    for name, (new, _) in kept.items():
        block[new] = columns[name]
    for name, values in ours.items():
        block[name] = values
    return block
