"""The first run after an installation compiles the kernels: a stage of its own, shared with a second process.

Numba compiles one kernel at a time in a process, and keeps what it has compiled in files. While this process practises
the method from its beginning on, another one practises its end; what that has finished need only be read here.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cylx.config import Config
from cylx.geometry.arrays import FloatArray
from cylx.geometry.cylinder import DIRECTION, POINT, RADIUS
from cylx.geometry.kernels import (
    all_times_compiled,
    at_each_kernel,
    damaged_files,
    folder_of,
    is_kept,
    kept_files,
    times_compiled,
)
from cylx.geometry.morton import find_cell, morton_codes
from cylx.pipeline import extract_cylinders
from cylx.pipeline.assembly import assemble
from cylx.pipeline.candidates import candidates_of_slices, candidates_of_windows, cut_slices, ellipses_of_slices
from cylx.pipeline.rounds import Rounds
from cylx.pipeline.stage_log import StageLog
from cylx.records import (
    Candidates,
    Explained,
    Frame,
    IndexedCloud,
    Nearby,
    Noise,
    Observer,
    PointCloud,
    Scene,
    SilentObserver,
)
from cylx.scene import Prepared, resolve
from cylx.stages.clustering import CandidateGame
from cylx.stages.rims import find_rims

SPACING, SIGMA = 0.1, 0.005
LEVEL = 16
"""Of the voxels; below them a kernel cannot tell cells from one another anyway."""


def compile_kernels(observer: Observer) -> None:
    """Compile the kernels that are not compiled yet, by practising the whole method on a small cloud."""
    if kernels_are_cold():
        with StageLog(observer).stage("compiling"), second_process() if kernels_are_kept() else nullcontext():
            extract_cylinders(PointCloud(practice_cloud()), Config(), threads=1)


@dataclass(frozen=True, slots=True)
class Warmed:
    """What compiling ahead has done.

    Parameters
    ----------
    compiled : int
        Number of kernels that were compiled now.
    kept : int
        Number of kernels that are kept for later runs.
    folder : str or None
        The folder, or the one above several, where they are kept; None if nothing can be saved.
    seconds : float
    """

    compiled: int
    kept: int
    folder: str | None
    seconds: float


def warm_up(observer: Observer) -> Warmed:
    """Compile all kernels that are not kept yet, also where only some are missing, by practising the whole method.

    Parameters
    ----------
    observer : Observer
        Receives the stage `compiling`.
    """
    began, before, compiled = time.perf_counter(), kept_files(), all_times_compiled()
    saved, cold = kernels_are_kept(), kernels_are_cold()
    with StageLog(observer).stage("compiling"), second_process() if saved and cold else nullcontext():
        extract_cylinders(PointCloud(practice_cloud()), Config(), threads=1)
    after, here = kept_files(), all_times_compiled() - compiled
    # the second process has compiled some, which this one has only read
    new = sum(before.get(path) != written for path, written in after.items())
    count = new if saved and here else here
    folder = _common_folder(after) if saved else None
    return Warmed(count, len(after), folder, time.perf_counter() - began)


def _common_folder(files: Iterable[Path]) -> str | None:
    """Name the folder that all files are in or below."""
    try:
        return os.path.commonpath([path.parent for path in files])
    except ValueError:  # there are none, or they are on several drives
        return kernel_folder()


def ask_between_kernels(call: Callable[[], None]) -> None:
    """Call a function before each kernel is loaded or compiled, for example to notice Ctrl-C."""
    at_each_kernel(call)


def kernels_are_cold() -> bool:
    """Return whether kernels have yet to be compiled: the smallest of them is called, and says where it came from."""
    before = times_compiled(find_cell)
    find_cell(np.zeros(1, np.int64), 0)
    return times_compiled(find_cell) > before


def kernel_folder() -> str | None:
    """Name the folder where compiled kernels are kept; None if there is none."""
    return folder_of(find_cell)


def kernels_are_kept() -> bool:
    """Return whether compiled kernels can be saved for the next run."""
    return is_kept(find_cell)


def damaged_kernels() -> list[str]:
    """Return the names of damaged files among the kept kernels; they are compiled again."""
    return damaged_files()


def practice_cloud() -> FloatArray:
    """Return a small cloud that calls every kernel: two cylinders and a floor, shape (N, 3)."""
    rng = np.random.default_rng(0)
    turn, height = 2.0 * np.pi * rng.random(2500), 4.0 * rng.random(2500)
    cylinder = np.column_stack([np.cos(turn), np.sin(turn), height])
    floor = np.column_stack([12.0 * rng.random((2500, 2)) - 4.0, np.zeros(2500)])
    points = np.concatenate([cylinder, cylinder + np.array([4.0, 0.0, 0.0]), floor])
    return np.asarray(points + SIGMA * rng.standard_normal(points.shape))


@contextmanager
def second_process() -> Iterator[None]:
    """Let another process compile the kernels of the method's end meanwhile, where one can be started."""
    if not (sys.executable and Path(sys.executable).stem.startswith("python")):
        yield  # an interpreter inside another program
        return
    # where modules are is said here: by itself it would look for them in the current folder first
    places = [place for place in sys.path if place]
    code = f"import sys; sys.path[:] = {places!r}; from {__name__} import practise_the_end; practise_the_end()"
    command = [sys.executable, "-c", code]
    try:
        helper = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
    except OSError:
        yield
        return
    try:
        yield
    finally:
        helper.kill()
        helper.wait()


