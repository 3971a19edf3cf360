"""Run one trial: make a scene, find its cylinders by a method, and measure the errors."""

from __future__ import annotations

import time
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from cylx.config import Config, load_config
from cylx.experiments.figures import Cell
from cylx.experiments.scans import ObjectScan, cans_among_clutter, two_cans
from cylx.geometry.arrays import FloatArray
from cylx.geometry.cylinder import Cylinder
from cylx.pipeline import extract_cylinders
from cylx.records import Extraction, PointCloud, stream
from cylx.synthetic import single

DISTANCE, NEIGHBOURHOOD = 0.0144, 0.286
"""2 mm, the paper's distance, and 1.2 radii, as shares of the extent of a soup can."""


class Outcome(NamedTuple):
    """The outcome of a trial.

    Parameters
    ----------
    found : int
        Number of true cylinders that were found.
    angle_deg : float
        Angle between the axis and the true one, or between two axes, degrees; NaN if they were not found.
    offset : float
        Distance of the cylinder's true middle from the axis, radii; NaN if it was not measured.
    radius_percent : float
        Error of the radius, percent; NaN if it was not measured.
    seconds : float
        Time of the extraction.
    """

    found: int
    angle_deg: float
    offset: float
    radius_percent: float
    seconds: float


def run_trial(cell: Cell, trial: int, scan: ObjectScan | None) -> Outcome:
    """Run a cell once.

    Parameters
    ----------
    cell : Cell
    trial : int
        Seed of the scene and of the method.
    scan : ObjectScan or None
        For cells with cans.

    Returns
    -------
    Outcome
    """
    scene = dict(cell.scene)
    if scan is None:
        truth = single(**{**scene, "points": int(scene["points"])}, seed=trial)  # type: ignore[arg-type]  # floats
        found, seconds = _timed(truth.points, config_of(cell, trial, most=1))
        return _single_outcome(truth.cylinders[0].cylinder, found, seconds)
    rng = stream(trial, "trials")
    if "cans" in scene:
        points, centers = cans_among_clutter(scan, int(scene["cans"]), int(scene["points"]), rng)
    else:
        seen = _seen_from(scan, scene.get("view_deg", 0.0), scene.get("side", 1.0))
        points, centers = two_cans(seen, scan.center, scene["share"], rng)
    found, seconds = _timed(points, config_of(cell, trial, most=len(centers), extent=scan.extent))
    return _cans_outcome(centers, found, seconds)


@lru_cache
def _seen_from(scan: ObjectScan, view_deg: float, side: float) -> ObjectScan:
    """Return the visible part of a scan; cached, as its normals take seconds. Scans are compared by identity."""
    return scan.seen_from(view_deg, side)


def config_of(cell: Cell, trial: int, *, most: int, extent: float | None = None) -> Config:
    """Build the configuration of a trial.

    Parameters
    ----------
    cell : Cell
    trial : int
        Seed.
    most : int
        Number of cylinders in the scene; not given to the default method.
    extent : float, optional
        Extent of the scanned object; the distances of the competitors are shares of it.
    """
    if cell.method == "auto":
        return load_config(overrides=cell.settings, options={"seed": trial})
    distances = (
        () if extent is None else tuple(f"{name}.distance={DISTANCE * extent}" for name in ("msac", "tran", "jin"))
    )
    ball = () if extent is None else (f"jin.neighbourhood={NEIGHBOURHOOD * extent}",)
    options = {"method": cell.method, "seed": trial, "max_cylinders": most}
    return load_config(preset="paper", overrides=(*cell.settings, *distances, *ball), options=options)


def _timed(points: FloatArray, config: Config) -> tuple[Extraction, float]:
    started = time.perf_counter()
    found = extract_cylinders(PointCloud(points), config, threads=1)
    return found, time.perf_counter() - started


def _single_outcome(true: Cylinder, found: Extraction, seconds: float) -> Outcome:
    """Measure the cylinder with the most points; the order of the result is by confidence."""
    if not found.cylinders:
        return Outcome(0, np.nan, np.nan, np.nan, seconds)
    shape = max(found.cylinders, key=lambda fit: fit.inliers).cylinder
    offset = float(np.linalg.norm(np.cross(true.point - shape.point, shape.direction))) / true.radius
    percent = 100 * abs(shape.radius - true.radius) / true.radius
    return Outcome(1, _angle_deg(true.direction, shape.direction), offset, percent, seconds)


def _cans_outcome(centers: FloatArray, found: Extraction, seconds: float) -> Outcome:
    """Find the cylinder of each can: that with the most points whose axis passes its middle within half a radius."""
    axes = []
    for center in centers:
        own = [
            fit
            for fit in found.cylinders
            if np.linalg.norm(np.cross(center - fit.cylinder.point, fit.cylinder.direction)) < 0.5 * fit.cylinder.radius
            and np.linalg.norm(center - fit.cylinder.point) < 0.5 * fit.cylinder.height + fit.cylinder.radius
        ]
        if own:
            axes.append(max(own, key=lambda fit: fit.inliers).cylinder.direction)
    angle = _angle_deg(axes[0], axes[1]) if len(axes) == len(centers) == 2 else np.nan
    return Outcome(len(axes), angle, np.nan, np.nan, seconds)


def _angle_deg(u: FloatArray, v: FloatArray) -> float:
    """Return the angle between two axes, degrees."""
    return float(np.degrees(np.arctan2(np.linalg.norm(np.cross(u, v)), abs(float(u @ v)))))
