"""Points that a LAS file marks as withheld, which is to say deleted: they are kept in the file, and not used."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray


def withheld_rows(table: NDArray[np.void], kind: str) -> NDArray[np.bool_]:
    """Return which rows of a table are marked as withheld.

    Parameters
    ----------
    table : ndarray of shape (N,), structured
    kind : str
        Format of the file. Only LAS says what the mark means.

    Returns
    -------
    ndarray of shape (N,), bool

    References
    ----------
    ASPRS, LAS specification 1.4 R15, table 9: "withheld" points are not to be included in processing.
    """
    if kind != "las" or "withheld" not in (table.dtype.names or ()):
        return np.zeros(len(table), np.bool_)
    return np.asarray(table["withheld"] != 0)
