"""What the parts of a result say of each other: ids that must be there."""

from __future__ import annotations

from collections.abc import Container, Iterable, Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from cylx.results.cylinders import ResultCylinder
    from cylx.results.fittings import AnyFitting, ResultRun


def unknown_reference(
    cylinders: Sequence[ResultCylinder], fittings: Sequence[AnyFitting], runs: Sequence[ResultRun]
) -> str | None:
    """Return what refers to a cylinder or fitting that is not there, or None.

    Parameters
    ----------
    cylinders : sequence of ResultCylinder
    fittings : sequence of fittings
    runs : sequence of ResultRun

    Returns
    -------
    str or None
        Such as `fitting 3 joins cylinder 9, which is not there`.
    """
    known, known_fittings = {one.id for one in cylinders}, {one.id for one in fittings}
    for one in fittings:
        missing = _first_missing(one.joins, known)
        if missing is not None:
            return f"fitting {one.id} joins cylinder {missing}, which is not there"
    for run in runs:
        own = [*run.cylinders, *(i for size in run.sizes for i in size.cylinders), *(e.cylinder for e in run.open_ends)]
        missing = _first_missing(own, known)
        if missing is not None:
            return f"run {run.id} has cylinder {missing}, which is not there"
        missing = _first_missing(run.fittings, known_fittings)
        if missing is not None:
            return f"run {run.id} has fitting {missing}, which is not there"
    return None


def _first_missing(ids: Iterable[int], known: Container[int]) -> int | None:
    """Return the first id that is not known."""
    return next((i for i in ids if i not in known), None)
