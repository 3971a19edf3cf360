"""Run all scans of one call, in this process or in several, and report the outcome of each."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from contextlib import closing
from dataclasses import replace
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

import click

from cylx.cli.batch.found import found_line
from cylx.cli.batch.memory import cores, memory_needed
from cylx.cli.batch.outcomes import Finished, Outcome, check_finished, entry_of, failed_outcome, lost_outcome
from cylx.cli.batch.resume import check_own, finished_before, is_own_json, written_by
from cylx.cli.batch.run import attempt
from cylx.cli.batch.summary import LIST, is_own_table, list_text, table_text
from cylx.cli.terminal.display import Messages, show_table
from cylx.cli.terminal.failures import DEBUG, tell
from cylx.cli.terminal.signals import check_heard
from cylx.cli.terminal.stopwatch import peak_memory
from cylx.errors import BatchError, NothingFoundError, OutputError
from cylx.io.existing import has_file

if TYPE_CHECKING:
    from cylx.cli.batch.jobs import Job
    from cylx.cli.batch.options import BatchOptions
    from cylx.cli.batch.run import Run

SHORT = 20
"""With fewer scans than this, each one gets a line of its own."""


class Batch:
    """The scans of one call of `cylx extract`.

    Parameters
    ----------
    run : Run
        How one scan is processed.
    jobs : list of Job
        The scans.
    options : BatchOptions
        The options about many scans.
    summaries : list of str
        Names of the summary files to write; empty for no summary.
    """

    def __init__(self, run: Run, jobs: list[Job], options: BatchOptions, summaries: list[str]) -> None:
        self.run = run
        self.jobs = jobs
        self.options = options
        self.summaries = summaries
        self.outcomes: dict[int, Outcome] = {}

    def check(self, *, overwrite: bool) -> None:
        """Refuse to overwrite files that cylx did not write, or an existing summary that must not be replaced.

        Raises
        ------
        OutputError
            If such a file exists.
        """
        from cylx.io import check_writable, printable

        if self.options.resume and not overwrite:
            check_own(self.jobs)
        for name in self.summaries:
            old = has_file(name)
            if old and not overwrite and not (self.options.resume and self._is_summary(name)):
                remedy = "give --resume, --overwrite or --no-summary, or another folder"
                raise OutputError(printable(name), "exists already", remedy)
            check_writable(name, overwrite=True)

    def go(self) -> None:
        """Process all scans that are not finished, show the outcomes, and write the summary.

        Raises
        ------
        CylxError
            If the only scan failed.
        BatchError
            If some of several failed.
        """
        if len(self.jobs) == 1:
            self._do_only(self.jobs[0])
            return
        started = perf_counter()
        with self.run.messages.counting(len(self.jobs)) as advance:
            for index, outcome in self._outcomes():
                check_heard()
                self.outcomes[index] = outcome
                self._show(self.jobs[index], outcome)
                advance()
        self._sum_up()
        failed = sum(outcome.status == "failed" for outcome in self.outcomes.values())
        self._show_counts(failed, perf_counter() - started)
        if failed:
            fault = f"{failed} of {len(self.jobs)} inputs"
            raise BatchError(fault, "failed", "see the lines above; the others are done")

    @property
    def profiles(self) -> list[dict[str, object]]:
        """The times of the finished scans, in the order of the scans."""
        known = (self.outcomes[index].finished for index in sorted(self.outcomes))
        return [finished.profile for finished in known if finished is not None and finished.profile is not None]

    @property
    def peak(self) -> int | None:
        """The largest memory use of any process, bytes."""
        return max((outcome.peak for outcome in self.outcomes.values() if outcome.peak is not None), default=None)

    def _do_only(self, job: Job) -> None:
        """Process a single scan in this process, showing its progress and its cylinders."""
        try:
            before = self._finished_before(job)
            finished = self.run.extract_one(job) if before is None else before
            self.outcomes[0] = Outcome("done", finished, peak=peak_memory())
            if before is not None:
                self.run.messages.say(f"{found_line(job, finished.cylinders, finished.blends)} before")
            check_finished(job, finished, self.run.require)
        except Exception as failure:
            known = self.outcomes.get(0)
            self.outcomes[0] = failed_outcome(failure, None if known is None else known.finished, debug=False)
            self._sum_up()
            raise
        self._sum_up()

    def _outcomes(self) -> Generator[tuple[int, Outcome], None, None]:
        """Yield the index and the outcome of each scan, those finished earlier first."""
        todo = []
        if self.options.resume:
            self._tidy()
        for index, job in enumerate(self.jobs):
            finished = self._finished_before(job)
            if finished is None:
                todo.append(index)
            else:
                yield index, self._skipped(job, finished)
        jobs = [self.jobs[index] for index in todo]
        # the processes search the tiles of one scan after the other
        processes = None if self.run.tiles.certain else self.options.processes([job.scan for job in jobs])
        answers = self._here(jobs) if processes is None else self._elsewhere(jobs, processes)
        with closing(answers):
            for place, outcome in answers:
                yield todo[place], outcome

    def _finished_before(self, job: Job) -> Finished | None:
        whole = self.options.resume and not self.run.others
        result = finished_before(job, self.run.settings, self.run.selection) if whole else None
        if result is not None and self.run.runs != (result.runs is not None):
            return None
        if result is None:
            return None
        blends = len(result.blends or ())
        return Finished(result.input.points, len(result.cylinders), result.warnings, blends=blends)

    def _here(self, jobs: Sequence[Job]) -> Generator[tuple[int, Outcome], None, None]:
        """Process scans one after the other in this process."""
        for place, job in enumerate(jobs):
            yield place, attempt(self._silent(), _debug(), job)

    def _elsewhere(self, jobs: Sequence[Job], processes: int) -> Generator[tuple[int, Outcome], None, None]:
        """Process scans in other processes, each with its share of the cores."""
        from cylx.cli.batch.workers import Lost, Workers

        run = self._silent()
        run = replace(run, threads=run.threads or max(1, cores() // processes), processes=None)

        workers: Workers[Job, Outcome] = Workers(partial(attempt, run, _debug()), processes, self._tidy)
        needs = [memory_needed(job.scan) for job in jobs]
        with workers, closing(workers.run(jobs, needs)) as answers:
            for place, answer in answers:
                yield place, lost_outcome(jobs[place], answer.exit_code) if isinstance(answer, Lost) else answer

    def _silent(self) -> Run:
        return replace(self.run, messages=Messages(quiet=True))

    def _skipped(self, job: Job, finished: Finished) -> Outcome:
        try:
            check_finished(job, finished, self.run.require)
        except NothingFoundError as failure:
            return failed_outcome(failure, finished, debug=False)
        return Outcome("skipped", finished)

    def _show(self, job: Job, outcome: Outcome) -> None:
        """Show the outcome of a scan: always if it failed, otherwise only if there are few scans."""
        from cylx.io import printable

        if outcome.trace:
            tell(outcome.trace, lines=True)
        if outcome.status == "failed":
            tell(f"cylx: {outcome.reason}")
        if outcome.finished is None or (len(self.jobs) >= SHORT and not self.run.messages.verbose):
            return
        if outcome.status == "skipped":
            self.run.messages.say(f"{found_line(job, outcome.finished.cylinders, outcome.finished.blends)} before")
        else:
            written = job.without(outcome.finished.unwritten)
            self.run.messages.say(found_line(written, outcome.finished.cylinders, outcome.finished.blends))
            for warning in outcome.finished.warnings:
                self.run.messages.say(f"warning: {printable(job.scan)}: {warning}")
            for note in outcome.finished.notes:
                self.run.messages.say(f"note: {printable(job.scan)}: {note}")

    def _show_counts(self, failed: int, seconds: float) -> None:
        if self.run.messages.quiet:
            return
        statuses = [outcome.status for outcome in self.outcomes.values()]
        found = sum(outcome.finished.cylinders for outcome in self.outcomes.values() if outcome.finished is not None)
        counts = (len(self.jobs), statuses.count("done"), failed, statuses.count("skipped"), found)
        header = ["files", "done", "failed", "skipped", "cylinders", "seconds"]
        show_table(header, [[*map(str, counts), f"{seconds:.1f}"]], err=True)

    def _sum_up(self) -> None:
        """Write the table of all cylinders and the list of all scans."""
        from cylx.io import write_text

        if not self.summaries:
            return
        table, listed = self.summaries
        there = [(job, self.outcomes[index]) for index, job in enumerate(self.jobs)]
        results = [(job.scan, written) for job, outcome in there if outcome.finished and (written := written_by(job))]
        write_text(table, table_text(results), overwrite=True)
        write_text(listed, list_text([entry_of(job, outcome) for job, outcome in there]), overwrite=True)

    def _is_summary(self, name: str) -> bool:
        return is_own_json(name) if Path(name).name == LIST else is_own_table(name)

    def _tidy(self, process: int | None = None) -> None:
        """Remove temporary files in our folders left by one process, or by all processes that have ended."""
        from cylx.io import remove_leftovers

        for folder in {Path(name).resolve().parent for job in self.jobs for name in job.outputs}:
            remove_leftovers(folder, process)


def _debug() -> bool:
    context = click.get_current_context(silent=True)
    return context is not None and bool(context.meta.get(DEBUG))
