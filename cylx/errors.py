"""Every error a user can meet, with its exit code.

Each error names the place, the fault and the remedy in one line. Whatever is not a `CylxError` is a bug of ours and
keeps its traceback.
"""

from typing import ClassVar


class CylxError(Exception):
    """A failure the user can mend.

    Parameters
    ----------
    place : str
        Where it is: a file, a file and line, a configuration key, an option.
    fault : str
        What is wrong there.
    remedy : str
        What to do about it.
    """

    exit_code: ClassVar[int] = 1

    def __init__(self, place: str, fault: str, remedy: str) -> None:
        super().__init__(place, fault, remedy)
        self.place = place
        self.fault = fault
        self.remedy = remedy

    def __str__(self) -> str:
        return f"{self.place}: {self.fault}; {self.remedy}"


class UsageError(CylxError):
    """An option or argument that cannot be meant."""

    exit_code = 2


class ConfigError(UsageError):
    """A configuration that has an unknown key, a wrong type or an impossible value.

    `faults` are all that are known, each a dotted path, what is wrong there, and what to do about it; the error itself
    tells of the first.
    """

    faults: tuple[tuple[str, str, str], ...] = ()


class InputError(CylxError):
    """An input that cannot be read, or holds nothing that could be worked on."""

    exit_code = 3


class OutputError(CylxError):
    """An output that could not, or must not, be written."""

    exit_code = 4


class NothingFoundError(CylxError):
    """Fewer cylinders than `--require` asks for."""

    exit_code = 5


class BatchError(CylxError):
    """Some of several inputs failed; the others have their results."""

    exit_code = 6
