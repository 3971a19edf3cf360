"""Names of properties: find the coordinates, and replace names that a file cannot hold."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence


def coordinate_names(names: Iterable[str]) -> tuple[str, ...]:
    """Find the properties x, y and z, in this order; capital letters are accepted if the small ones are not complete.

    Returns
    -------
    tuple of str
        Three names, or fewer if some are missing.

    Examples
    --------
    >>> coordinate_names(["intensity", "z", "X", "y"])
    ('X', 'y', 'z')
    >>> coordinate_names(["x", "y", "X", "Y", "Z"])
    ('X', 'Y', 'Z')
    """
    have = set(names)
    if have >= set("XYZ") and not have >= set("xyz"):
        return ("X", "Y", "Z")
    return tuple(name for axis in "xyz" for name in (axis, axis.upper()) if name in have and not _shadowed(name, have))


def missing_coordinates(names: Iterable[str]) -> str:
    """Return the coordinates that are not among `names`, for an error.

    Examples
    --------
    >>> missing_coordinates(["x", "intensity"])
    'y, z'
    """
    found = [name.lower() for name in coordinate_names(names)]
    return ", ".join(axis for axis in "xyz" if axis not in found)


def mended_names(names: Sequence[str]) -> list[str]:
    """Turn names into ones that PLY can hold: printable ASCII without spaces, no name twice.

    Examples
    --------
    >>> mended_names(["scan angle", "a", "a", ""])
    ['scan_angle', 'a', 'a_2', 'property']
    """
    mended: dict[str, None] = {}
    counts: dict[str, int] = {}
    for name in names:
        stem = re.sub(r"[^!-~]+", "_", name.strip()) or "property"
        candidate, count = stem, counts.get(stem, 1)
        while candidate in mended:
            count += 1
            candidate = f"{stem}_{count}"
        counts[stem] = count
        mended[candidate] = None
    return [*mended]


def _shadowed(name: str, have: set[str]) -> bool:
    return name.isupper() and name.lower() in have
