"""The trials of a figure as a CSV file to which trials are added; trials in it are not run again."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable
from typing import NamedTuple

from cylx.experiments.figures import Cell
from cylx.experiments.trials import Outcome
from cylx.version import __version__

COLUMNS = ("panel", "curve", "x", "trial", "found", "angle_deg", "offset", "radius_percent", "seconds", "made_by")


class Key(NamedTuple):
    """The identity of a trial of a figure.

    Parameters
    ----------
    panel, curve : str
    x : float
    trial : int
    """

    panel: str
    curve: str
    x: float
    trial: int

    @classmethod
    def of(cls, cell: Cell, trial: int) -> Key:
        """Return the key of a trial of a cell."""
        return cls(cell.panel, cell.curve, float(cell.x), trial)


Trials = dict[Key, Outcome]


def parse_trials(text: str, made_by: str | None = __version__) -> Trials | None:
    """Parse the trials of this version of cylx; incomplete lines and lines of other versions are skipped.

    Parameters
    ----------
    text : str
        Text of the file.
    made_by : str or None
        Version (and scan) of the trials to read; None for any.

    Returns
    -------
    dict of Key to Outcome, or None
        None if it is not such a file.
    """
    try:
        header, *rows = csv.reader(io.StringIO(text)) if text else [COLUMNS]
    except csv.Error:
        return None
    if tuple(header) != COLUMNS:
        return None
    trials: Trials = {}
    for row in rows:
        if len(row) != len(COLUMNS) or made_by not in {None, row[-1]}:
            continue
        try:
            key = Key(row[0], row[1], float(row[2]), int(row[3]))
            numbers = [float(cell) if cell else float("nan") for cell in row[5:9]]
            trials[key] = Outcome(int(row[4]), *numbers)
        except ValueError:
            continue
    return trials


def header_line() -> str:
    """Return the first line of the file."""
    return ",".join(COLUMNS) + "\n"


def trial_lines(trials: Iterable[tuple[Key, Outcome]], made_by: str = __version__) -> str:
    """Return the lines of some trials, made by this version of cylx or with some scan; unknown values are empty."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    for key, outcome in trials:
        numbers = ["" if value != value else f"{value:.6g}" for value in outcome[1:]]  # noqa: PLR0124  a NaN is empty
        writer.writerow([key.panel, key.curve, f"{key.x:g}", key.trial, outcome.found, *numbers, made_by])
    return text.getvalue()
