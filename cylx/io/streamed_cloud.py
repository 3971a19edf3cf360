"""A cloud whose table is read piece by piece, and what reads the pieces."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from cylx.errors import InputError
from cylx.io.inputs import Input, printable
from cylx.io.names import coordinate_names
from cylx.io.withheld import withheld_rows
from cylx.records import PointCloud, Source

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from cylx.records import Crop

    Parts = Callable[[], Iterator[NDArray[np.void]]]

ROWS = 1 << 18
"""Rows of a piece, at the most."""
BARE = np.dtype([(axis, "f8") for axis in "xyz"])
"""The columns of a cloud that has nothing but coordinates."""


@dataclass(frozen=True, slots=True, eq=False)
class StreamedCloud:
    """A cloud whose table is read piece by piece.

    Parameters
    ----------
    source : Source
        Where it comes from.
    rows : int
        Number of its rows.
    dtype : dtype
        Structured: its columns.
    parts : callable
        Yields the table from its beginning, in pieces of `ROWS` rows; the last one may be shorter.
    within : callable, optional
        Yields what a box reaches of the table, as far as the file says where its points are: for each piece its first
        row and its rows. Points beside the box may be among them.
    """

    source: Source
    rows: int
    dtype: np.dtype[np.void]
    parts: Parts
    within: Callable[[Crop], Iterator[tuple[int, NDArray[np.void]]]] | None = None

    def reached(self, crop: Crop | None) -> Iterator[tuple[int, NDArray[np.void]]]:
        """Yield pieces of the table, each with the number of its first row, so that all points in a box are there."""
        if crop is not None and self.within is not None:
            yield from self.within(crop)
            return
        start = 0
        for table in self.parts():
            yield start, table
            start += len(table)

    @property
    def bare(self) -> bool:
        """Whether it has nothing but coordinates, in double precision."""
        return self.dtype == BARE

    def coordinates(self, table: NDArray[np.void]) -> NDArray[np.float64]:
        """Return the coordinates of rows, shape (n, 3), finite or not; NaN where the file marks them as withheld."""
        points = np.empty((len(table), 3))
        with np.errstate(all="ignore"):  # a signalling NaN is a NaN
            for axis, name in enumerate(coordinate_names(self.dtype.names or ())):
                points[:, axis] = table[name]
        points[withheld_rows(table, self.source.format)] = np.nan
        return points

    def few(self, count: int) -> PointCloud:
        """Return a cloud of the first rows that have coordinates, to try what can be written."""
        for table in self.parts():
            points = self.coordinates(table)
            on = np.flatnonzero(np.isfinite(points).all(axis=1))[:count]
            if len(on):
                return PointCloud(points[on], None if self.bare else table[on], None, self.source)
        raise InputError(printable(self.source.file), "no point has finite coordinates", "export the file again")


@contextmanager
def opened(path: str | Path, digest: str) -> Iterator[Input]:
    """Open a file as an input without copying it."""
    with Path(path).open("rb") as file:
        yield Input(printable(path), file, os.fstat(file.fileno()).st_size, digest, Path(path))


def parts_of_raw(path: Path, dtype: np.dtype[np.void], rows: int, offset: int = 0) -> Parts:
    """Return what reads rows of a type from a place in a file on."""

    def parts() -> Iterator[NDArray[np.void]]:
        with path.open("rb") as file:
            file.seek(offset)
            for start in range(0, rows, ROWS):
                count = min(ROWS, rows - start)
                data = file.read(count * dtype.itemsize)
                if len(data) < count * dtype.itemsize:
                    raise InputError(printable(path), "was cut short meanwhile", "get a complete copy of the file")
                yield np.frombuffer(data, dtype)

    return parts
