"""Several outputs that appear together or not at all."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator, Mapping
from pathlib import Path

STREAM = "-"


def write_together(contents: Mapping[str, bytes], *, overwrite: bool) -> None:
    """Write several files, all or nothing.

    Parameters
    ----------
    contents : mapping of str to bytes
        What to write, by file; not to streams.
    overwrite : bool
        Whether files that exist may be replaced.

    Raises
    ------
    OutputError
        If one of them cannot be written.
    """
    from cylx.io import write_bytes

    with contextlib.ExitStack() as stack:
        for name, data in contents.items():
            write_bytes(stack.enter_context(moved_at_the_end(name, overwrite=overwrite)), data, overwrite=overwrite)


@contextlib.contextmanager
def moved_at_the_end(name: str, *, overwrite: bool) -> Iterator[str | Path]:
    """Give a temporary name beside `name`, moved there if all goes well, removed if not.

    A stream or a device has no other name than its own.
    """
    from cylx.io import check_writable, temporary_beside

    if name == STREAM or not (Path(name).is_file() or not Path(name).exists()):
        yield name
        return
    check_writable(name, overwrite=overwrite)
    target = Path(os.path.realpath(name))
    staged = temporary_beside(target, target.suffix)
    try:
        yield staged
        staged.replace(target)
    finally:
        staged.unlink(missing_ok=True)
