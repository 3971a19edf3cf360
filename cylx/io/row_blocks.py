"""Rows of numbers in text, read block by block into a file, so that no more than a block is in memory."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import islice
from typing import IO, TYPE_CHECKING

from cylx.io.row_checks import checked_lines
from cylx.io.row_format import RowFormat, short_of_points, wrong_count
from cylx.io.rows import is_plain, load_lines, picked_lines, short_lines, text_lines

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from cylx.io.inputs import Input


def spool_rows(source: Input, rows: RowFormat, file: IO[bytes], size: int) -> int:
    """Read rows of numbers as `read_rows` does, and write them to a file without a header.

    Parameters
    ----------
    source : Input
    rows : RowFormat
    file : binary file
        Empty, and open for writing.
    size : int
        Lines of a block.

    Returns
    -------
    int
        Number of rows.

    Raises
    ------
    InputError
        As `read_rows`.
    """
    plain, done = is_plain(source, rows), None
    for reader, wanted in ((short_lines, plain), (picked_lines, rows.loose)):
        if not wanted:
            continue
        try:
            with text_lines(source, rows.offset, rows.encoding) as lines:
                mark = rows.delimiter if reader is short_lines else None
                done = _write(_blocks(reader(lines, rows), rows, mark, size), file)
        except (ValueError, DeprecationWarning):  # the lines need a closer look, from the first one on
            file.seek(0)
            file.truncate()
            continue
        if rows.promised is not None and rows.promised != done:
            raise wrong_count(source.place, rows.promised, done)
        break
    if done is None:
        with text_lines(source, rows.offset, rows.encoding) as lines:
            done = _write(_blocks(checked_lines(lines, rows, source.place), rows, None, size), file)
    if rows.count is not None and done < rows.count:
        raise short_of_points(source.place, rows.count, done)
    return done


def _blocks(lines: Iterable[str], rows: RowFormat, mark: str | None, size: int) -> Iterator[NDArray[np.void]]:
    """Yield the rows of lines, which are separated by a mark or white space, block by block."""
    left, bare = iter(lines), replace(rows, skip=0)
    next(islice(left, rows.skip, rows.skip), None)
    missing = rows.count
    while missing is None or missing > 0:
        block = list(islice(left, size))
        if not block:
            return
        table = load_lines(block, bare, mark, missing)
        if missing is not None:
            missing -= len(table)
        yield table


def _write(blocks: Iterable[NDArray[np.void]], file: IO[bytes]) -> int:
    done = 0
    for block in blocks:
        file.write(block.tobytes())
        done += len(block)
    return done
