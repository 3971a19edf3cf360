"""The two sources of candidates: slices, as in the paper, and local curvature; and which of them may play."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from cylx.config import Config
from cylx.geometry.lines import are_along
from cylx.pipeline.stage_log import StageLog
from cylx.records import Candidates, EllipseFit, Explained, Frame
from cylx.stages.candidates import polish_candidates, propose_cylinders
from cylx.stages.curvature import find_curved_windows
from cylx.stages.ellipses import fit_ellipses
from cylx.stages.local_slices import slice_windows
from cylx.stages.slicing import cut_slice, draw_planes

FloatArray = NDArray[np.float64]

LARGE = 6.0
"""Flat windows of more than this many times the smallest one's radius hold planes; a cylinder is flat in small ones."""
LINK = 4.0
"""Points of a slice within this many spacings are connected."""
MARGIN = 5.0
"""A candidate, which saw a few points, may be off the axis that is asked for by so many degrees more."""


def windows_and_explained(
    frame: Frame, radii: tuple[float, float], config: Config, threads: int, log: StageLog
) -> tuple[Candidates, Explained]:
    """Propose candidates from curved windows, and tell which points lie in flat ones."""
    if "curvature" in config.candidates.sources:
        windows, explained, report = find_curved_windows(frame, radii, config.candidates, threads)
        log.reports.append(report)
        return windows, explained
    explained = Explained(np.zeros(len(frame.points)), np.zeros(len(frame.points), np.bool_))
    if config.slicing.local_planes:  # slices, too, pass over what is flat
        explained.flatness[:] = find_curved_windows(frame, radii, config.candidates, threads)[1].flatness
    return Candidates.joined([]), explained


def ellipses_of_slices(
    frame: Frame, flatness: FloatArray, radii: tuple[float, float], config: Config, threads: int, log: StageLog
) -> list[list[EllipseFit]]:
    """Cut the cloud by random planes and fit all ellipses; each slice has a generator of its own."""
    if "slices" not in config.candidates.sources:
        return []
    planes = draw_planes(frame, config.slicing, config.seed, config.scene.axis)
    thickness = (config.slicing.thickness or 0.0) / frame.spacing
    polished = config.method == "gt" and config.candidates.polish
    tolerance = (config.ellipses.tolerance or 0.0) / frame.spacing
    # points of large flat windows are explained already; the paper's preset has none
    eligible = frame.points[flatness < LARGE * frame.window] if flatness.any() else frame.points

    def work(index: int) -> list[EllipseFit] | None:
        section = cut_slice(eligible, planes[index], thickness)
        if len(section.points) < config.slicing.min_points:
            return None
        return fit_ellipses(
            section,
            config.ellipses,
            min_points=config.slicing.min_points,
            link=LINK,
            tolerance=tolerance,
            radius_range=radii,
            rng=np.random.default_rng([config.seed, 3, index]),
            refits=0 if polished else 3,  # the polish sees the points in space
        )

    with ThreadPoolExecutor(threads) as pool:
        results = list(pool.map(work, range(len(planes))))
    fits = [result or [] for result in results]
    few = sum(1 for result in results if result is None)
    log.report("slicing", len(planes), len(planes) - few, {"too few points": few})
    empty = sum(1 for result in results if result == [])
    log.report("ellipses", len(planes) - few, sum(map(len, fits)), {"no ellipse in the slice": empty})
    return fits


def candidates_of_slices(
    fits: list[list[EllipseFit]], frame: Frame, radii: tuple[float, float], config: Config, log: StageLog
) -> Candidates:
    """Make two candidates of each ellipse, and polish them if asked for."""
    proposed = propose_cylinders(fits)
    if not fits:
        return proposed
    kept = proposed
    if config.candidates.polish and len(proposed):
        kept = polish_candidates(proposed, frame, radii, config.candidates)
    log.report("candidates", len(proposed), len(kept), {"does not fit": len(proposed) - len(kept)})
    return kept


def candidates_of_windows(
    frame: Frame, explained: Explained, radii: tuple[float, float], config: Config, threads: int, log: StageLog
) -> Candidates:
    """Cut windows of all scales by planes, where nothing else explains the points."""
    if "slices" not in config.candidates.sources or not config.slicing.local_planes:
        return Candidates.joined([])
    supported = config.candidates.min_inliers, config.candidates.min_share
    found, counts = slice_windows(
        frame, explained, radii, config.slicing, config.candidates.octave, supported, config.seed, threads
    )
    cut = counts.pop("slices")
    log.report("local slicing", cut, len(found), counts)
    return found


def candidates_along_axis(candidates: Candidates, config: Config, log: StageLog) -> Candidates:
    """Keep the candidates about the axis that is asked for, if one is."""
    axis = config.scene.axis
    if axis is None:
        return candidates
    tolerance = np.radians(config.scene.axis_tolerance_deg + MARGIN)
    kept = candidates.take(are_along(candidates.directions, axis, tolerance))
    log.report("priors", len(candidates), len(kept), {"axis out of range": len(candidates) - len(kept)})
    return kept
