"""All errors that a user can meet, with their exit codes.

Each error names the place, the fault and the remedy in one line. Any exception other than `CylxError` is a bug of ours
and keeps its traceback.
"""

from typing import ClassVar

_LONGEST = 400
"""Letters of a part of a message: parts of files may be in it."""


def _one_line(text: str) -> str:
    """Return a text that a terminal shows on one line, shortened in its middle if it is long."""
    if len(text) > _LONGEST:
        text = f"{text[: _LONGEST // 2]} … {text[-_LONGEST // 2 :]}"
    return text if text.isprintable() else "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)


class CylxError(Exception):
    """A failure that the user can correct.

    Parameters
    ----------
    place : str
        Where the fault is: a file, a file and line, a configuration key, an option.
    fault : str
        What is wrong.
    remedy : str
        How to correct it.
    """

    exit_code: ClassVar[int] = 1

    def __init__(self, place: str, fault: str, remedy: str) -> None:
        super().__init__(place, fault, remedy)
        self.place = place
        self.fault = fault
        self.remedy = remedy

    def __str__(self) -> str:
        return f"{_one_line(self.place)}: {_one_line(self.fault)}; {_one_line(self.remedy)}"


class UsageError(CylxError):
    """An invalid option or argument."""

    exit_code = 2


class ConfigError(UsageError):
    """A configuration that has an unknown key, a wrong type or an impossible value.

    `faults` are all known faults, each a dotted path, what is wrong, and how to correct it; the message of the error is
    about the first.
    """

    faults: tuple[tuple[str, str, str], ...] = ()


class InputError(CylxError):
    """An input that cannot be read or is unusable."""

    exit_code = 3


class OutputError(CylxError):
    """An output that cannot or must not be written."""

    exit_code = 4


class ExistsError(OutputError):
    """An output that exists and may not be replaced, perhaps since another program was faster."""


class NothingFoundError(CylxError):
    """Fewer cylinders than `--require` asks for."""

    exit_code = 5


class BatchError(CylxError):
    """Some of several inputs failed; the others have their results."""

    exit_code = 6
