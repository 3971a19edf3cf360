"""The paper's competitors at the place of its method: the same cloud, limits, extents, labels and answer."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from cylx.baselines import Limits, Proposal, find_by_consensus, find_by_growing, find_by_spheres, fit_line_of_centres
from cylx.config import Config
from cylx.geometry.cells import Cells
from cylx.geometry.coverage import covered_angle
from cylx.pipeline.assembly import assemble
from cylx.pipeline.candidates import ellipses_of_slices
from cylx.pipeline.stage_log import StageLog
from cylx.records import Extraction, Finding, Frame, IndexedCloud, PointCloud, RejectedSegment
from cylx.scene import make_frame, out_of_range, radius_range, resolve
from cylx.stages.averaging import measure_extent
from cylx.stages.labelling import surface_points


def extract_by_competitor(cloud: PointCloud, config: Config, threads: int, log: StageLog) -> Extraction:
    """Find the cylinders of a cloud by the method that the configuration names.

    Parameters
    ----------
    cloud : PointCloud
    config : Config
        Its method is not `gt`.
    threads : int
        Does not change the result.
    log : StageLog

    Returns
    -------
    Extraction
        Of cylinders without confidence, payoff and covariance.

    Raises
    ------
    ConfigError
        If the method needs open3d, and it cannot be imported.
    """
    with log.stage("scene"):
        frame, scene = make_frame(cloud.points, config, threads)
        scene = replace(scene, given=config.scene.given)
        config = resolve(config, scene)
        radii = radius_range(config, frame)
        indexed = IndexedCloud(Cells(frame.points, frame.codes), np.zeros(len(frame.points)), frame.noise)
    findings: list[Finding] = []
    refused: list[RejectedSegment] = []
    with log.stage(config.method):
        for proposal in _proposals(frame, radii, config, threads, log):
            outcome = _with_extent(proposal, indexed, radii, config)
            if isinstance(outcome, Finding):
                findings.append(outcome)
            else:
                refused.append(outcome)
            log.advance()
            if len(findings) == config.max_cylinders:
                break
    counts = Counter(one.reason for one in refused)
    log.report(config.method, len(findings) + len(refused), len(findings), counts)
    with log.stage("labelling"):
        return assemble(cloud, frame, scene, indexed, findings, refused, log.reports, config)


def _proposals(
    frame: Frame, radii: tuple[float, float], config: Config, threads: int, log: StageLog
) -> Iterable[Proposal]:
    """Run the method, as far as its cylinders are asked for."""
    if config.method == "line-fit":
        fits = ellipses_of_slices(frame, np.zeros(len(frame.points)), radii, config, threads, log)
        return fit_line_of_centres(fits, frame, config.line_fit)
    limits = Limits(radii)
    if config.scene.axis is not None:
        along = np.array(config.scene.axis, dtype=np.float64)
        limits = Limits(radii, along / np.linalg.norm(along), math.radians(config.scene.axis_tolerance_deg))
    if config.method == "msac":
        return find_by_consensus(frame, limits, config.msac, seed=config.seed, threads=threads)
    if config.method == "tran":
        return find_by_growing(frame, limits, config.tran, seed=config.seed, threads=threads)
    return find_by_spheres(frame, limits, config.jin, seed=config.seed, threads=threads)


def _with_extent(
    proposal: Proposal, indexed: IndexedCloud, radii: tuple[float, float], config: Config
) -> Finding | RejectedSegment:
    """Give a cylinder the extent that is seen of it, or else that of what it was found on; hold it to the limits."""
    segment, support = proposal
    if reason := out_of_range(segment, radii, config.scene):
        return RejectedSegment(segment, reason, support, 0.0)
    seen = measure_extent(segment, indexed)
    segment = segment if isinstance(seen, str) else seen
    points, _, angles = surface_points(segment, indexed)
    coverage = covered_angle(angles)
    if coverage < math.radians(config.verification.min_coverage_deg):
        return RejectedSegment(segment, "coverage", support, 0.0, coverage=coverage)
    return Finding(segment, points, support, 0.0, 0.0, coverage, 0.0, 0.0)
