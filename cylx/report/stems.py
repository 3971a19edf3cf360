"""The stems of a plot as a page: a map with each stem in its size, and the table. No script, nothing is loaded."""

from __future__ import annotations

import html
import math
from typing import TYPE_CHECKING, Any

import numpy as np

from cylx.palette import cylinder_colors

if TYPE_CHECKING:
    from cylx.records.stems import Ground
    from cylx.results.stems import ResultStem, Stems

_WIDTH = 760.0
_MARGIN = 46.0
_LEAST = 2.5
_STEPS = (0.1, 0.2, 0.25, 0.5, 1.0, 2.0, 2.5, 5.0)
_STYLE = """
body{font:14px/1.45 system-ui,sans-serif;margin:1.5rem auto;max-width:62rem;padding:0 1rem;color:#1c1f23}
table{border-collapse:collapse;font-variant-numeric:tabular-nums}th,td{padding:.15rem .6rem;text-align:right}
th{border-bottom:1px solid #888}tr:nth-child(even) td{background:#f3f4f6}td:last-child{text-align:left}
svg{max-width:100%;height:auto}.contour{fill:none;stroke:#b9a17c;stroke-width:.8}.grid{stroke:#e3e5e8;stroke-width:.6}
text{font:11px system-ui,sans-serif;fill:#444}
@media(prefers-color-scheme:dark){body{color:#e6e6e6;background:#16181c}tr:nth-child(even) td{background:#20242a}
text{fill:#bbb}.grid{stroke:#2b3037}}
"""
_HEADER = ("id", "x", "y", "ground", "DBH, cm", "± cm", "from", "round", "lean", "taper, cm/m", "followed, m", "seen",
           "quality", "remarks")  # fmt: skip


def stems_page(stems: Stems, ground: Ground, unit: float) -> str:
    """Return a page with a map of the stems over the contours of the ground, and their table.

    Parameters
    ----------
    stems : Stems
    ground : Ground
        Metres.
    unit : float
        Metres of a scene unit.
    """
    name = html.escape(stems.input.file)
    rows = "".join(f"<tr>{''.join(f'<td>{cell}</td>' for cell in _cells(stem))}</tr>" for stem in stems.stems)
    head = "".join(f"<th>{cell}</th>" for cell in _HEADER)
    count = len(stems.stems)
    policy = "default-src 'none'; style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'"
    return (
        f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>Stems of {name}</title>'
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">'
        f'<meta name="viewport" content="width=device-width"><style>{_STYLE}</style></head><body>'
        f"<h1>{name}</h1><p>{count} stem{'' if count == 1 else 's'}; ground by {stems.ground_by}; circles have the"
        f" diameter at breast height, small ones are drawn larger.</p>{_map(stems, ground, unit)}"
        f"<table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table></body></html>\n"
    )


def _cells(stem: ResultStem) -> list[str]:
    """Return the cells of a row."""

    def number(value: float | None, digits: int, factor: float = 1.0) -> str:
        return "" if value is None else f"{factor * value:.{digits}f}"

    return [
        str(stem.id), number(stem.x, 2), number(stem.y, 2), number(stem.ground, 2), number(stem.dbh, 1, 100.0),
        number(stem.dbh_sd, 2, 100.0), stem.dbh_from, number(stem.roundness, 2), f"{stem.lean_deg:.1f}°",
        number(stem.taper, 2, 100.0), f"{stem.lowest:.1f} to {stem.highest:.1f}", f"{stem.arc_deg:.0f}°",
        number(stem.quality, 2), html.escape("; ".join(stem.flags)),
    ]  # fmt: skip


