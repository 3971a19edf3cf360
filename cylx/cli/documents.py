"""Two JSON documents that are held against each other."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from cylx.errors import InputError


@contextmanager
def called_by_file(files: Mapping[str, str]) -> Iterator[None]:
    """Let errors about a document name its file.

    Parameters
    ----------
    files : mapping of str to str
        What the library calls the document, and its file.
    """
    try:
        yield
    except InputError as error:
        for name, file in files.items():
            if error.place.startswith(name):
                rest = error.place.removeprefix(name).lstrip(".")
                raise InputError(f"{file}: {rest}" if rest else file, error.fault, error.remedy) from error
        raise
