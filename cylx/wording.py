"""Counts in words: the same in messages, reports and what is shown of a result."""

from __future__ import annotations


def counted(cylinders: int, blends: int = 0) -> str:
    """Return the numbers of cylinders and blends in words; blends are named only if there are some.

    Examples
    --------
    >>> counted(1), counted(6, 2)
    ('1 cylinder', '6 cylinders and 2 blends')
    """
    text = f"{cylinders} cylinder{'' if cylinders == 1 else 's'}"
    return f"{text} and {blends} blend{'' if blends == 1 else 's'}" if blends else text