def _map(stems: Stems, ground: Ground, unit: float) -> str:
    """Return the map as SVG: y upwards, one metre the same either way."""
    low = np.array(stems.input.bounds.min[:2]) * unit
    high = np.array(stems.input.bounds.max[:2]) * unit
    size = np.maximum(high - low, 1e-6)
    scale = (_WIDTH - 2 * _MARGIN) / float(size.max())
    wide, tall = (float(side) * scale + 2 * _MARGIN for side in size)

    def at(x: float, y: float) -> tuple[float, float]:
        return _MARGIN + (x - low[0]) * scale, tall - _MARGIN - (y - low[1]) * scale

    step = _round_step(float(size.max()) / 5.0)
    parts = [*_grid(low, high, step, at, unit), *_contours(ground, at)]
    colors = cylinder_colors(np.arange(len(stems.stems)))
    for stem, color in zip(stems.stems, colors, strict=True):
        x, y = at(stem.x * unit, stem.y * unit)
        r = max(_LEAST, 0.5 * stem.dbh * scale)
        dash = ' stroke-dasharray="3 2"' if stem.flags else ""
        fill = "#{:02x}{:02x}{:02x}".format(*(int(c) for c in color))
        said = f"{stem.id}: {100 * stem.dbh:.1f} cm"
        parts.append(
            f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{r:.1f}" fill="{fill}" stroke="#222"{dash}><title>{said}</title>'
            f'</circle><text x="{x + r + 2:.1f}" y="{y + 4:.1f}">{stem.id}</text>'
        )
    return (
        f'<svg viewBox="0 0 {wide:.0f} {tall:.0f}" width="{wide:.0f}" role="img" aria-label="map of the stems">'
        f"{''.join(parts)}</svg>"
    )


def _round_step(least: float) -> float:
    power = 10.0 ** math.floor(math.log10(max(least, 1e-9)))
    return next(power * step for step in (*(10 * s for s in _STEPS), 100.0) if power * step >= least)


def _grid(low: Any, high: Any, step: float, at: Any, unit: float) -> list[str]:  # noqa: ANN401  arrays, a function
    """Return the lines of the grid with their coordinates, in scene units."""
    out = []
    for x in np.arange(math.ceil(low[0] / step), math.floor(high[0] / step) + 1) * step:
        (x0, y0), (x1, y1) = at(x, low[1]), at(x, high[1])
        out.append(f'<line class="grid" x1="{x0:.1f}" y1="{y0:.1f}" x2="{x1:.1f}" y2="{y1:.1f}"/>')
        out.append(f'<text x="{x0:.1f}" y="{y0 + 16:.1f}" text-anchor="middle">{x / unit:.10g}</text>')
    for y in np.arange(math.ceil(low[1] / step), math.floor(high[1] / step) + 1) * step:
        (x0, y0), (x1, y1) = at(low[0], y), at(high[0], y)
        out.append(f'<line class="grid" x1="{x0:.1f}" y1="{y0:.1f}" x2="{x1:.1f}" y2="{y1:.1f}"/>')
        out.append(f'<text x="2" y="{y0 - 3:.1f}">{y / unit:.10g}</text>')
    return out


def _contours(ground: Ground, at: Any) -> list[str]:  # noqa: ANN401  a function
    """Return the contours of the ground, by marching squares over the middles of its cells."""
    h = ground.heights
    spread = float(np.ptp(h))
    if min(h.shape) < 2 or spread < 0.05:
        return []
    step = _round_step(spread / 8.0)
    x = ground.corner[0] + (np.arange(h.shape[0]) + 0.5) * ground.cell
    y = ground.corner[1] + (np.arange(h.shape[1]) + 0.5) * ground.cell
    every = max(1, max(h.shape) // 150)
    h, x, y = h[::every, ::every], x[::every], y[::every]
    pieces = []
    for level in np.arange(math.ceil(h.min() / step), math.floor(h.max() / step) + 1) * step:
        above = h > level
        mixed = above[:-1, :-1].astype(int) + above[1:, :-1] + above[:-1, 1:] + above[1:, 1:]
        for i, j in np.argwhere((mixed > 0) & (mixed < 4)):
            corners = ((i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1))
            ends = []
            for k in range(4):
                (a, b), (c, d) = corners[k], corners[(k + 1) % 4]
                if above[a, b] != above[c, d]:
                    t = (level - h[a, b]) / (h[c, d] - h[a, b])
                    ends.append(at(x[a] + t * (x[c] - x[a]), y[b] + t * (y[d] - y[b])))
            pieces += [
                f"M{ends[k][0]:.1f} {ends[k][1]:.1f}L{ends[k + 1][0]:.1f} {ends[k + 1][1]:.1f}"
                for k in range(0, len(ends) - 1, 2)
            ]
    return [f'<path class="contour" d="{"".join(pieces)}"/>'] if pieces else []
