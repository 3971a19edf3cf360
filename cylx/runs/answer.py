"""What was traced -> the answer in scene units: cylinders with their new ends, fittings, runs and labels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from cylx.geometry.arrays import FloatArray
from cylx.geometry.coverage import covered_angle
from cylx.geometry.cylinder import cylinder_coordinates
from cylx.records import CylinderFit, Fitting, PipeRun, Piping
from cylx.runs.pipes import Pipe, Surroundings, swapped
from cylx.runs.tracing import Trace

PLACES = ("center", "start", "end")
FOUND_ALONG = 0.9
"""Confidence of a pipe that was found along a run, at most."""


@dataclass(frozen=True, slots=True, eq=False)
class Traced:
    """The cylinders of a cloud after they were joined.

    Parameters
    ----------
    cylinders : tuple of CylinderFit
        Those that were given and are no part of a fitting, in their order, with new ends; then those found along runs.
    origins : tuple of int or None
        Which of the given cylinders each was; None for one found along a run.
    labels : ndarray of shape (N,), int32
        Cylinder of each point, -1 for none.
    residuals : ndarray of shape (N,), float32
        Signed distance to its surface, NaN for none.
    piping : Piping
    """

    cylinders: tuple[CylinderFit, ...]
    origins: tuple[int | None, ...]
    labels: NDArray[np.int32]
    residuals: NDArray[np.float32]
    piping: Piping


def answer_of(trace: Trace, runs: tuple[PipeRun, ...], fits: Sequence[CylinderFit], near: Surroundings) -> Traced:
    """Put what was traced into scene units, and label the points."""
    count = len(near.points)
    owners, fitting_of = np.full(count, -1, np.int32), np.full(count, -1, np.int32)
    for k, points in enumerate(trace.points):
        fitting_of[near.order[points]] = k
    number = {pipe.label: k for k, pipe in enumerate(trace.pipes)}
    for label, k in number.items():
        owners[near.order[near.labels == label]] = k
    residuals = np.full(count, np.nan, np.float32)
    cylinders = []
    for k, pipe in enumerate(trace.pipes):
        if pipe.source is None:
            own = near.order[near.on(pipe)]
            owners[own[owners[own] < 0]] = k
        own = np.flatnonzero(owners == k)
        _, distances, angles = cylinder_coordinates(near.origin_points(own), pipe.middle, pipe.direction)
        errors = distances - pipe.radius
        residuals[own] = errors
        cylinders.append(_cylinder(pipe, fits, near, errors, angles))
    fittings = tuple(_moved(one, near.origin) for one in trace.fittings)
    sources = tuple(pipe.source for pipe in trace.pipes)
    return Traced(tuple(cylinders), sources, owners, residuals, Piping(fittings, runs, fitting_of))


def in_order(trace: Trace) -> Trace:
    """Return what was traced with the ends of all pipes as cylinders have them."""
    out = Trace([pipe.canonical() for pipe in trace.pipes], trace.near)
    changed = {k for k, pipe in enumerate(trace.pipes) if pipe.is_turned}
    for fitting, points in zip(trace.fittings, trace.points, strict=True):
        out.add(turn_ends(fitting, changed), points)
    return out


def turn_ends(fitting: Fitting, changed: set[int]) -> Fitting:
    """Return a fitting with the names of the ends of some pipes the other way round."""
    return replace(fitting, ends=swapped(fitting.ends, fitting.joins, changed))


def _cylinder(
    pipe: Pipe, fits: Sequence[CylinderFit], near: Surroundings, errors: FloatArray, angles: FloatArray
) -> CylinderFit:
    """Return a pipe as a cylinder; what is known of the one that it was is kept."""
    shape = pipe.cylinder(near.origin)
    if pipe.source is None:
        coverage = covered_angle(angles) if len(angles) else 0.0
        rmse = float(np.sqrt((errors**2).mean())) if len(errors) else 0.0
        trust = float(FOUND_ALONG * (1.0 - np.exp(-len(errors) / 20.0)))
        return CylinderFit(shape, len(errors), rmse, coverage, 0, None, trust, covariance=pipe.covariance)
    fit = fits[pipe.source]
    covariance = None if fit.covariance is None else pipe.covariance
    if not len(errors):
        return replace(fit, cylinder=shape, covariance=covariance)
    rmse = float(np.sqrt((errors**2).mean()))
    return replace(fit, cylinder=shape, covariance=covariance, inliers=len(errors), rmse=rmse)


def _moved(fitting: Fitting, origin: FloatArray) -> Fitting:
    """Return a fitting in scene units."""
    names = {one.name for one in fields(fitting)} & set(PLACES)
    return replace(fitting, **{name: getattr(fitting, name) + origin for name in names})
