"""Draw the figures."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

import numpy as np

from cylx.experiments.figures import UNSURE, Figure
from cylx.experiments.study import QUANTITIES, Summary
from cylx.experiments.table import Trials
from cylx.optional.matplotlib import new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

DPI = 110
LABELS = {
    "angle_deg": "axis angle, °",
    "offset": "axis offset, radii",
    "radius_percent": "radius error, %",
    "seconds": "seconds",
}
COLORS = {
    "gt": "#1f4e9c", "msac": "#e08214", "line-fit": "#35978f", "tran": "#b2182b", "jin": "#8073ac", "auto": "#000000",
    UNSURE: "#7f7f7f",
}  # fmt: skip
SHADES = ("#c7a008", "#35978f", "#1f4e9c", "#7b3294", "#b2182b")


def draw(figure: Figure, summaries: list[Summary], trials: Trials) -> bytes:
    """Draw a figure.

    Parameters
    ----------
    figure : Figure
    summaries : list of Summary
    trials : dict of Key to Outcome

    Returns
    -------
    bytes
        A PNG.

    Raises
    ------
    UsageError
        If matplotlib is not installed.
    """
    rows = [quantity for quantity in QUANTITIES if quantity in _shown(figure)]
    panels = figure.panels
    canvas = new_figure((5.2 * len(panels) + 1.8, 2.7 * len(rows) + 0.8), DPI, layout="constrained")
    grid = canvas.subplots(len(rows), len(panels), squeeze=False, sharex="col")
    for i, quantity in enumerate(rows):
        for j, panel in enumerate(panels):
            axes = grid[i][j]
            here = [summary for summary in summaries if summary.cell.panel == panel and summary.trials]
            (_boxes if figure.boxes else _curves)(axes, here, quantity, trials)
            if figure.logarithmic or figure.boxes:
                axes.set_yscale("log")
            axes.set_ylabel(LABELS[quantity] if figure.kind != "cans" else "angle between the axes, °")
            axes.grid(visible=True, which="major", alpha=0.3)
            if i == 0 and panel:
                axes.set_title(panel, fontsize=10)
            if i == len(rows) - 1:
                axes.set_xlabel(figure.x_label or panel)
    handles = {
        label: handle for axes in grid.flat for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    canvas.legend(handles.values(), handles.keys(), loc="outside right upper", fontsize=9)
    canvas.suptitle(f"Figure {figure.number}: {figure.title}", fontsize=11)
    picture = io.BytesIO()
    canvas.savefig(picture, format="png")
    return picture.getvalue()


def _shown(figure: Figure) -> tuple[str, ...]:
    """Return the quantities that a kind of figure shows."""
    if figure.kind == "cylinder":
        return QUANTITIES[:3]
    return QUANTITIES[:1] if figure.kind == "cans" else QUANTITIES[3:]


def _curves(axes: Axes, here: list[Summary], quantity: str, _trials: Trials) -> None:
    """Draw means with standard errors, curves with a single position as a level line, and the bound."""
    index = QUANTITIES.index(quantity)
    curves = list(dict.fromkeys(summary.cell.curve for summary in here))
    levels = [summary.cell.curve for summary in here]
    for curve in curves:
        own = [summary for summary in here if summary.cell.curve == curve]
        style = _style(own[0], [name for name in curves if name.partition(" ")[0] == curve.partition(" ")[0]])
        if levels.count(curve) == 1 and len(here) > len(curves):
            axes.axhline(own[0].means[index], label=curve, linestyle="--", linewidth=1.2, **style)
            continue
        x, y = [summary.cell.x for summary in own], [summary.means[index] for summary in own]
        bars = [np.nan_to_num(summary.errors[index]) for summary in own]  # NaN for a single trial
        axes.errorbar(x, y, bars, label=curve, marker="o", markersize=3, linewidth=1.3, capsize=2, **style)
    bounds = {summary.cell.x: summary.bound[index] for summary in here if summary.bound}
    if len({curve.partition(" ")[2] for curve in curves}) == 1 and len(bounds) > 1:
        places = sorted(bounds)
        axes.plot(places, [bounds[x] for x in places], color="grey", linestyle=":", label="bound")


def _style(summary: Summary, family: list[str]) -> dict[str, Any]:
    """Return the line style of a method; several curves of one method differ in shade."""
    if len(family) > 1:
        return {"color": SHADES[family.index(summary.cell.curve) % len(SHADES)]}
    if summary.cell.curve == UNSURE:  # drawn behind the default
        return {"color": COLORS[UNSURE], "zorder": 1.5}
    return {"color": COLORS[summary.cell.method]}


def _boxes(axes: Axes, here: list[Summary], quantity: str, trials: Trials) -> None:
    """Draw a box for each position, and the bound as a line."""
    index = QUANTITIES.index(quantity)
    for summary in here:
        cell = summary.cell
        own = (cell.panel, cell.curve, float(cell.x))
        values = [outcome[1 + index] for key, outcome in trials.items() if key[:3] == own]
        known = [value for value in values if np.isfinite(value)]
        axes.boxplot([known], positions=[cell.x], widths=6.0, manage_ticks=False, flierprops={"markersize": 2})
    bounds = {summary.cell.x: summary.bound[index] for summary in here if summary.bound}
    axes.plot(list(bounds), list(bounds.values()), color="grey", linestyle=":", label="bound")
