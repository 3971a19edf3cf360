"""The display of records and results in a notebook."""

from __future__ import annotations

from importlib import import_module


def html_in_notebook(found: object) -> str:
    """Return the HTML page that `cylx.show` makes of an extraction or a result.

    The report package is imported by name on demand, as it depends on the records and not the reverse.
    """
    return str(import_module("cylx.report").show(found).html)
