"""Find the scans: files, folders, and patterns that no shell has expanded."""

from __future__ import annotations

import glob
import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NoReturn

from cylx.cli.batch.jobs import ANNOTATED
from cylx.cli.batch.summary import TABLE, is_own_table
from cylx.errors import InputError
from cylx.io.existing import has_file, has_folder
from cylx.io.outputs import STREAM


def find_scans(names: Sequence[str], *, recursive: bool) -> list[str]:
    """Replace folders and patterns by their files; a file that occurs twice is taken once.

    A folder stands for its files with a suffix that cylx reads, sorted by name. Hidden files and files written by cylx
    are left out.

    Parameters
    ----------
    names : sequence of str
        Files, `-`, folders, and patterns such as `scans/*.ply`.
    recursive : bool
        Whether subfolders are searched too.

    Raises
    ------
    InputError
        If a folder or a pattern has no scan, or the folder cannot be read.
    """
    found: dict[str, str] = {}
    for name in names:
        for scan in _scans_of(name, recursive=recursive):
            found.setdefault(scan if scan == STREAM else str(Path(scan).absolute()), scan)
    return list(found.values())


def _scans_of(name: str, *, recursive: bool) -> list[str]:
    """Return the scans that one argument stands for."""
    if name == STREAM:
        return [name]
    if has_folder(name):
        return _scans_in(name, recursive=recursive)
    if glob.has_magic(name) and not os.path.lexists(name):
        return _scans_like(name)
    return [name]


def _scans_in(folder: str, *, recursive: bool) -> list[str]:
    """Return the scans in a folder."""
    from cylx.io import cloud_suffix, cloud_suffixes, printable

    suffixes = cloud_suffixes()
    scans = [path for path in _files_in(folder, recursive=recursive) if cloud_suffix(path) in suffixes]
    scans = [path for path in scans if _is_foreign(path)]
    if not scans:
        where = "in it or below" if recursive else "in it"
        fault = f"is a folder with no scan {where}"
        raise InputError(printable(folder), fault, f"give files, or a folder of {' '.join(suffixes)}")
    return scans


def _scans_like(pattern: str) -> list[str]:
    """Return the files that match a pattern: those of its suffix, or of any suffix of clouds if it has none."""
    from cylx.io import cloud_suffix, cloud_suffixes, printable

    suffix = Path(pattern).suffix
    any_suffix = suffix != "" and not glob.has_magic(suffix)
    files = sorted(path for path in glob.glob(pattern, recursive=True) if has_file(path))  # noqa: PTH207  as a shell
    suffixes = cloud_suffixes()
    scans = [path for path in files if any_suffix or cloud_suffix(path) in suffixes]
    scans = [path for path in scans if _is_foreign(path)]
    if not scans:
        raise InputError(printable(pattern), "no file matches", "check the pattern and the folder")
    return scans


def _files_in(folder: str, *, recursive: bool) -> Iterator[str]:
    """Yield the files of a folder by name, then those of its subfolders, without hidden files and links to folders."""

    def refuse(error: OSError) -> NoReturn:
        from cylx.io import printable

        fault = f"cannot be read: {(error.strerror or str(error)).lower()}"
        raise InputError(
            printable(error.filename or folder), fault, "change its permissions, or leave it out"
        ) from None

    for place, folders, files in os.walk(folder, onerror=refuse):
        folders[:] = sorted(name for name in folders if recursive and not name.startswith("."))
        shown = sorted(name for name in files if not name.startswith("."))
        paths = (Path(place, name) for name in shown)
        yield from (str(path) for path in paths if has_file(path))  # no pipe, and no link to a device


def _is_foreign(path: str) -> bool:
    """Return whether a file that looks like a scan was not written by cylx."""
    name = Path(path).name
    return Path(name).stem[-len(ANNOTATED) :] != ANNOTATED and not (name == TABLE and is_own_table(path))
