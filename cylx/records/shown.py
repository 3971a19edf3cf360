"""What a notebook shows of a record, or of what is read from a file."""

from __future__ import annotations

from importlib import import_module


def html_in_notebook(found: object) -> str:
    """Return the page that `cylx.show` makes of an extraction or a result.

    It is imported by its name when a notebook asks: what shows records knows them, not they it.
    """
    return str(import_module("cylx.report").show(found).html)
