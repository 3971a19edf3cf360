"""Texts of others, such as file names and results, made harmless where a terminal or a spreadsheet shows them.

The only place that does this. Names stay as they are in files that programs read.
"""

from __future__ import annotations

import re
from typing import Any
from unicodedata import category

_FORMULA = re.compile(r"\s*[=+\-@\uff1d\uff0b\uff0d\uff20].|[\t\r\n]", re.DOTALL)  # also in their wide forms
_LATER_FORMULA = re.compile(r"(;)(?=\s*[=+\-@\uff1d\uff0b\uff0d\uff20])")  # where a semicolon parts the cells
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")


def visible(text: str, keep: str = "") -> str:
    r"""Escape all characters that do not print, as JSON does: what moves the cursor, turns the text or hides in it.

    These are control and format characters, such as those that begin the commands of a terminal and those that change
    the direction of the text, line ends, and halves of characters. A JSON text means the same afterwards.

    Parameters
    ----------
    text : str
    keep : str
        Characters to leave as they are.

    Examples
    --------
    >>> print(visible("a\x1b[2Jb\n"))
    a\u001b[2Jb\u000a
    """
    if text.isprintable():
        return text
    return "".join(letter if letter in keep or _prints(letter) else _escaped(letter) for letter in text)


def cell(value: Any) -> Any:  # noqa: ANN401  whatever a table holds
    """Return the value of a cell of a CSV file; an apostrophe keeps a spreadsheet from running a text.

    Numbers are left alone, also as text.

    Examples
    --------
    >>> cell("=1+1.ply"), cell("-3.5"), cell(-3.5), cell("pipe-1")
    ("'=1+1.ply", '-3.5', -3.5, 'pipe-1')
    """
    if not isinstance(value, str) or _NUMBER.fullmatch(value):
        return value
    guarded = f"'{value}" if _FORMULA.match(value) else value
    return visible(_LATER_FORMULA.sub(r"\1'", guarded), keep="\n")


def _prints(letter: str) -> bool:
    return letter.isprintable() or category(letter) == "Zs"  # blanks of any width


def _escaped(letter: str) -> str:
    code = ord(letter)
    if code <= 0xFFFF:
        return f"\\u{code:04x}"
    return f"\\u{0xD800 + (code - 0x10000 >> 10):04x}\\u{0xDC00 + (code - 0x10000 & 0x3FF):04x}"
