"""The cylinders of a result as a table: one row per cylinder, one column per number."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from cylx.optional.extras import require

_ALWAYS = (
    "id",
    *(f"axis_point_{axis}" for axis in "xyz"),
    *(f"axis_direction_{axis}" for axis in "xyz"),
    "radius",
    "height",
    *(f"start_{axis}" for axis in "xyz"),
    *(f"end_{axis}" for axis in "xyz"),
    "inliers",
    "rmse",
    "coverage_deg",
    "support",
)


def table_of(cylinders: Sequence[Mapping[str, Any]]) -> dict[str, list[Any]]:
    """Return the columns of a table of cylinders.

    Vectors have a column for each of x, y and z. Keys of inner objects follow the name of the object:
    `uncertainty_radius` is the standard deviation of the radius. Matrices are left out.

    Parameters
    ----------
    cylinders : sequence of mapping
        JSON objects, as in the result.

    Returns
    -------
    dict of str to list
        Values by column, in the order of the keys; None if a cylinder has no value.

    Examples
    --------
    >>> table = table_of([{"id": 0, "start": [1.0, 2.0, 3.0], "uncertainty": {"radius": 0.1}}])
    >>> table["start_y"], table["uncertainty_radius"], table["rmse"]
    ([2.0], [0.1], [None])
    """
    rows = [dict(_cells(cylinder)) for cylinder in cylinders]
    names = dict.fromkeys([*_ALWAYS, *(name for row in rows for name in row)])
    return {name: [row.get(name) for row in rows] for name in names}


def dataframe_of(cylinders: Sequence[Mapping[str, Any]]) -> Any:  # noqa: ANN401  pandas may not be there
    """Return the same table as a pandas data frame.

    Raises
    ------
    UsageError
        If pandas is not installed.
    """
    require("pandas", place="the data frame")
    import pandas  # noqa: PLC0415  an extra

    return pandas.DataFrame(table_of(cylinders))


def _cells(part: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the names and values of the columns of one object."""
    for key, value in part.items():
        if isinstance(value, Mapping):
            yield from _cells(value, f"{prefix}{key}_")
        elif isinstance(value, list):
            if len(value) == 3:  # a matrix has five rows
                yield from ((f"{prefix}{key}_{axis}", number) for axis, number in zip("xyz", value, strict=True))
        else:
            yield f"{prefix}{key}", value
