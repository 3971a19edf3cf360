"""Write the tables and pictures of docs/experiments.md from what `cylx reproduce` left in a folder.

With --cylfit N, cylfit (if it is installed) is run on N trials of every cell of figures 7 to 9, too, with its defaults;
its trials are kept in the folder as cylfit-7.csv and so on, and are not run again.
"""

import argparse
import re
import shutil
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np
from runs import ROOT
from single import errors_of
from tables import number

from cylx.experiments import FIGURES, Cell, Key, Outcome, header_line, parse_trials, summarize, trial_lines
from cylx.geometry.cylinder import Cylinder
from cylx.synthetic import single

PAGE = ROOT / "docs" / "experiments.md"
PICTURES = ROOT / "docs" / "pictures"
BOUNDED = (7, 8, 9)
QUANTITIES = ("angle, °", "offset, r", "radius, %", "seconds")
WORST, WORST_30 = 1.1, 1.3
"""What the default's errors over their bounds are held to, from 50° on and at 30°."""


def cells_at(figure):
    """Give the panels and places of a figure, each with its scene."""
    return list(dict.fromkeys((cell.panel, cell.x, cell.scene) for cell in figure.cells))


def try_cylfit(task):
    """Fit one scene by cylfit."""
    import cylfit

    (panel, x, scene), trial = task
    parameters = {**dict(scene), "points": int(dict(scene)["points"])}
    truth = single(**parameters, seed=trial)
    start = time.perf_counter()
    fit = cylfit.fit_cylinder(truth.points, random_state=trial)
    seconds = time.perf_counter() - start
    direction = np.asarray(fit.axis_direction, float)
    found = Cylinder(fit.axis_point, direction / np.linalg.norm(direction), fit.radius, 1.0)
    return Key(panel, "cylfit", float(x), trial), Outcome(1, *errors_of(truth.cylinders[0].cylinder, found), seconds)


def run_cylfit(folder, trials, jobs):
    """Run what is missing of cylfit."""
    for number_of_figure in BOUNDED:
        path = folder / f"cylfit-{number_of_figure}.csv"
        done = read(path)
        tasks = [(place, trial) for trial in range(trials) for place in cells_at(FIGURES[number_of_figure])]
        tasks = [task for task in tasks if Key(task[0][0], "cylfit", float(task[0][1]), task[1]) not in done]
        with ProcessPoolExecutor(jobs) as pool:
            done.update(pool.map(try_cylfit, tasks, chunksize=4))
        path.write_text(header_line() + trial_lines(sorted(done.items())), encoding="utf-8")


def read(path):
    """Read the trials of a table; none if it is not there."""
    return parse_trials(path.read_text(encoding="utf-8"), None) or {} if path.exists() else {}


def summaries_of(folder, number_of_figure, curves=None):
    """Read a figure's table, with the cells of cylfit if there are any."""
    figure = FIGURES[number_of_figure]
    trials = {**read(folder / f"figure-{number_of_figure}.csv"), **read(folder / f"cylfit-{number_of_figure}.csv")}
    extra = tuple(Cell(panel, "cylfit", x, "cylfit", scene) for panel, x, scene in cells_at(figure))
    with_extra = figure._replace(cells=(*figure.cells, *extra)) if curves else figure
    return [summary for summary in summarize(with_extra, trials) if summary.trials]


def rows_of(header, rows):
    """Write a markdown table."""
    return "\n".join(["| " + " | ".join(row) + " |" for row in (header, ["---"] * len(header), *rows)])


