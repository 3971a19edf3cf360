"""What rows of numbers in a text are, and what is said of those that are too few."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from cylx.errors import InputError

if TYPE_CHECKING:
    import numpy as np

LONGEST_LINE = 1 << 20
"""Letters of a line: more than any table of points has."""


@dataclass(frozen=True, slots=True)
class RowFormat:
    """The format and position of the rows.

    Parameters
    ----------
    dtype : dtype
        Structured: one scalar field per column.
    offset : int
        Byte at which the text begins.
    line : int
        Number of that line in the file, from 1.
    skip : int
        Lines to skip from there.
    count : int or None
        Number of rows to read; None for all.
    delimiter : str or None
        Separator of the columns; None for white space.
    commented : bool
        Whether `#` and `//` begin a comment.
    encoding : str
        Of the text.
    kept : tuple of int, optional
        Which columns are read, ascending, if not all of them.
    columns : int, optional
        Number of columns of the text, if it is not that of the fields.
    promised : int, optional
        Number of rows that a line above the first row promised. Lines of a count between the rows add to it.
    header : str
        The line of names, which may come again.
    loose : bool
        Whether an empty value is missing (NaN), and a comma may be the decimal mark.
    """

    dtype: np.dtype[np.void]
    offset: int = 0
    line: int = 1
    skip: int = 0
    count: int | None = None
    delimiter: str | None = None
    commented: bool = False
    encoding: str = "utf-8-sig"
    kept: tuple[int, ...] | None = None
    columns: int | None = None
    promised: int | None = None
    header: str = ""
    loose: bool = False

    @property
    def width(self) -> int:
        """Number of columns of the text."""
        return len(self.dtype.names or ()) if self.columns is None else self.columns


def short_of_points(place: str, promised: int, found: int, *, at_most: bool = False) -> InputError:
    """Return the error for a file whose body is shorter than its header says."""
    held = f"at most {found}" if at_most else f"{found}"
    return InputError(
        place, f"the header promises {promised} points, the file holds {held}", "get a complete copy of the file"
    )


def wrong_count(place: str, promised: int, found: int) -> InputError:
    """Return the error for a count of rows that is not theirs."""
    fault = f"the count in the first line is {promised}, the file holds {found} points"
    return InputError(place, fault, "get a complete copy of the file, or correct the count")
