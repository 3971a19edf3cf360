"""Process one scan of a call of `cylx extract`: read it, find its cylinders, write and report them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from cylx.cli.batch.annotated import check_format
from cylx.cli.batch.jobs import Job
from cylx.cli.batch.meshes import check_unit
from cylx.cli.batch.outcomes import Finished, Outcome, check_finished, failed_outcome, failure_of
from cylx.cli.batch.writing import write_job
from cylx.cli.options.tiles import NO_TILES, TileOptions
from cylx.cli.terminal.failures import blamed_on
from cylx.cli.terminal.signals import Listener, check_heard
from cylx.cli.terminal.stopwatch import Stopwatch, peak_memory

if TYPE_CHECKING:
    from cylx.cli.terminal.display import Messages
    from cylx.config import Config
    from cylx.records import Selection


@dataclass(frozen=True)
class Run:
    """How the scans of one call of `cylx extract` are processed.

    Parameters
    ----------
    settings : Config
        The configuration.
    threads : int or None
        Number of threads.
    require : int or None
        Minimum number of cylinders in each scan.
    overwrite : bool
        Whether existing files may be replaced.
    messages : Messages
        Where messages are shown.
    selection : Selection
        Which points are used.
    tiles : TileOptions
        When to cut a scan into tiles, and how.
    processes : int or None
        Number of processes that search tiles; None for this one alone.
    resume : bool
        Whether tiles of an earlier run are gone on with.
    others : tuple of Job
        Further files that are one cloud with the scan.
    runs : bool
        Whether the cylinders are joined to runs.
    """

    settings: Config
    threads: int | None
    require: int | None
    overwrite: bool
    messages: Messages
    selection: Selection
    tiles: TileOptions = NO_TILES
    processes: int | None = None
    resume: bool = False
    others: tuple[Job, ...] = ()
    runs: bool = False

    def extract_one(self, job: Job) -> Finished:
        """Read a scan, find its cylinders, write them, and report them.

        Raises
        ------
        InputError
            If the scan cannot be read or used.
        OutputError
            If the JSON cannot be written; what went wrong with the other outputs is in what is returned.
        """
        from cylx.cli.batch.tiled import TiledRun, check_tiles, extract_tiled, needs_tiles, why_tiles

        if needs_tiles(job.scan, self.tiles):
            if not self.tiles.certain:
                check_tiles([job], self.settings, runs=self.runs)
                self.messages.say(why_tiles(job.scan, self.tiles))
            how = TiledRun(
                self.settings,
                self.threads,
                self.overwrite,
                self.messages,
                self.selection,
                self.tiles,
                self.processes,
                self.resume,
            )
            return extract_tiled(how, [job, *self.others])
        return self._extract_whole(job)

    def _extract_whole(self, job: Job) -> Finished:
        """Extract a scan that fits into memory, as `extract_one` does."""
        from cylx.cli.batch.found import report
        from cylx.cli.terminal.display import Observers, observed
        from cylx.cli.terminal.startup import collect_rarely, import_numba_without_blas

        collect_rarely()
        import_numba_without_blas()
        from cylx.api.piping import find_runs
        from cylx.api.warmup import ask_between_kernels, compile_kernels
        from cylx.io import read_cloud
        from cylx.io.inputs import check_unchanged, stamp_of
        from cylx.pipeline import extract_cylinders
        from cylx.scene import select

        ask_between_kernels(check_heard)
        stopwatch, stamp = Stopwatch(job.scan), stamp_of(job.scan)
        with self.messages.progress() as display:
            observer = Observers(Listener(), display, stopwatch)
            with observed(observer, "reading"):
                cloud = select(read_cloud(job.scan, scan=self.selection.scan, units=job.units), self.selection)
            check_unit(job.mesh, cloud.source.units)
            job, notes = check_format(job, cloud, overwrite=self.overwrite)
            compile_kernels(observer)
            extraction = extract_cylinders(cloud, self.settings, threads=self.threads, observer=observer)
            if self.runs:
                extraction = find_runs(extraction, observer=observer)
            check_unchanged(job.scan, stamp, cloud.source.sha256)
            with observed(observer, "writing"):
                written = write_job(job, extraction, overwrite=self.overwrite)
        found = len(extraction.cylinders)
        profile = stopwatch.report(cloud.rows, found)
        report(self.messages, written.job, extraction)
        for remark in written.remarks:
            self.messages.say(f"warning: {remark}")
        notes = [*cloud.source.notes, *notes]
        for note in notes:
            self.messages.say(f"note: {note}")
        return Finished(
            cloud.rows,
            found,
            extraction.warnings,
            profile,
            len(extraction.blends or ()),
            notes,
            list(written.failed),
            failure_of(job.scan, written.failed),
        )


def attempt(run: Run, debug: bool, job: Job) -> Outcome:
    """Process a scan and return the outcome; a failure does not stop the other scans."""
    finished = None
    try:
        with blamed_on(job.scan):
            finished = run.extract_one(job)
        check_finished(job, finished, run.require)
    except Exception as failure:  # noqa: BLE001  reported with exit code and traceback; a bug is reported as a bug
        return failed_outcome(failure, finished, debug=debug)
    return Outcome("done", finished, peak=peak_memory())
