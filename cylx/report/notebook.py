"""A result in a notebook: a table of its cylinders, and a view in 3-D.

The table is plain HTML and also works where scripts are not trusted. The view is the page of a report with fewer
points, reduced to view and details, in a frame without access to the notebook.
"""

from __future__ import annotations

from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING

import numpy as np

from cylx.palette import cylinder_colors
from cylx.report.page import page_of
from cylx.report.page_data import maps_of, view_of
from cylx.report.plots import with_deviation
from cylx.report.view import View
from cylx.results import Result
from cylx.wording import number

if TYPE_CHECKING:
    from typing import Any

    from numpy.typing import ArrayLike

    from cylx.records import Extraction, PointCloud
    from cylx.results import ResultCylinder

MOST_POINTS = 30_000
MOST_ROWS = 50
MOST_CYLINDERS = 500
"""Maximum number of cylinders in the view; each takes about a kilobyte."""
MOST_CELLS = 200_000
"""Maximum number of cells in the maps of all cylinders together."""
ENOUGH_TO_CHOOSE_FROM = 1_000_000
"""Maximum number of points processed; larger clouds are thinned evenly."""
VIEW_HEIGHT = 520


@dataclass(frozen=True, slots=True)
class NotebookView:
    """The output of a result in a notebook.

    Parameters
    ----------
    html : str
        A table and a frame with a page; needs no other files.
    text : str
        One line, for use without HTML.
    """

    html: str
    text: str

    def _repr_html_(self) -> str:
        return self.html

    def __repr__(self) -> str:
        return self.text


def show(
    found: Extraction | Result,
    cloud: PointCloud | ArrayLike | None = None,
    *,
    most_points: int = MOST_POINTS,
    height: int = VIEW_HEIGHT,
) -> NotebookView:
    """Show a result in a notebook: a table of its cylinders, and a view in 3-D to turn and to click on.

    An `Extraction` or a `Result` at the end of a cell is shown in the same way. Nothing is loaded from elsewhere. With
    points, the notebook grows by about half a megabyte.

    Parameters
    ----------
    found : Extraction or Result
    cloud : PointCloud or array_like of shape (N, 3), optional
        The points of a `Result`, as returned by `read_cloud`; those of the annotated cloud are coloured by cylinder.
        Without it only the cylinders are shown. An `Extraction` has its own.
    most_points : int
        Maximum number of points shown, >= 0; each adds about a dozen bytes to the notebook.
    height : int
        Height of the view, pixels.

    Returns
    -------
    NotebookView

    Raises
    ------
    UsageError
        If a cloud is given with an extraction.
    ValueError
        If the shape of the points is not (N, 3).
    """
    view = View.of(found, cloud)
    result = found if isinstance(found, Result) else Result.of(found)
    text = repr(found)
    parts = [f"<div><strong>{_text(text)}</strong></div>", _table(result)]
    if len(view.points) or view.shapes:
        page = page_of(_glance(result, view.thinned(max(ENOUGH_TO_CHOOSE_FROM, most_points)), most_points))
        style = f"width: 100%; height: {int(height)}px; border: 0"
        frame = f"<iframe sandbox='allow-scripts' title='the cylinders in 3-D' style='{style}'"
        parts.append(f"{frame} srcdoc='{escape(page)}'></iframe>")
    return NotebookView("\n".join(parts), text)


def _glance(result: Result, view: View, most_points: int) -> dict[str, Any]:
    """Return the content of the page in the frame: the result without its stages and configuration."""
    view = view.first(MOST_CYLINDERS)
    count = len(view.shapes)
    cylinders = [cylinder.to_object() for cylinder in result.cylinders[:count]]
    for cylinder in cylinders:
        cylinder.get("uncertainty", {}).pop("covariance", None)
    content = result.model_copy(
        update={
            "cylinders": [],
            "blends": None,
            "fittings": None,
            "runs": None,
            "adjustments": None,
            "stages": [],
            "warnings": [],
            "config": {},
        }
    ).to_object()
    return {
        "embedded": True,
        "result": {**content, "cylinders": cylinders},
        "view": view_of(view, most_points),
        "maps": maps_of(view, max(64, MOST_CELLS // max(count, 1))) if (view.labels >= 0).any() else [],
    }


def _table(result: Result) -> str:
    """Format the table of the cylinders as HTML."""
    cylinders = result.cylinders
    heads = ("id", "radius", "height", "coverage", "confidence")
    lines = [_row(cylinder) for cylinder in cylinders[:MOST_ROWS]]
    if len(cylinders) > MOST_ROWS:
        rest = f"and {len(cylinders) - MOST_ROWS} more"
        lines.append(f"<tr><td colspan='{len(heads)}'>{rest}</td></tr>")
    if not lines:
        return ""
    head = "".join(f"<th>{name}</th>" for name in heads)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{''.join(lines)}</tbody></table>"


def _row(cylinder: ResultCylinder) -> str:
    """Format a cylinder as a row of the table."""
    red, green, blue = cylinder_colors(np.array([cylinder.id]))[0] if cylinder.id < MOST_CYLINDERS else (128,) * 3
    deviation = cylinder.uncertainty.radius if cylinder.uncertainty else None
    cells = (
        f"<span style='color: rgb({red}, {green}, {blue})'>&#9632;</span> {cylinder.id}",
        with_deviation(cylinder.radius, deviation),
        number(cylinder.height, 4),
        f"{cylinder.coverage_deg:.0f}°",
        "" if cylinder.confidence is None else f"{cylinder.confidence:.2f}",
    )
    return f"<tr>{''.join(f'<td>{cell}</td>' for cell in cells)}</tr>"


def _text(text: str) -> str:
    """Escape a text for HTML; characters that cannot be encoded, such as half a surrogate pair, become `?`."""
    return escape(text.encode("utf-8", "replace").decode("utf-8"))
