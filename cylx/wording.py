"""Counts in words: the same in messages, reports and what is shown of a result."""

from __future__ import annotations

from collections.abc import Sequence


def counted(cylinders: int, blends: int = 0) -> str:
    """Return the numbers of cylinders and blends in words; blends are named only if there are some.

    Examples
    --------
    >>> counted(1), counted(6, 2)
    ('1 cylinder', '6 cylinders and 2 blends')
    """
    text = f"{cylinders} cylinder{'' if cylinders == 1 else 's'}"
    return f"{text} and {blends} blend{'' if blends == 1 else 's'}" if blends else text


def fittings_counted(kinds: Sequence[str]) -> str:
    """Count fittings by kind, in words.

    Examples
    --------
    >>> fittings_counted(["tee", "elbow", "elbow", "cross"])
    '2 elbows, 1 tee, 1 cross'
    """
    order = ("elbow", "tee", "cross", "reducer", "flange", "inline", "cap", "joint")
    plural = {"cross": "crosses", "inline": "inline"}
    counts = [(kind, kinds.count(kind)) for kind in order if kind in kinds]
    return ", ".join(f"{n} {kind if n == 1 else plural.get(kind, kind + 's')}" for kind, n in counts)


def piping_counted(runs: int, kinds: Sequence[str]) -> str:
    """Count runs and fittings, in words.

    Examples
    --------
    >>> piping_counted(1, [])
    '1 run without fittings'
    >>> piping_counted(2, ["tee"])
    '2 runs with 1 tee'
    """
    said = f"{runs} run{'' if runs == 1 else 's'}"
    return f"{said} with {fittings_counted(kinds)}" if kinds else f"{said} without fittings"
