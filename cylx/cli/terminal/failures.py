"""Failures: one line on standard error and an exit code; a traceback only with `--debug`."""

from __future__ import annotations

import contextlib
import io
import os
import sys
import traceback
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType

import click

from cylx.cli.terminal.signals import Ended, heard
from cylx.errors import CylxError, InputError, OutputError
from cylx.harmless import visible

DEBUG = "cylx.debug"  # key in the context's meta
BUG, USAGE, UNUSABLE, INTERRUPTED, READER_GONE = 1, 2, 3, 130, 141

_LONGEST = 400
_MOST_NAMES = 3
_PASSED_ON = (click.exceptions.Exit, SystemExit, GeneratorExit)


class UnforeseenError(Exception):
    """A failure that no error of ours describes, with the file that it is about.

    Parameters
    ----------
    place : str
        The file, or several.
    failure : Exception
        What went wrong.
    """

    def __init__(self, place: str, failure: Exception) -> None:
        super().__init__(place, failure)
        self.place = place
        self.failure = failure


@contextmanager
def blamed_on(*files: str) -> Iterator[None]:
    """Name the files in the line about a failure that no error of ours describes.

    Raises
    ------
    UnforeseenError
        In place of such a failure.
    """
    try:
        yield
    except (CylxError, click.ClickException, click.Abort, click.exceptions.Exit, BrokenPipeError, UnforeseenError):
        raise
    except Exception as failure:
        names = [_one_line(str(file)) for file in files[:_MOST_NAMES]] + ["…"] * (len(files) > _MOST_NAMES)
        if not names:
            raise
        raise UnforeseenError(", ".join(names), failure) from failure


class Failures:
    """A context in which a failure ends the program with one line and its exit code.

    Parameters
    ----------
    context : click.Context, optional
        The context that holds the value of `--debug`.
    """

    def __init__(self, context: click.Context | None = None) -> None:
        self.context = context

    def __enter__(self) -> None:
        """Watch for failures."""

    def __exit__(
        self, kind: type[BaseException] | None, failure: BaseException | None, trace: TracebackType | None
    ) -> None:
        unwritten = flush_answer()
        if failure is None or isinstance(failure, _PASSED_ON):
            failure = failure if isinstance(failure, Ended) else heard() or unwritten
            if isinstance(failure, Ended):
                raise failure
        elif isinstance(failure, OSError) and _raised_by_click(trace):
            failure = failure if isinstance(failure, BrokenPipeError) else _unwritten(failure)
        if failure is None:
            return
        if self.context is not None and self.context.meta.get(DEBUG):
            tell("".join(traceback.format_exception(failure)).rstrip(), lines=True)
        line, code = describe_failure(failure)
        if line:
            tell(line)
        raise click.exceptions.Exit(code) from None


def describe_failure(failure: BaseException) -> tuple[str, int]:
    """Return the line and the exit code of a failure.

    Parameters
    ----------
    failure : BaseException
        The exception.

    Returns
    -------
    line : str
        Empty if there is nothing to print.
    code : int
        The exit code.
    """
    place = ""
    if isinstance(failure, UnforeseenError):
        place, failure = failure.place, failure.failure
    if isinstance(failure, CylxError):
        return _one_line(f"cylx: {failure}"), failure.exit_code
    if isinstance(failure, click.ClickException):
        return _usage_line(failure), USAGE
    if isinstance(failure, BrokenPipeError):
        return "", READER_GONE
    if isinstance(failure, KeyboardInterrupt | click.Abort):
        return "cylx: interrupted", INTERRUPTED
    if isinstance(failure, MemoryError):
        return f"cylx: {place}{': ' if place else ''}out of memory; thin the scan, or cut it into parts", UNUSABLE
    if isinstance(failure, FileNotFoundError) and failure.filename is None and _nowhere():
        return "cylx: the working folder has been removed; change to another folder", UNUSABLE
    what = _one_line(f"{type(failure).__name__}: {failure}")
    remedy = "run it again with --debug for the traceback to report" + (f"; the input was {place}" if place else "")
    return f"cylx: this is a bug of cylx: {what}; {remedy}", BUG