def figure_table(folder, number_of_figure):
    """Write the means of a figure: a row a place, a column a curve."""
    figure, summaries = FIGURES[number_of_figure], summaries_of(folder, number_of_figure)
    shown = {"cylinder": (0, 1, 2), "cans": (0,)}.get(figure.kind, (3,))
    curves = list(dict.fromkeys(summary.cell.curve for summary in summaries))
    by_place = {(s.cell.panel, s.cell.x, s.cell.curve): s for s in summaries}
    rows = []
    for panel, x in dict.fromkeys((s.cell.panel, s.cell.x) for s in summaries):
        cells = [by_place.get((panel, x, curve)) for curve in curves]
        texts = ["" if s is None else " / ".join(number(s.means[i], 2) for i in shown) + lost(s) for s in cells]
        rows.append([*([panel] if len(figure.panels) > 1 else []), f"{x:g}", *texts])
    trials = sorted({summary.trials for summary in summaries})
    told = f"{trials[0]}" if len(trials) == 1 else f"{trials[0]} to {trials[-1]}"
    header = [*(["panel"] if len(figure.panels) > 1 else []), figure.x_label or "x", *curves]
    return f"Means of {told} trials: {' / '.join(QUANTITIES[i] for i in shown)}.\n\n{rows_of(header, rows)}"


def lost(summary):
    """Say how many were found, where not all were."""
    there = int(dict(summary.cell.scene).get("cans", 2 if "share" in dict(summary.cell.scene) else 1))
    return "" if summary.found == there else f" ({summary.found / there:.0%} found)"


def bound_table(folder):
    """Write errors over bounds, angle / offset / radius, for every cell of figures 7 to 9; count what is too much."""
    rows, worse = [], 0
    for number_of_figure in BOUNDED:
        summaries = summaries_of(folder, number_of_figure, curves=True)
        for panel, x, scene in cells_at(FIGURES[number_of_figure]):
            here = {s.cell.method: s for s in summaries if (s.cell.panel, s.cell.x) == (panel, x)}
            ratios = {name: np.array(s.means[:3]) / s.bound for name, s in here.items()}
            limit = WORST_30 if dict(scene).get("theta_deg", 360) < 50 else WORST
            met = "auto" in ratios and bool((ratios["auto"] <= limit).all())
            worse += not met
            place = ", ".join(f"{k} = {v:g}" for k, v in scene if k in ("sigma", "sigma_o", "p", "theta_deg"))
            names = ("auto", "cylfit", "gt", "line-fit", "msac", "tran", "jin")
            texts = [
                " / ".join(number(r, 3 if n == "auto" else 2) for r in ratios[n]) if n in ratios else "" for n in names
            ]
            trials = str(here["auto"].trials) if "auto" in here else ""
            rows.append([f"{number_of_figure}: {place}", trials, *texts, f"≤ {limit}: {'met' if met else 'MISSED'}"])
    names = ["auto", "cylfit", "gt, the paper", "line-fit", "msac", "tran", "jin"]
    return rows_of(["figure and cell", "trials of auto", *names, "auto held to"], rows), worse


def write_part(page, name, text):
    """Put text between the markers of a name."""
    pattern = re.compile(f"(<!-- begin {name} -->\n).*?(<!-- end {name} -->)", re.DOTALL)
    assert len(pattern.findall(page)) == 1, name
    return pattern.sub(lambda found: f"{found[1]}\n{text}\n\n{found[2]}", page)


def main():
    """Write all parts of the page there are data for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="what --out of `cylx reproduce` named")
    parser.add_argument("--cylfit", type=int, default=0, metavar="N", help="trials of cylfit")
    parser.add_argument("--jobs", type=int, default=2)
    a = parser.parse_args()
    if a.cylfit:
        run_cylfit(a.folder, a.cylfit, a.jobs)
    page = PAGE.read_text(encoding="utf-8")
    for figure in FIGURES:
        if (a.folder / f"figure-{figure}.csv").exists():
            page = write_part(page, f"figure-{figure}", figure_table(a.folder, figure))
            shutil.copy(a.folder / f"figure-{figure}.png", PICTURES / f"figure-{figure}.png")
    table, worse = bound_table(a.folder)
    PAGE.write_text(write_part(page, "over-bound", table), encoding="utf-8")
    print(f"{worse} cells missed")
    return 1 if worse else 0


if __name__ == "__main__":
    sys.exit(main())
