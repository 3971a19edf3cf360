"""What was asked for with many scans in mind, and the folder that their outputs go to."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NamedTuple

from cylx.cli.batch.jobs import is_folder, is_slashed
from cylx.cli.batch.memory import cores, memory_available, memory_needed
from cylx.cli.batch.summary import LIST, TABLE
from cylx.errors import OutputError, UsageError

AUTO = 0


class Many(NamedTuple):
    """What was asked for with many scans in mind.

    Parameters
    ----------
    out_dir : str or None
        `--out-dir`.
    recursive : bool
        `--recursive`.
    jobs : int or None
        `--jobs`; 0 for as many as there is room for, None for this process alone.
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
        """Return what `-o` amounts to, a folder that is to be made having a slash at its end.

        Raises
        ------
        UsageError
            If `-o` is given, too, or the folder is something else.
        """
        if self.out_dir is None:
            return output
        if output is not None:
            raise UsageError("--out-dir", "is given beside -o", "leave one of them out")
        if Path(self.out_dir).exists() and not Path(self.out_dir).is_dir():
            raise UsageError(f"--out-dir {self.out_dir}", "is no folder", "choose another name")
        return self.out_dir if is_slashed(self.out_dir) else self.out_dir + os.sep

    def summaries(self, output: str | None, scans: Sequence[str]) -> list[str]:
        """Name the files of the summary; none of them if none is wanted.

        Raises
        ------
        UsageError
            If one is asked for, and there is no folder for it.
        """
        folder = output if output is not None and is_folder(output) else None
        if self.summary and folder is None:
            raise UsageError("--summary", "has no folder to go to", "name one by --out-dir")
        wanted = self.summary if self.summary is not None else len(scans) > 1
        return [] if folder is None or not wanted else [str(Path(folder) / name) for name in (TABLE, LIST)]

    def processes(self, scans: Sequence[str]) -> int | None:
        """Return the number of processes for some scans; None for this process alone."""
        if self.jobs is None or not scans:
            return None
        if self.jobs != AUTO:
            return min(self.jobs, len(scans))
        available, room, most = memory_available(), 0, min(cores(), len(scans))
        for need in sorted(map(memory_needed, scans), reverse=True)[:most]:
            if available is not None and need > available:
                break
            available = None if available is None else available - need
            room += 1
        return max(room, 1)


@contextmanager
def made_folder(output: str | None) -> Iterator[None]:
    """Make the folder that the outputs go to, if its name ends in a slash; remove it again if nothing came into it.

    Raises
    ------
    OutputError
        If it cannot be made.
    """
    if output is None or not is_slashed(output) or Path(output).is_dir():
        yield
        return
    try:
        Path(output).mkdir(parents=True)
    except (OSError, ValueError) as error:
        from cylx.io import printable

        fault = f"cannot be made: {(getattr(error, 'strerror', None) or str(error)).lower()}"
        raise OutputError(printable(output), fault, "choose another folder") from None
    try:
        yield
    finally:
        with suppress(OSError):
            Path(output).rmdir()
