"""Counts and numbers in words: the same in messages, reports and what is shown of a result."""

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


def number(value: float, digits: int) -> str:
    """Return a number with this many digits or, if it has more before its point, with all of those: no powers of ten.

    Very large and very small numbers keep their powers.

    Examples
    --------
    >>> number(0.123456, 4), number(12345.6, 4), number(4512345.0, 6), number(1.5e-7, 4), number(3e20, 4)
    ('0.1235', '12346', '4512345', '1.5e-07', '3e+20')
    """
    return f"{value:.0f}" if 10.0**digits - 0.5 <= abs(value) < 1e15 else f"{value:.{digits}g}"
