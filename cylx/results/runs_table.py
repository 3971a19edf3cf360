"""The runs of a result as rows of a table for the terminal."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

from cylx.wording import fittings_counted, number

if TYPE_CHECKING:
    from cylx.results.result import Result

RUNS_HEADER = ["run", "length", "size", "slope", "cylinders", "fittings", "open ends"]
MOST_ROWS = 20


def runs_rows(result: Result, most: int = MOST_ROWS) -> list[list[str]]:
    """Return one row of texts for each run that has a fitting, the longest first.

    Parameters
    ----------
    result : Result
        With fittings and runs.
    most : int
        Maximum number of rows.
    """
    kinds = {one.id: one.kind for one in result.fittings or ()}
    rows = []
    for run in result.runs or ():
        if not run.fittings:
            continue
        sizes = ", ".join(size.nominal or number(2 * size.radius, 4) for size in run.sizes)
        reasons = Counter(one.reason.replace("_", " ") for one in run.open_ends)
        ends = ", ".join(f"{count} {reason}" for reason, count in sorted(reasons.items()))
        rows.append(
            [
                str(run.id),
                number(run.length, 4),
                sizes,
                "" if run.slope is None else f"{100 * run.slope:.1f} %".replace("-0.0", "0.0"),
                str(len(run.cylinders)),
                fittings_counted([kinds[number] for number in run.fittings]),
                ends,
            ]
        )
    return rows[:most]
