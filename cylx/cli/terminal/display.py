"""Progress and tables on the terminal; the only module that uses rich."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from time import perf_counter
from typing import TYPE_CHECKING

from cylx.cli.terminal.failures import answer, tell
from cylx.harmless import visible
from cylx.records import Observer, SilentObserver

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress, TaskID

_NARROWEST, _WIDE_ENOUGH = 80, 200
_SOON = 5.0
"""Of less time nothing is said, seconds."""
_COMPILING = "compiling (the first time only)"


class Messages:
    """The messages of a command on standard error, apart from errors.

    Parameters
    ----------
    quiet : bool
        Show nothing.
    verbose : bool
        Show more.
    """

    def __init__(self, *, quiet: bool = False, verbose: bool = False) -> None:
        self.quiet = quiet
        self.verbose = verbose

    def say(self, line: str) -> None:
        """Print a line, unless quiet."""
        if not self.quiet:
            tell(line)

    @contextmanager
    def progress(self) -> Iterator[Observer]:
        """Yield an observer that shows the progress of the stages, if standard error is a terminal."""
        if self.quiet or not sys.stderr.isatty():
            yield SilentObserver()
            return
        from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

        count, left = TextColumn("{task.fields[count]}"), TextColumn("{task.fields[left]}")
        columns = (SpinnerColumn(), TextColumn("{task.description}"), BarColumn(24), count, TimeElapsedColumn(), left)
        with Progress(*columns, console=_console(sys.stderr), transient=True) as display:
            yield ProgressObserver(display)

    @contextmanager
    def counting(self, total: int) -> Iterator[Callable[[], None]]:
        """Yield a function to call after each of many scans; a terminal shows a bar and the remaining time."""
        if self.quiet or not sys.stderr.isatty():
            yield lambda: None
            return
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

        columns = (MofNCompleteColumn(), TextColumn("scans"), BarColumn(24), TextColumn("left"), TimeRemainingColumn())
        with Progress(*columns, console=_console(sys.stderr), transient=True) as display:
            task = display.add_task("", total=total)
            yield lambda: display.advance(task)


class ProgressObserver:
    """An observer that updates one line of a rich display.

    Parameters
    ----------
    display : rich.progress.Progress
        The display of the line.
    """

    def __init__(self, display: Progress) -> None:
        self.display = display
        self.task: TaskID | None = None
        self.done: dict[str, int] = {}
        self.name = ""
        self.total: int | None = None
        self.started, self.before = 0.0, 0

    def stage_started(self, name: str, total: int | None) -> None:
        """Show a stage in place of the previous one."""
        if self.task is not None:
            self.display.remove_task(self.task)
        self.name, self.total = name, total
        done = self.done.setdefault(name, 0)  # of its parts before
        shown = _COMPILING if name == "compiling" else name
        self.started, self.before = perf_counter(), done
        self.task = self.display.add_task(shown, total=total, completed=done, count=self._count(), left="")

    def stage_advanced(self, steps: int) -> None:
        """Move the bar."""
        if self.task is not None:
            self.done[self.name] += steps
            left = time_left(perf_counter() - self.started, self.before, self.done[self.name], self.total)
            self.display.update(self.task, advance=steps, count=self._count(), left=left)

    def _count(self) -> str:
        done = self.done[self.name]
        if self.total is None:
            return f"{done or ''}"
        return f"{done}/{self.total}" if done else ""

    def stage_finished(self, name: str, seconds: float) -> None:
        """Keep the line until the next stage starts."""


def time_left(elapsed: float, before: int, done: int, total: int | None) -> str:
    """Return how long a step goes on if it goes on as before; nothing if it will soon be over, or cannot be told.

    Parameters
    ----------
    elapsed : float
        Since it began, seconds.
    before, done, total : int
        Steps that were done when it began, and are now, and will be in the end, if that is known.

    Examples
    --------
    >>> time_left(60.0, 0, 2, 10)
    '4:00 left'
    >>> time_left(7200.0, 5, 6, 8)
    '4:00:00 left'
    """
    if total is None or done <= before or elapsed < _SOON:
        return ""
    seconds = round(elapsed * max(total - done, 0) / (done - before))
    if seconds < _SOON:
        return ""
    minutes, hours = seconds // 60, seconds // 3600
    return f"{hours}:{minutes % 60:02}:{seconds % 60:02} left" if hours else f"{minutes}:{seconds % 60:02} left"


class Observers:
    """An observer that forwards to several observers.

    Parameters
    ----------
    *observers : Observer
        Who receives the calls.
    """

    def __init__(self, *observers: Observer) -> None:
        self.observers = observers

    def stage_started(self, name: str, total: int | None) -> None:
        """Forward to all observers."""
        for observer in self.observers:
            observer.stage_started(name, total)

    def stage_advanced(self, steps: int) -> None:
        """Forward to all observers."""
        for observer in self.observers:
            observer.stage_advanced(steps)

    def stage_finished(self, name: str, seconds: float) -> None:
        """Forward to all observers."""
        for observer in self.observers:
            observer.stage_finished(name, seconds)


@contextmanager
def observed(observer: Observer, name: str, total: int | None = None) -> Iterator[None]:
    """Report a step of the command itself as a stage."""
    started = perf_counter()
    observer.stage_started(name, total)
    yield
    observer.stage_finished(name, perf_counter() - started)


def show_table(header: Sequence[str], rows: Sequence[Sequence[str]], *, err: bool = False) -> None:
    """Print a table on standard output or standard error, with numbers aligned to the right."""
    from rich import box
    from rich.table import Table
    from rich.text import Text

    table = Table(box=box.SIMPLE, pad_edge=False, padding=(0, 1, 0, 0))
    for i, name in enumerate(header):
        numeric = bool(rows) and all(row[i][:1] in "+-.0123456789" for row in rows)
        table.add_column(Text(name), justify="right" if numeric else "left", no_wrap=numeric)
    for row in rows:
        table.add_row(*(Text(visible(cell)) for cell in row))
    console = _console(sys.stderr if err else sys.stdout)
    with console.capture() as capture:
        console.print(table)
    text = "\n".join(filter(None, (line.rstrip() for line in capture.get().splitlines())))
    if err:
        tell(text, styled=True)
    else:
        answer(text + "\n", styled=True)


def _console(stream: object) -> Console:
    """Open a console on a stream; if it is not a terminal, lines are not wrapped."""
    from rich.console import Console

    console = Console(file=stream, soft_wrap=False)  # type: ignore[arg-type]  # click may have replaced the stream
    console.width = max(console.width, _NARROWEST) if console.is_terminal else _WIDE_ENOUGH
    return console
