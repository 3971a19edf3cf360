"""`cylx extract`: a cloud in, cylinders out."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import click

from cylx.cli.failures import describe_failure, tell
from cylx.cli.group import ExampleCommand
from cylx.cli.options import complete_files, configured, debug_option, overwrite_option, talking
from cylx.cli.outputs import Job, check_apart, check_outputs, plan_jobs, write_job
from cylx.cli.stopwatch import Stopwatch, peak_memory
from cylx.errors import BatchError, CylxError, NothingFoundError

if TYPE_CHECKING:
    from cylx.cli.display import Conversation
    from cylx.config import Config
    from cylx.records import Extraction


@click.command(
    cls=ExampleCommand, examples=["cylx extract scan.ply", "cylx extract scans/*.ply --radius 0.01:0.2 -o results/"]
)
@click.argument("scans", metavar="SCAN...", nargs=-1, required=True, shell_complete=complete_files)
@click.option(
    "-o",
    "--output",
    metavar="FILE",
    shell_complete=complete_files,
    help="The JSON; - for standard output, or a folder.  [default: beside the scan]",
)
@click.option(
    "--annotate/--no-annotate",
    default=None,
    help="Write the cloud with the cylinder of each point.  [default: yes, unless the JSON goes to standard output]",
)
@click.option(
    "--annotated",
    metavar="FILE",
    shell_complete=complete_files,
    help="Name of the annotated PLY.  [default: beside the JSON]",
)
@click.option(
    "--rejected",
    metavar="FILE",
    shell_complete=complete_files,
    help="Write what was not accepted, and why, as JSON; - for standard output, or a folder.",
)
@click.option(
    "--report",
    metavar="FILE",
    shell_complete=complete_files,
    help="Write a page for the browser: the cloud and its cylinders in 3-D; - for standard output, or a folder.",
)
@click.option(
    "--png",
    metavar="FILE",
    shell_complete=complete_files,
    help="Write a picture of the cloud and its cylinders; - for standard output, or a folder. Needs matplotlib.",
)
@configured
@click.option("--threads", type=click.IntRange(min=1), metavar="N", help="Threads to use.  [default: one a core]")
@click.option(
    "--require", type=click.IntRange(min=1), metavar="N", help="Exit with 5 if fewer cylinders are found; still write."
)
@click.option(
    "--profile",
    metavar="FILE",
    shell_complete=complete_files,
    help="Write seconds per stage and peak memory as JSON.",
)
@overwrite_option
@talking
@debug_option
def extract(
    *,
    scans: tuple[str, ...],
    output: str | None,
    annotate: bool | None,
    annotated: str | None,
    rejected: str | None,
    report: str | None,
    png: str | None,
    settings: Config,
    threads: int | None,
    require: int | None,
    profile: str | None,
    overwrite: bool,
    talk: Conversation,
) -> None:
    """Find the cylinders of one or several scans.

    SCAN is a PLY, PCD or XYZ file, or - for standard input. For scan.ply this writes scan.cylinders.json, the
    cylinders, and scan.annotated.ply, the cloud with the cylinder of each point; with --report FILE a page to look at,
    too. Nothing has to be tuned: spacing, noise and radii are read off the cloud, in whatever unit it comes. A table of
    what was found goes to standard error.
    """
    jobs = plan_jobs(scans, output, annotate, annotated, rejected, report, png)
    extras = [] if profile is None else [profile]
    check_apart(scans, [*(name for job in jobs for name in job.outputs), *extras])
    check_outputs(jobs, extras, overwrite=overwrite)
    if png is not None:
        from cylx.report import check_pictures

        check_pictures()
    run = Run(settings, threads, require, overwrite, talk)
    try:
        run.extract_all(jobs)
    finally:
        if profile is not None and run.profiles:
            run.write_profile(profile)


class Run:
    """One call of `cylx extract`.

    Parameters
    ----------
    settings : Config
        The configuration.
    threads : int or None
        Number of threads.
    require : int or None
        Fewest cylinders in each scan.
    overwrite : bool
        Whether files that exist may be replaced.
    talk : Conversation
        What is shown.
    """

    def __init__(
        self, settings: Config, threads: int | None, require: int | None, overwrite: bool, talk: Conversation
    ) -> None:
        self.settings = settings
        self.threads = threads
        self.require = require
        self.overwrite = overwrite
        self.talk = talk
        self.profiles: list[dict[str, object]] = []

    def extract_all(self, jobs: list[Job]) -> None:
        """Take one scan after the other; of several, a failing one does not stop the rest.

        Raises
        ------
        CylxError
            If the only scan failed.
        BatchError
            If some of several failed.
        """
        if len(jobs) == 1:
            self.extract_one(jobs[0])
            return
        failed = 0
        for job in jobs:
            try:
                self.extract_one(job)
            except (CylxError, MemoryError) as failure:
                tell(describe_failure(failure)[0])
                failed += 1
        if failed:
            raise BatchError(f"{failed} of {len(jobs)} inputs", "failed", "see the lines above; the others are done")

    def extract_one(self, job: Job) -> None:
        """Read a scan, find its cylinders, write them, and say so.

        Raises
        ------
        InputError
            If the scan cannot be read or used.
        OutputError
            If the outputs cannot be written.
        NothingFoundError
            If there are fewer cylinders than required; the outputs are written.
        """
        from cylx.cli.display import Observers, observed
        from cylx.io import read_cloud
        from cylx.pipeline import extract_cylinders

        stopwatch = Stopwatch(job.scan)
        with self.talk.progress() as display:
            observer = Observers(display, stopwatch)
            with observed(observer, "reading"):
                cloud = read_cloud(job.scan)
            extraction = extract_cylinders(cloud, self.settings, threads=self.threads, observer=observer)
            with observed(observer, "writing"):
                write_job(job, extraction, overwrite=self.overwrite)
        self.profiles.append(stopwatch.report(cloud.rows, len(extraction.cylinders)))
        self.talk.report(job, extraction)
        self._check_required(job, extraction)

    def write_profile(self, path: str) -> None:
        """Write the times of all scans that were finished."""
        from cylx import __version__
        from cylx.io import write_text

        profile = {"cylx_version": __version__, "inputs": self.profiles, "peak_memory_bytes": peak_memory()}
        write_text(path, json.dumps(profile, indent=2) + "\n", overwrite=self.overwrite)

    def _check_required(self, job: Job, extraction: Extraction) -> None:
        """Refuse to be content with fewer cylinders than required."""
        found = len(extraction.cylinders)
        if self.require is not None and found < self.require:
            fault = f"{found} found, {self.require} required"
            raise NothingFoundError(job.scan, f"cylinders: {fault}", "look at the scan, or require fewer")