def practise_the_end() -> None:
    """Go through what comes late in the method: rims, slices, local slices, and the game with known candidates."""
    scene = Scene(SPACING, SIGMA, 16.0)
    config = resolve(Config(), scene)
    cloud = PointCloud(practice_cloud())
    prepared = Prepared(cloud, _practice_frame(cloud.points), scene, config, (0.5, 100.0), None, None, 1)
    log, count = StageLog(SilentObserver()), len(cloud.points)
    explained = Explained(np.zeros(count), np.zeros(count, np.bool_))
    indexed = IndexedCloud.of(prepared.frame, explained.flatness)
    # in an order in which neither process compiles what the other one is at: what windows and clusters are fitted by is
    # compiled by the other one at its beginning, so they come after the rims
    find_rims(prepared.frame, np.array([[0.0, 0.0, 1.0]]), _practice_normals(prepared.frame), prepared.radii, 1)
    candidates = _practice_candidates(prepared.frame)
    rounds = Rounds(prepared, indexed, CandidateGame(candidates, config.clustering, 1), candidates)
    for clusters in rounds.clusters(log):
        rounds.verify(rounds.fit(clusters), log)
    assemble(prepared, indexed, rounds.merge(log), rounds.rejected, log.reports)
    ellipses = ellipses_of_slices(prepared, cut_slices(prepared, explained.flatness, log), log)
    candidates_of_slices(prepared, ellipses, log)
    candidates_of_windows(prepared, explained, log)


def _practice_frame(points: FloatArray) -> Frame:
    """Put the practice cloud into its frame without measuring it."""
    corner, side = points.min(axis=0), float(np.ptp(points, axis=0).max())
    unit = side / SPACING / (2**21 - 2)
    codes = morton_codes((points - corner) / SPACING, unit, side / SPACING)
    order = np.argsort(codes)
    noise = Noise(np.array([1.0, 10.0]), np.full(2, SIGMA / SPACING))
    inside = np.ascontiguousarray(((points - corner) / SPACING)[order])
    return Frame(inside, order, codes[order], unit, LEVEL, 6.0 * unit * 2.0**LEVEL, noise, corner, SPACING)


def _practice_normals(frame: Frame) -> Nearby:
    """Return the normals of the cylinders of the practice cloud, and of its floor."""
    places = frame.points * frame.spacing + frame.origin
    normals = np.zeros(places.shape, np.float32)
    middles = np.where(places[:, 0] > 2.0, 4.0, 0.0)
    normals[:, :2] = places[:, :2] - np.column_stack([middles, np.zeros(len(places))])
    on_floor = np.abs(places[:, 2]) < 4.0 * SIGMA
    normals[on_floor] = (0.0, 0.0, 1.0)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return Nearby(normals, np.arange(len(places)), on_floor)


def _practice_candidates(frame: Frame) -> Candidates:
    """Return candidates of the two cylinders of the practice cloud."""
    rng = np.random.default_rng(1)
    models = np.empty((60, 7))
    models[:, POINT] = np.column_stack([4.0 * (np.arange(60) % 2), np.zeros(60), 4.0 * rng.random(60)])
    models[:, POINT] = (models[:, POINT] - frame.origin) / frame.spacing
    models[:, DIRECTION] = np.array([0.0, 0.0, 1.0]) + 0.002 * rng.standard_normal((60, 3))
    models[:, DIRECTION] /= np.linalg.norm(models[:, DIRECTION], axis=1, keepdims=True)
    models[:, RADIUS] = (1.0 + 0.002 * rng.standard_normal(60)) / frame.spacing
    return Candidates(models, np.arange(60), np.full(60, 5.0), np.full(60, 100), np.full(60, 5.0))
