"""Run all trials of a figure in several processes, and summarise them."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from typing import NamedTuple

import numpy as np

from cylx.experiments.figures import Cell, Figure
from cylx.experiments.scans import ObjectScan
from cylx.experiments.table import Key, Trials
from cylx.experiments.trials import Outcome, run_trial
from cylx.fits.cramer_rao import mean_errors_at_bound
from cylx.geometry.arrays import FloatArray

QUANTITIES = ("angle_deg", "offset", "radius_percent", "seconds")


class Task(NamedTuple):
    """A trial to run.

    Parameters
    ----------
    cell : Cell
    trial : int
    """

    cell: Cell
    trial: int


class Summary(NamedTuple):
    """The summary of the trials of a cell.

    Parameters
    ----------
    cell : Cell
    trials : int
        Number of trials.
    found : float
        Mean number of cylinders found.
    means, errors : tuple of float
        Means of the four quantities over the trials that have them, and their standard errors; NaN without any.
    bound : tuple of float or None
        Least mean of the first three, if known.
    """

    cell: Cell
    trials: int
    found: float
    means: tuple[float, ...]
    errors: tuple[float, ...]
    bound: tuple[float, ...] | None


def tasks_of(figure: Figure, trials: int, done: Trials) -> list[Task]:
    """Return the missing trials of a figure, the first trials of all cells first."""
    return [Task(cell, trial) for trial in range(trials) for cell in figure.cells if Key.of(cell, trial) not in done]


def run_tasks(tasks: list[Task], jobs: int, scan: ObjectScan | None) -> Iterator[tuple[Key, Outcome]]:
    """Run trials in their order in several processes.

    Parameters
    ----------
    tasks : list of Task
    jobs : int
        Number of processes; the outcomes do not depend on it, except for the seconds.
    scan : ObjectScan or None
        For figures that need one.

    Yields
    ------
    Key, Outcome
    """
    if not tasks:
        return
    with (
        _single_threaded(),
        ProcessPoolExecutor(
            jobs, mp_context=multiprocessing.get_context("spawn"), initializer=_start_worker, initargs=(scan,)
        ) as pool,
    ):
        try:
            for task, outcome in zip(tasks, pool.map(_work, tasks), strict=True):
                yield Key.of(task.cell, task.trial), outcome
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def summarize(figure: Figure, trials: Trials) -> list[Summary]:
    """Summarise the trials of each cell.

    Parameters
    ----------
    figure : Figure
    trials : dict of Key to Outcome
    """
    by_cell: dict[tuple[str, str, float], list[Outcome]] = {}
    for key in sorted(trials, key=lambda key: key.trial):
        by_cell.setdefault(key[:3], []).append(trials[key])
    out = []
    for cell in figure.cells:
        outcomes = by_cell.get((cell.panel, cell.curve, float(cell.x)), [])
        values = np.array([outcome[1:] for outcome in outcomes]).reshape(-1, len(QUANTITIES))
        means, errors = zip(*(_mean_and_error(column) for column in values.T), strict=True)
        found = float(np.mean([outcome.found for outcome in outcomes])) if outcomes else float("nan")
        out.append(Summary(cell, len(outcomes), found, means, errors, bound_of(figure, cell)))
    return out


def bound_of(figure: Figure, cell: Cell) -> tuple[float, ...] | None:
    """Return the least mean errors of a cell, for figures that measure errors of one synthetic cylinder."""
    if figure.kind != "cylinder":
        return None
    scene = dict(cell.scene)
    theta = np.radians(scene.get("theta_deg", 360.0))
    return mean_errors_at_bound(
        int(scene["points"]), scene["height"], theta, scene["sigma"], scene["sigma_o"], scene["p"]
    )


def _mean_and_error(values: FloatArray) -> tuple[float, float]:
    known = values[np.isfinite(values)]
    if len(known) == 0:
        return float("nan"), float("nan")
    error = float(known.std(ddof=1) / np.sqrt(len(known))) if len(known) > 1 else float("nan")
    return float(known.mean()), error


_worker: dict[str, ObjectScan | None] = {}


def _start_worker(scan: ObjectScan | None) -> None:
    """Prepare a process; its parent handles Ctrl-C."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _worker["scan"] = scan


def _work(task: Task) -> Outcome:
    return run_trial(task.cell, task.trial, _worker["scan"])


@contextmanager
def _single_threaded() -> Iterator[None]:
    """Make processes started meanwhile use one thread for linear algebra and normals, as there is one per core."""
    names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
    before = {name: os.environ.get(name) for name in names}
    os.environ.update(dict.fromkeys(names, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
