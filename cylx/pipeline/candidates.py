"""The two sources of candidates: slices, as in the paper, and local curvature; and which of them play the game."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from cylx.geometry.arrays import FloatArray
from cylx.geometry.lines import are_along
from cylx.geometry.plane import Plane
from cylx.pipeline.stage_log import StageLog
from cylx.records import Candidates, EllipseFit, Explained, Slice, stream
from cylx.scene import Prepared
from cylx.stages.candidates import polish_candidates, propose_cylinders
from cylx.stages.clustering import thin_candidates
from cylx.stages.curvature import find_curved_windows
from cylx.stages.ellipses import fit_ellipses
from cylx.stages.local_slices import slice_windows
from cylx.stages.patches import find_curved_patches
from cylx.stages.plane_directions import directions_of_planes
from cylx.stages.rims import find_rims
from cylx.stages.slicing import cut_slice, draw_planes

LARGE = 6.0
"""Flat windows of more than this many times the smallest one's radius hold planes; a cylinder is flat in small ones."""
LINK = 4.0
"""Points of a slice within this many spacings are connected."""
MARGIN = 5.0
"""A candidate, which saw a few points, may be off the axis that is asked for by so many degrees more."""


def windows_and_explained(prepared: Prepared, log: StageLog) -> tuple[Candidates, Explained]:
    """Propose candidates from curved windows, and tell which points lie in flat ones."""
    frame, radii, config, threads = prepared.frame, prepared.radii, prepared.config, prepared.threads
    if "curvature" in config.candidates.sources:
        windows, explained, report = find_curved_windows(frame, radii, config.candidates, threads)
        log.reports.append(report)
        return windows, explained
    explained = Explained(np.zeros(len(frame.points)), np.zeros(len(frame.points), np.bool_))
    if config.slicing.local_planes:  # slices, too, pass over what is flat
        explained.flatness[:] = find_curved_windows(frame, radii, config.candidates, threads)[1].flatness
    return Candidates.joined([]), explained


def candidates_of_patches(
    prepared: Prepared, explained: Explained, log: StageLog
) -> tuple[Candidates, Candidates, NDArray[np.float32] | None, FloatArray]:
    """Propose candidates from the nearest points of each point, and from circles about the normals of planes.

    Returns
    -------
    patches, rims : Candidates
    normals : ndarray of shape (N, 3), float32, or None
        Of `Nearby`; None if the noise hides them everywhere.
    planes : ndarray of shape (k, 3)
        Unit normals of the directions that planes have.
    """
    frame, config, threads = prepared.frame, prepared.config.candidates, prepared.threads
    none = Candidates.joined([])
    if "curvature" not in config.sources:
        return none, none, None, np.empty((0, 3))
    patches, nearby, report = find_curved_patches(frame, explained, prepared.radii, config, threads)
    log.reports.append(report)
    planes = directions_of_planes(frame, explained, nearby)
    if nearby is None:
        return patches, none, None, planes
    rims, report = find_rims(frame, planes, nearby, prepared.radii, threads)
    log.reports.append(report)
    return patches, rims, nearby.normals, planes


def cut_slices(prepared: Prepared, flatness: FloatArray, log: StageLog) -> list[Slice | None]:
    """Cut the cloud by random planes; None for a slice of too few points."""
    frame, config = prepared.frame, prepared.config
    if "slices" not in config.candidates.sources:
        return []
    planes = draw_planes(frame, config.slicing, config.seed, config.scene.axis)
    thickness = (config.slicing.thickness or 0.0) / frame.spacing
    # points of large flat windows are explained already; the paper's preset has none
    eligible = frame.points[flatness < LARGE * frame.window] if flatness.any() else frame.points

    def work(plane: Plane) -> Slice | None:
        section = cut_slice(eligible, plane, thickness)
        return None if len(section.points) < config.slicing.min_points else section

    with ThreadPoolExecutor(prepared.threads) as pool:
        slices = list(pool.map(work, planes))
    few = sum(1 for section in slices if section is None)
    log.report("slicing", len(planes), len(planes) - few, {"too few points": few})
    return slices


def ellipses_of_slices(prepared: Prepared, slices: list[Slice | None], log: StageLog) -> list[list[EllipseFit]]:
    """Fit the ellipses of all slices; each slice has a generator of its own."""
    config = prepared.config
    if "slices" not in config.candidates.sources:
        return []
    polished = config.method == "gt" and config.candidates.polish
    tolerance = (config.ellipses.tolerance or 0.0) / prepared.frame.spacing

    def work(index: int) -> list[EllipseFit]:
        section = slices[index]
        if section is None:
            return []
        return fit_ellipses(
            section,
            config.ellipses,
            min_points=config.slicing.min_points,
            link=LINK,
            tolerance=tolerance,
            radius_range=prepared.radii,
            rng=stream(config.seed, "ellipses", index),
            refits=0 if polished else 3,  # the polish sees the points in space
        )

    with ThreadPoolExecutor(prepared.threads) as pool:
        fits = list(pool.map(work, range(len(slices))))
    cut = sum(1 for section in slices if section is not None)
    empty = sum(1 for section, found in zip(slices, fits, strict=True) if section is not None and not found)
    log.report("ellipses", cut, sum(map(len, fits)), {"no ellipse in the slice": empty})
    return fits


def candidates_of_slices(prepared: Prepared, fits: list[list[EllipseFit]], log: StageLog) -> Candidates:
    """Make two candidates of each ellipse, and polish them if asked for."""
    proposed = propose_cylinders(fits)
    if not fits:
        return proposed
    kept = proposed
    if prepared.config.candidates.polish and len(proposed):
        kept = polish_candidates(proposed, prepared.frame, prepared.radii, prepared.config.candidates)
    log.report("candidates", len(proposed), len(kept), {"does not fit": len(proposed) - len(kept)})
    return kept


def candidates_of_windows(prepared: Prepared, explained: Explained, log: StageLog) -> Candidates:
    """Cut windows of all scales by planes, where nothing else explains the points."""
    config = prepared.config
    if "slices" not in config.candidates.sources or not config.slicing.local_planes:
        return Candidates.joined([])
    supported = config.candidates.min_inliers, config.candidates.min_share
    found, counts = slice_windows(
        prepared.frame,
        explained,
        prepared.radii,
        config.slicing,
        config.candidates.octave,
        supported,
        config.seed,
        prepared.threads,
    )
    cut = counts.pop("slices")
    log.report("local slicing", cut, len(found), counts)
    return found


def select_candidates(prepared: Prepared, candidates: Candidates, log: StageLog) -> Candidates:
    """Keep the candidates that play the game: about the axis that is asked for, and not too many that say the same."""
    config = prepared.config
    if config.scene.axis is not None:
        tolerance = np.radians(config.scene.axis_tolerance_deg + MARGIN)
        kept = candidates.take(are_along(candidates.directions, config.scene.axis, tolerance))
        log.report("priors", len(candidates), len(kept), {"axis out of range": len(candidates) - len(kept)})
        candidates = kept
    return thin_candidates(candidates) if config.clustering.population == "local" else candidates
