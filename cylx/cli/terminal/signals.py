"""Ctrl-C, and the signals that end a program: heard wherever they arrive, and never before temporary files are removed.

Python raises an exception where a signal arrives. If that is in a callback, as the compiler of the kernels has many,
the exception is printed and forgotten. So the signal is remembered, and asked for between the steps of the work.
"""

from __future__ import annotations

import os
import signal
import sys
from types import FrameType
from typing import NoReturn

_SHELL = 128
"""Added by shells to the number of the signal that ended a program."""
_heard: list[int] = []


class Ended(SystemExit):
    """The program is ended by a signal other than Ctrl-C.

    Parameters
    ----------
    number : int
        The signal.
    """

    def __init__(self, number: int) -> None:
        super().__init__(_SHELL + number)
        self.number = number


def listen(*, worker: bool = False) -> None:
    """Listen to the signals that are not ignored, from now on.

    Parameters
    ----------
    worker : bool
        Whether this is a process of many, which does not hear Ctrl-C.
    """
    if worker:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    sys.unraisablehook = _pass_over
    for name in ("SIGINT", "SIGTERM", "SIGHUP"):
        number = getattr(signal, name, None)
        if number is not None and signal.getsignal(number) in (signal.SIG_DFL, signal.default_int_handler):
            signal.signal(number, hear)


def hear(number: int, _frame: FrameType | None) -> NoReturn:
    """Remember a signal, and raise what it means."""
    _heard.append(number)
    _raise(number)


def check_heard() -> None:
    """Raise what a signal means that has been heard.

    Raises
    ------
    KeyboardInterrupt
        If it was Ctrl-C.
    Ended
        If it was another.
    """
    if _heard:
        _raise(_heard[0])


def heard() -> BaseException | None:
    """Return what a signal means that has been heard, or None."""
    if not _heard:
        return None
    return KeyboardInterrupt() if _heard[0] == signal.SIGINT else Ended(_heard[0])


def deafen() -> None:
    """Ignore the signals from now on: the program is about to end."""
    for name in ("SIGINT", "SIGTERM", "SIGHUP"):
        number = getattr(signal, name, None)
        if number is not None and signal.getsignal(number) is hear:
            signal.signal(number, signal.SIG_IGN)


def end_by(number: int) -> None:
    """End this process by a signal, as if it had not been heard."""
    signal.signal(number, signal.SIG_DFL)
    os.kill(os.getpid(), number)


class Listener:
    """An observer that asks at each step whether a signal has been heard."""

    def stage_started(self, name: str, total: int | None) -> None:
        """Ask."""
        check_heard()

    def stage_advanced(self, steps: int) -> None:
        """Ask."""
        check_heard()

    def stage_finished(self, name: str, seconds: float) -> None:
        """Ask."""
        check_heard()


def _pass_over(swallowed: sys.UnraisableHookArgs) -> None:
    """Print nothing about a signal that a callback has swallowed: it is remembered."""
    if not isinstance(swallowed.exc_value, KeyboardInterrupt | Ended):
        sys.__unraisablehook__(swallowed)


def _raise(number: int) -> NoReturn:
    raise KeyboardInterrupt if number == signal.SIGINT else Ended(number)
