"""The report as one page of HTML that needs nothing else: no network, no fonts, no library."""

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


def html_of(extraction: Extraction) -> str:
    """Write an extraction as a page to look at.

    The page has the cloud and the cylinders in 3-D, their table, the map of each one's residuals, what was not accepted
    and why, and the configuration. It holds no times and no folder names: the same input, configuration and seed give
    the same bytes. It may not load anything: a policy in its head forbids that.

    Parameters
    ----------
    extraction : Extraction
        What a run found out.

    Returns
    -------
    str
        HTML, to be written as UTF-8.
    """
    return page_of(page_data_of(extraction))


def page_of(page_data: dict[str, Any]) -> str:
    """Write the page of what is to be said.

    Parameters
    ----------
    page_data : dict
        A JSON object, as `page_data_of` gives it. With `embedded` it has neither `config`, `fields` nor `rejected`, and
        the page is the view and the details alone, for a frame in another page.

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
    pieces = re.split(r"\{\{(\w+)\}\}", _read("page.html"))  # at once: nothing in a part is looked at again
    return "".join(parts[piece] if place % 2 else piece for place, piece in enumerate(pieces))


def json_for_script(content: dict[str, Any]) -> str:
    """Write a JSON object so that nothing in it can end the element of the page that holds it.

    Parameters
    ----------
    content : dict
        With whatever names the user's files have.

    Returns
    -------
    str
        Of ASCII without `<`, `>` and `&`; parses to the same object.
    """
    text = json.dumps(content, ensure_ascii=True, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def _read(name: str) -> str:
    """Read a file of this folder."""
    return files("cylx.report").joinpath(name).read_text(encoding="utf-8")


def _digest(text: str) -> str:
    """Name a script or a style in a policy: it, and no other, may run."""
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode("utf-8")).digest()).decode("ascii")
