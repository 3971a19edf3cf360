"""Choose the columns of a text: which are x, y and z, which are kept, and what the reader is told about it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from cylx.errors import InputError
from cylx.io.cells import is_missing, is_number, plain_number
from cylx.io.columns import Coordinates, is_other, named_axes, named_coordinates
from cylx.io.inputs import excerpt
from cylx.io.names import mended_names
from cylx.io.text_top import Top, names_of, words_of

_RENAME = "name the columns x, y and z"
_RUN = 10
"""So many rows numbered one by one are numbered, whatever else they hold."""
_FEW = 3
"""Fewer rows than this do not show whether they are numbered."""


@dataclass(frozen=True, slots=True)
class Columns:
    """The columns of a text.

    Parameters
    ----------
    names : list of str
        Names of the columns that are kept; three of them are x, y and z.
    kept : tuple of int or None
        Indices of these columns; None for all.
    width : int
        Number of columns in the text.
    notes : tuple of str
        What to tell whoever runs this, one line each.
    doubts : tuple of (str, str)
        What may be wrong, with a remedy.
    """

    names: list[str]
    kept: tuple[int, ...] | None
    width: int
    notes: tuple[str, ...] = ()
    doubts: tuple[tuple[str, str], ...] = ()


def choose_columns(top: Top, place: str) -> Columns:
    """Choose the columns of a text by their names, or else by what the first rows look like.

    Parameters
    ----------
    top : Top
        The lines above the rows, and the first rows.
    place : str
        Name of the file.

    Raises
    ------
    InputError
        If the names and the rows contradict each other.
    """
    width = len(top.rows[0])
    rows = [row for row in top.rows if len(row) == width] or top.rows[:1]
    names = names_of(top.header, width, top.delimiter) if top.header else []
    if names and _is_mark(top, names, rows, width):
        names = []
    found = named_coordinates(names) if names else None
    if found is None and not names and top.header:
        found = _aligned(top, rows, width, place)
    words = _word_columns(rows, width, () if found is None else found.places)
    kept = [column for column in range(width) if column not in words]
    notes = [found.note] if found is not None and found.note else []
    doubts = [(found.doubt[0], found.doubt[1])] if found is not None and found.doubt else []
    if found is None:
        found, note, doubts = _by_place(names, rows, kept, width, place)
        notes += [note] if note else []
    if words:
        notes.append(_left_out(names, words))
    labels = _labels(names, width, found.places)
    only = None if len(kept) == width else tuple(kept)
    return Columns([labels[column] for column in kept], only, width, tuple(notes), tuple(doubts))


def _is_mark(top: Top, names: Sequence[str], rows: Sequence[Sequence[str]], width: int) -> bool:
    """Return whether a `#` that begins the names is the mark of a comment rather than a name."""
    bare = words_of(top.header, top.delimiter)
    if names[0] not in ("#", "//") or len(bare) != width - 1 or named_coordinates(bare) is None:
        return False
    return names[0] == "//" or not _is_numbered(rows, [*range(width)])


def _aligned(top: Top, rows: Sequence[Sequence[str]], width: int, place: str) -> Coordinates | None:
    """Find the coordinates by names that are more or fewer than the columns, if they are the first or the last.

    A column of row names, as R writes it, has no name.
    """
    said = words_of(top.header, top.delimiter)
    found = named_coordinates(said)
    if found is None:
        return None
    ordinary = is_number(plain_number(rows[0][0])) and not _is_numbered(rows, [*range(width)])
    if len(said) == width - 1 and not ordinary:
        x, y, z = (column + 1 for column in found.places)
        fault = (
            f"the first column has no name and seems to name the points; x, y, z are columns {x + 1}, {y + 1}, {z + 1}"
        )
        return Coordinates((x, y, z), found.doubt or (fault, "name every column"))
    if sorted(found.places) == [0, 1, 2]:
        if top.delimiter == "," and width == 2 * len(said) and _are_halves(top.rows, width):
            remedy = "write numbers with a point, or semicolons between the columns"
            raise InputError(place, f"has {len(said)} names and {width} columns, as decimal commas give", remedy)
        return found
    if top.commented or max(found.places) - min(found.places) != 2:  # or a title that has these letters
        return None
    if sorted(found.places) == [len(said) - 3, len(said) - 2, len(said) - 1]:
        x, y, z = (column + width - len(said) for column in found.places)
        if min(x, y, z) >= 0:
            return Coordinates((x, y, z), found.doubt)
    raise InputError(place, f"has {len(said)} names for {width} columns", "give each column one name")


def _are_halves(rows: Sequence[Sequence[str]], width: int) -> bool:
    """Return whether every second column has digits alone, as behind a decimal comma."""
    return all(row[column].isdecimal() for row in rows if len(row) == width for column in range(1, width, 2))


def _word_columns(rows: Sequence[Sequence[str]], width: int, coordinates: Sequence[int]) -> list[int]:
    """Return the columns of words: the first row has one there, or most rows have."""
    found = []
    for column in range(width):
        if column in coordinates:
            continue
        cells = [row[column] for row in rows if not is_missing(row[column])]
        words = [cell for cell in cells if not is_number(plain_number(cell))]
        first = bool(words) and words[0] == rows[0][column]
        if first or 2 * len(words) > len(cells):
            found.append(column)
    return found


def _by_place(
    names: Sequence[str], rows: Sequence[Sequence[str]], kept: Sequence[int], width: int, place: str
) -> tuple[Coordinates, str, list[tuple[str, str]]]:
    """Take the first three columns of numbers, or those behind a point number, and say so."""
    if len(kept) < 3:
        raise InputError(place, f"has {len(kept)} columns of numbers, not three", "give rows of x y z")
    numbered = _is_numbered(rows, kept)
    x, y, z = kept[1:4] if numbered else kept[:3]
    _refuse_contradiction(names, (x, y, z), place)
    taken = ", ".join(_shown(names, column) for column in (x, y, z))
    if numbered:
        fault = f"{_shown(names, kept[0])} seems to number the points; x, y, z are {taken}"
        return Coordinates((x, y, z)), "", [(fault, _RENAME)]
    if names:
        note = f"the names of the columns do not tell the coordinates; x, y, z are {taken}"
    elif width > 3:
        note = f"no line names the columns; x, y, z are {taken} of {width}"
    else:
        note = ""
    return Coordinates((x, y, z)), note, []


def _refuse_contradiction(names: Sequence[str], taken: Sequence[int], place: str) -> None:
    """Refuse columns of which two are named after other axes or other things; a single word may be one of a title."""
    axes = named_axes(names)
    colored = {"r", "g", "b"} <= {name.lower() for name in names}
    given = [names[column] for column in taken if names]
    others = [name for name in given if is_other(name) or (colored and name.lower() in "rgb")]
    if len(others) + len(axes) > 1 and others:
        raise InputError(place, f"no columns are called x, y and z, and {excerpt(others[0])} is none of them", _RENAME)
    if len(axes) < 2:
        return
    for axis, column in axes.items():
        if column in taken and taken["xyz".index(axis)] != column:
            missing = ", ".join(other for other in "xyz" if other not in axes)
            raise InputError(place, f"has a column {excerpt(names[column])}, but none for {missing}", _RENAME)


def _is_numbered(rows: Sequence[Sequence[str]], kept: Sequence[int]) -> bool:
    """Return whether the first column of numbers counts the points."""
    if len(kept) < 4 or len(rows) < _FEW:
        return False
    first = [row[kept[0]] for row in rows]
    if not all(cell.isascii() and cell.isdecimal() and len(cell) < 19 for cell in first):
        return False
    numbers = [int(cell) for cell in first]
    one_by_one = all(after - before == 1 for before, after in pairwise(numbers))
    if one_by_one and len(rows) >= _RUN:
        return True
    broken = all(any(_has_mark(row[column]) for row in rows) for column in kept[1:4])
    return broken and (one_by_one or (len(rows) >= _RUN and len(set(numbers)) == len(numbers)))


def _has_mark(cell: str) -> bool:
    """Return whether a number has a decimal mark."""
    return "." in cell or "," in cell


def _shown(names: Sequence[str], column: int) -> str:
    return excerpt(names[column]) if names and names[column] else f"column {column + 1}"


def _left_out(names: Sequence[str], words: Sequence[int]) -> str:
    shown = ", ".join(_shown(names, column) for column in words[:3]) + (" …" if len(words) > 3 else "")
    return f"left out, as {'it holds' if len(words) == 1 else 'they hold'} words: {shown}"


def _labels(names: Sequence[str], width: int, coordinates: Sequence[int]) -> list[str]:
    """Return the names of all columns; if a name is needed twice, the coordinate keeps it."""
    labels = [*names] if names else [f"column_{column + 1}" for column in range(width)]
    for axis, column in zip("xyz", coordinates, strict=True):
        labels[column] = axis
    order = sorted(range(width), key=lambda column: column not in coordinates)
    mended = dict(zip(order, mended_names([labels[column] for column in order]), strict=True))
    return [mended[column] for column in range(width)]