def tell(text: str, *, lines: bool = False, styled: bool = False) -> None:
    """Print a line on standard error; if nobody can read it, do without it and all that follow.

    Parameters
    ----------
    text : str
        Characters that do not print are escaped.
    lines : bool
        Whether it may have several lines.
    styled : bool
        Whether it has commands for the terminal, and nothing of others that is not escaped already.
    """
    try:
        click.echo(text if styled else visible(text, keep="\n\t" if lines else ""), err=True)
    except OSError:
        sys.stderr = open(os.devnull, "w", encoding="utf-8")  # noqa: PTH123, SIM115  open until the end


def answer(text: str, *, as_json: bool = False, styled: bool = False) -> None:
    """Write the answer, or a part of it, to standard output.

    Parameters
    ----------
    text : str
        Lines; other characters that do not print are escaped.
    as_json : bool
        Whether it is JSON, which is UTF-8 whatever the encoding of the terminal.
    styled : bool
        Whether it has commands for the terminal, and nothing of others that is not escaped already.

    Raises
    ------
    OutputError
        If it cannot be written.
    BrokenPipeError
        If the reader of the pipe has closed it.
    """
    if sys.stdout is None:
        raise OutputError("standard output", "is closed", "open it, or write to a file")
    text = text if styled else visible(text, keep="\n\t")
    encoding = sys.stdout.encoding or "utf-8"
    try:
        if as_json and (raw := getattr(sys.stdout, "buffer", None)) is not None:
            sys.stdout.flush()
            raw.write(text.encode("utf-8", "backslashreplace"))
            return
        click.echo(text.encode(encoding, "backslashreplace").decode(encoding), nl=False)
    except BrokenPipeError:
        raise
    except OSError as error:
        raise _unwritten(error) from error


@contextmanager
def called_by_file(files: Mapping[str, str]) -> Iterator[None]:
    """Replace the name of a document by its file name in errors.

    Parameters
    ----------
    files : mapping of str to str
        Name of the document in the library, and its file.
    """
    try:
        yield
    except InputError as error:
        for name, file in files.items():
            if error.place.startswith(name):
                rest = error.place.removeprefix(name).lstrip(".")
                raise InputError(f"{file}: {rest}" if rest else file, error.fault, error.remedy) from error
        raise


def flush_answer() -> BrokenPipeError | OutputError | None:
    """Flush the buffer of standard output, and return the error if that fails."""
    try:
        if sys.stdout is not None:
            sys.stdout.flush()
    except OSError as error:
        with contextlib.suppress(io.UnsupportedOperation):  # so that the interpreter does not fail on it again
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return error if isinstance(error, BrokenPipeError) else _unwritten(error)
    return None


def _nowhere() -> bool:
    """Return whether the working folder has been removed."""
    try:
        return not Path.cwd()
    except FileNotFoundError:
        return True


def _raised_by_click(trace: TracebackType | None) -> bool:
    """Return whether click failed to write its help or version to standard output."""
    frames = [frame for frame, _ in traceback.walk_tb(trace)]
    return bool(frames) and frames[-1].f_globals.get("__name__") == "click.utils"


def _unwritten(error: OSError) -> OutputError:
    """Return the error for standard output that cannot be written."""
    return OutputError("standard output", f"cannot be written: {error.strerror}", "free some space, or write to a file")


def _usage_line(failure: click.ClickException) -> str:
    """Return click's usage error as one line."""
    context = getattr(failure, "ctx", None)
    if isinstance(failure, getattr(click.exceptions, "NoArgsIsHelpError", ())):
        return failure.format_message()
    see = f"; see '{context.command_path} --help'" if context is not None else ""
    message = failure.format_message().rstrip(".")
    if len(message) > _LONGEST:  # it repeats what was given
        message = f"{message[: _LONGEST // 2]} … {message[-_LONGEST // 2 :]}"
    return _one_line(f"cylx: {message}{see}")


def _one_line(text: str) -> str:
    """Join the lines of a text, and escape characters that a terminal would not print."""
    return "".join(c if c.isprintable() else " " for c in " ".join(text.split()))
