"""The paper's competitors at the place of its method: the same cloud, limits, extents, labels and answer."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable

import numpy as np

from cylx.baselines import Limits, Proposal, find_by_consensus, find_by_growing, find_by_spheres, fit_line_of_centres
from cylx.geometry.coverage import covered_angle
from cylx.pipeline.assembly import assemble
from cylx.pipeline.candidates import cut_slices, ellipses_of_slices
from cylx.pipeline.stage_log import StageLog
from cylx.records import Extraction, Finding, IndexedCloud, RejectedSegment, stream
from cylx.scene import Prepared, out_of_range
from cylx.stages.labelling import surface_points
from cylx.stages.measuring import measure_extent


def extract_by_competitor(prepared: Prepared, log: StageLog) -> Extraction:
    """Find the cylinders of a cloud by the method that the configuration names.

    Parameters
    ----------
    prepared : Prepared
        Its configuration names another method than `gt`.
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
    method, most = prepared.config.method, prepared.config.max_cylinders
    indexed = IndexedCloud.of(prepared.frame, np.zeros(len(prepared.frame.points)))
    findings: list[Finding] = []
    rejected: list[RejectedSegment] = []
    with log.stage(method):
        for proposal in _proposals(prepared, log):
            outcome = _with_extent(proposal, indexed, prepared)
            if isinstance(outcome, Finding):
                findings.append(outcome)
            else:
                rejected.append(outcome)
            log.advance()
            if len(findings) == most:
                break
    counts = Counter(one.reason for one in rejected)
    log.report(method, len(findings) + len(rejected), len(findings), counts)
    with log.stage("labelling"):
        return assemble(prepared, indexed, findings, rejected, log.reports)


def _proposals(prepared: Prepared, log: StageLog) -> Iterable[Proposal]:
    """Run the method, as far as its cylinders are asked for."""
    frame, radii, config, threads = prepared.frame, prepared.radii, prepared.config, prepared.threads
    if config.method == "line-fit":
        slices = cut_slices(prepared, np.zeros(len(frame.points)), log)
        return fit_line_of_centres(ellipses_of_slices(prepared, slices, log), frame, config.line_fit)
    limits = Limits(radii)
    if config.scene.axis is not None:
        along = np.array(config.scene.axis, dtype=np.float64)
        limits = Limits(radii, along / np.linalg.norm(along), math.radians(config.scene.axis_tolerance_deg))
    if config.method == "msac":
        return find_by_consensus(frame, limits, config.msac, rng=stream(config.seed, "msac"), threads=threads)
    if config.method == "tran":
        return find_by_growing(frame, limits, config.tran, rng=stream(config.seed, "tran"), threads=threads)
    return find_by_spheres(frame, limits, config.jin, seed=config.seed, threads=threads)


def _with_extent(proposal: Proposal, indexed: IndexedCloud, prepared: Prepared) -> Finding | RejectedSegment:
    """Return a cylinder the extent that is seen of it, or else that of what it was found on; hold it to the limits."""
    segment, support = proposal
    if reason := out_of_range(segment, prepared.radii, prepared.config.scene):
        return RejectedSegment(segment, reason, support, 0.0)
    seen = measure_extent(segment, indexed)
    segment = segment if isinstance(seen, str) else seen
    points, _, angles = surface_points(segment, indexed)
    coverage = covered_angle(angles)
    if coverage < math.radians(prepared.config.verification.min_coverage_deg):
        return RejectedSegment(segment, "coverage", support, 0.0, coverage=coverage)
    return Finding(segment, points, support, 0.0, 0.0, coverage, 0.0, 0.0)
