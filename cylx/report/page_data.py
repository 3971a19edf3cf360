"""The content of a report as one JSON object: the result, its packed points, and the map of each cylinder."""

from __future__ import annotations

import base64
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from cylx.config import plain_yaml
from cylx.geometry.arrays import FloatArray
from cylx.palette import cylinder_colors
from cylx.report.maps import MOST_CELLS, unroll
from cylx.report.points import choose_points, pack_labels, pack_residuals, quantise
from cylx.report.view import View
from cylx.results import RejectedCylinder, Result
from cylx.results.parts import drop_missing
from cylx.results.quantities import quantities_of
from cylx.wording import number as plain_number

if TYPE_CHECKING:
    from cylx.records import Extraction

MOST_POINTS = 500_000
MOST_REJECTED = 50
NOISES = 8.0
"""Limit of the packed residuals, in noises."""
_OUTLYING = 0.005  # share of the points at either end of a coordinate that the first view may leave out


def page_data_of(
    extraction: Extraction, most_points: int = MOST_POINTS, *, result: Result | None = None, points: int | None = None
) -> dict[str, Any]:
    """Return the content of a report.

    Parameters
    ----------
    extraction : Extraction
    most_points : int
        Maximum number of points shown.
    result : Result, optional
        Of the whole, if the extraction has a sample of its points.
    points : int, optional
        Number of points of the whole.

    Returns
    -------
    dict
        A JSON object: `result`, as in the result file except for the configuration, which is the text `config`;
        `fields`, the properties of the input; the first `rejected`, of `rejected_count`; `view`, the drawing; `maps`,
        the unrolled surface of each cylinder; `parts`, the bill of quantities, None without runs.
    """
    content = result or Result.of(extraction)
    listed = content.to_object()
    del listed["config"]
    view = View.of(extraction)
    table = extraction.cloud.table
    rejected = [RejectedCylinder.of(one).model_dump(mode="json") for one in extraction.rejected[:MOST_REJECTED]]
    drop_missing(rejected)
    return {
        "result": listed,
        "config": plain_yaml(extraction.config),
        "fields": ["x", "y", "z"] if table is None else list(table.dtype.names or ()),
        "rejected": rejected,
        "rejected_count": len(extraction.rejected),
        "view": view_of(view, most_points) | ({} if points is None else {"total": points}),
        "maps": maps_of(view),
        "parts": None if content.runs is None else _parts(content),
    }


def _parts(content: Result) -> dict[str, Any]:
    """Return the list of parts as texts."""
    rows = [
        [_text(value) for value in (row["item"], row["size"], row["to_size"], row["angle_deg"], row["bend_radius"])]
        + [str(row["count"]), _text(row["length"])]
        for row in quantities_of(content)
    ]
    return {"heads": ["item", "size", "to size", "angle", "bend radius", "count", "length"], "lines": rows}


def _text(value: str | float | None) -> str:
    return "–" if value is None else value if isinstance(value, str) else plain_number(value, 4)  # noqa: RUF001  a dash


def view_of(view: View, most_points: int) -> dict[str, Any]:
    """Return the content of the view: points, and cylinders relative to the middle of the box.

    Parameters
    ----------
    view : View
        With points, cylinders, or both.
    most_points : int
        Maximum number of points drawn.

    Returns
    -------
    dict
        A JSON object, the input of `viewer.js`.
    """
    chosen = choose_points(view.labels, most_points, np.random.default_rng(view.seed))
    points, shapes = view.points[chosen], view.shapes
    corners = points if len(points) else np.array([end for shape in shapes for end in (shape.start, shape.end)])
    steps, low, size = quantise(corners)
    middle = low + 0.5 * size
    unit = _unit(view)
    labels = pack_labels(view.labels[chosen], len(shapes))
    tubes, arcs = (
        [[*(shape.start - middle), *(shape.end - middle), shape.radius] for shape in listed]
        for listed in (shapes, view.blends)
    )
    return {
        "count": len(chosen),
        "total": len(view.points),
        "low": low.tolist(),
        "size": size.tolist(),
        "home": _home(corners - middle, np.array(tubes).reshape(-1, 7)),
        "spacing": view.spacing * float(np.sqrt(len(view.points) / max(len(chosen), 1))),
        "noise": unit,
        "noises": NOISES,
        "points": _packed(steps[: len(chosen)]),
        "labels": _packed(labels),
        "label_bytes": labels.itemsize,
        "residuals": _packed(pack_residuals(view.residuals[chosen].astype(np.float64), NOISES * unit)),
        "colors": None if view.colors is None else _packed(view.colors[chosen]),
        "palette": _packed(cylinder_colors(np.arange(len(shapes)))),
        "cylinders": np.array(tubes).tolist(),
        "blends": np.array(arcs).tolist(),
        "runs": None if view.runs is None else list(view.runs),
        "fittings": [
            [owner, *(shape.start - middle).tolist(), *(shape.end - middle).tolist(), shape.radius]
            for owner, shape in view.fittings
        ],
    }


def _unit(view: View) -> float:
    """Return the noise, or a substitute if the noise is 0."""
    residuals = view.residuals[np.isfinite(view.residuals)].astype(np.float64)
    scatter = float(np.sqrt(np.mean(residuals**2))) if len(residuals) else 0.0
    return view.noise or scatter or 1.0


def _home(points: FloatArray, shapes: FloatArray) -> dict[str, Any]:
    """Return the ball of the first view: around all but the most outlying points, and all cylinders."""
    low, high = np.quantile(points, (_OUTLYING, 1 - _OUTLYING), axis=0)
    for ends in (shapes[:, :3], shapes[:, 3:6]):
        low = np.minimum(low, (ends - shapes[:, 6:]).min(axis=0, initial=np.inf))
        high = np.maximum(high, (ends + shapes[:, 6:]).max(axis=0, initial=-np.inf))
    return {"center": (0.5 * (low + high)).tolist(), "radius": float(np.linalg.norm(high - low) / 2) or 1.0}


def maps_of(view: View, most_cells: int = MOST_CELLS) -> list[dict[str, Any]]:
    """Unroll every cylinder, with all of its points.

    Parameters
    ----------
    view : View
    most_cells : int
        Maximum number of cells of one map.

    Returns
    -------
    list of dict
        One JSON object per cylinder, the input of `panels.js`.
    """
    order = np.argsort(view.labels, kind="stable")
    ends = np.searchsorted(view.labels[order], np.arange(len(view.shapes) + 1))
    maps = []
    for number, shape in enumerate(view.shapes):
        own = order[ends[number] : ends[number + 1]]
        own = own[np.isfinite(view.residuals[own])]
        residuals = view.residuals[own].astype(np.float64)
        found = unroll(view.points[own], residuals, shape, view.noise, most_cells)
        rows, columns = found.means.shape
        maps.append(
            {
                "columns": columns,
                "rows": rows,
                "reach": found.reach,
                "limit": found.limit,
                "zero": found.zero,
                "means": _packed(found.means),
            }
        )
    return maps


def _packed(values: NDArray[Any]) -> str:
    """Encode the bytes of an array as base64, row after row."""
    return base64.b64encode(np.ascontiguousarray(values).tobytes()).decode("ascii")
