"""The options for many scans, and the folder for their outputs."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NamedTuple

from cylx.cli.batch.jobs import is_folder, is_slashed
from cylx.cli.batch.memory import cores, free_memory, memory_needed
from cylx.cli.batch.summary import LIST, TABLE
from cylx.errors import OutputError, UsageError
from cylx.io.existing import has_anything, has_folder

AUTO = 0


class BatchOptions(NamedTuple):
    """The options for many scans.

    Parameters
    ----------
    out_dir : str or None
        `--out-dir`.
    recursive : bool
        `--recursive`.
    jobs : int or None
        `--jobs`; 0 for as many as cores and memory allow, None for this process alone.
    resume : bool
        `--resume`.
    summary : bool or None
        `--summary` or `--no-summary`, None for neither.
    """

    out_dir: str | None
    recursive: bool
    jobs: int | None
    resume: bool
    summary: bool | None

    def output(self, output: str | None) -> str | None:
        """Return the value of `-o` or `--out-dir`; a folder that has to be created ends in a slash.

        Raises
        ------
        UsageError
            If both are given, or the folder is a file.
        """
        if self.out_dir is None:
            return output
        if output is not None:
            raise UsageError("--out-dir", "cannot be combined with -o", "leave one of them out")
        if has_anything(self.out_dir) and not has_folder(self.out_dir):
            raise UsageError(f"--out-dir {self.out_dir}", "is not a folder", "choose another name")
        return self.out_dir if is_slashed(self.out_dir) else self.out_dir + os.sep

    def summaries(self, output: str | None, scans: Sequence[str]) -> list[str]:
        """Return the names of the summary files; empty if no summary is wanted.

        Raises
        ------
        UsageError
            If a summary is requested and there is no folder for it.
        """
        folder = output if output is not None and is_folder(output) else None
        if self.summary and folder is None:
            raise UsageError("--summary", "needs a folder for its files", "name one by --out-dir")
        wanted = self.summary if self.summary is not None else len(scans) > 1
        return [] if folder is None or not wanted else [str(Path(folder) / name) for name in (TABLE, LIST)]

    def processes(self, scans: Sequence[str]) -> int | None:
        """Return the number of processes for these scans; None for this process alone."""
        if self.jobs is None or not scans:
            return None
        if self.jobs != AUTO:
            return min(self.jobs, len(scans))
        available, room, most = free_memory(), 0, min(cores(), len(scans))
        for need in sorted(map(memory_needed, scans), reverse=True)[:most]:
            if available is not None and need > available:
                break
            available = None if available is None else available - need
            room += 1
        return max(room, 1)

    def tile_processes(self) -> int | None:
        """Return the number of processes that search tiles; None for this process alone."""
        return cores() if self.jobs == AUTO else self.jobs


@contextmanager
def made_folder(output: str | None) -> Iterator[None]:
    """Create the output folder if its name ends in a slash; remove it again if it stays empty.

    Raises
    ------
    OutputError
        If it cannot be created.
    """
    if output is None or not is_slashed(output) or has_folder(output):
        yield
        return
    try:
        Path(output).mkdir(parents=True)
    except (OSError, ValueError) as error:
        from cylx.io import printable

        fault = f"cannot be created: {(getattr(error, 'strerror', None) or str(error)).lower()}"
        raise OutputError(printable(output), fault, "choose another folder") from None
    try:
        yield
    finally:
        with suppress(OSError):
            Path(output).rmdir()
