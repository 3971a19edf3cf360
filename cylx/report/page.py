"""The report as one self-contained HTML page: no network, no fonts, no library."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from importlib.resources import files
from typing import TYPE_CHECKING, Any

from cylx.report.page_data import page_data_of

if TYPE_CHECKING:
    from cylx.records import Extraction
    from cylx.results import Result


def html_of(extraction: Extraction, *, result: Result | None = None, points: int | None = None) -> str:
    """Return an extraction as an HTML page.

    The page has the cloud and the cylinders in 3-D, their table, a map of the residuals of each, the rejected fits with
    their reasons, and the configuration. It holds no times and no folder names: the same input, configuration and seed
    give the same bytes. A policy in its head forbids it to load anything.

    Parameters
    ----------
    extraction : Extraction
        The output of a run.
    result : Result, optional
        Of the whole, if the extraction has a sample of its points.
    points : int, optional
        Number of points of the whole.

    Returns
    -------
    str
        HTML, to be written as UTF-8.
    """
    return page_of(page_data_of(extraction, result=result, points=points))


def page_of(page_data: dict[str, Any]) -> str:
    """Return the page for the given content.

    Parameters
    ----------
    page_data : dict
        A JSON object, as returned by `page_data_of`. With `embedded` it has neither `config`, `fields` nor `rejected`,
        and the page has only the view and the details, for a frame in another page.

    Returns
    -------
    str
        HTML, to be written as UTF-8.
    """
    style, script = _read("viewer.css"), "\n".join(map(_read, ("viewer.js", "panels.js")))
    parts = {
        "policy": f"default-src 'none'; script-src '{_digest(script)}'; style-src '{_digest(style)}'; base-uri 'none'; "
        "form-action 'none'",
        "style": style,
        "data": json_for_script(page_data),
        "script": script,
    }
    pieces = re.split(r"\{\{(\w+)\}\}", _read("page.html"))  # in one pass: inserted parts are not searched again
    return "".join(parts[piece] if place % 2 else piece for place, piece in enumerate(pieces))


def json_for_script(content: dict[str, Any]) -> str:
    """Format a JSON object so that nothing in it can end the element of the page that holds it.

    Parameters
    ----------
    content : dict
        May contain any names from the user's files.

    Returns
    -------
    str
        ASCII without `<`, `>` and `&`; parses to the same object.
    """
    text = json.dumps(content, ensure_ascii=True, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def _read(name: str) -> str:
    """Read a file of this folder."""
    return files("cylx.report").joinpath(name).read_text(encoding="utf-8")


def _digest(text: str) -> str:
    """Return the hash of a script or a style for the policy, which allows only these to run."""
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode("utf-8")).digest()).decode("ascii")
