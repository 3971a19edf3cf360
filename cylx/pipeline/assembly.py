"""From findings in the frame to the answer in the scene."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cylx.config import Config
from cylx.evidence.side import side_of
from cylx.fits.likelihood import CONTRADICTION
from cylx.geometry.arrays import FloatArray
from cylx.geometry.coverage import covered_angle
from cylx.records import (
    CylinderFit,
    Extraction,
    Finding,
    IndexedCloud,
    NominalRadius,
    PointCloud,
    RejectedFit,
    RejectedSegment,
    Scene,
    StageReport,
)
from cylx.scene import Prepared
from cylx.scene.cautions import damage
from cylx.stages.labelling import label_points, surface_points


def assemble(
    prepared: Prepared,
    indexed: IndexedCloud,
    findings: list[Finding],
    rejected: list[RejectedSegment],
    reports: list[StageReport],
    blends: list[Finding] | None = None,
) -> Extraction:
    """Label the points, number the cylinders by confidence, and put everything into scene units.

    Parameters
    ----------
    prepared : Prepared
    indexed : IndexedCloud
    findings : list of Finding
    rejected : list of RejectedSegment
        What was not accepted, in the order it came.
    reports : list of StageReport
    blends : list of Finding, optional
        Arcs that go on tangentially, the most trusted first.

    Returns
    -------
    Extraction
    """
    cloud, frame, scene, config = prepared.cloud, prepared.frame, prepared.scene, prepared.config
    labels, residuals = label_points([finding.segment for finding in findings], indexed)
    counts = np.bincount(labels[labels >= 0], minlength=len(findings))
    game = config.method == "gt"
    verified = config.verification.enabled and game
    trust = np.array([finding.confidence if verified else 0.0 for finding in findings])
    order = [int(i) for i in np.lexsort((np.arange(len(findings)), -counts, -trust)) if counts[i] > 0]
    squares = np.bincount(labels[labels >= 0], residuals[labels >= 0] ** 2, minlength=len(findings))
    fits = [
        fit_of(findings[i], int(counts[i]), float(np.sqrt(squares[i] / counts[i])) * frame.spacing, prepared, indexed)
        for i in order
    ]
    number = np.full(len(findings) + 1, -1, np.int32)  # the last entry is what label -1 maps to
    number[order] = np.arange(len(order), dtype=np.int32)
    in_cloud = np.empty(len(labels), np.int32), np.empty(len(labels), np.float32)
    in_cloud[0][frame.order] = number[labels]
    in_cloud[1][frame.order] = np.where(number[labels] >= 0, residuals * frame.spacing, np.nan)
    warnings = (*_warnings(cloud, scene, fits), *_contradicted(config, fits), *_unlisted(config, fits))
    arcs = None
    if blends is not None and verified and config.verification.blends:
        arcs = tuple(_blends(blends, labels, prepared, indexed))
    lost = [RejectedSegment.of(findings[i], "claimed by a better one") for i in np.flatnonzero(counts == 0)]
    shown = tuple(rejected_fits([*rejected, *lost], prepared, indexed))
    return Extraction(tuple(fits), *in_cloud, cloud, scene, tuple(reports), config, warnings, shown, arcs)


def fit_of(finding: Finding, inliers: int, rmse: float, prepared: Prepared, indexed: IndexedCloud) -> CylinderFit:
    """Put a finding into scene units; what its method does not compute is None.

    Parameters
    ----------
    finding : Finding
    inliers : int
        Points with its label.
    rmse : float
        Root mean square of their distances to the surface, scene units.
    prepared : Prepared
    indexed : IndexedCloud
    """
    frame, config = prepared.frame, prepared.config
    game = config.method == "gt"
    verified = config.verification.enabled and game
    return CylinderFit(
        frame.to_scene(finding.segment.cylinder),
        inliers,
        rmse,
        finding.coverage,
        finding.support,
        finding.payoff if game else None,
        finding.confidence if verified else None,
        finding.measures,
        _covariance(finding, frame.spacing),
        _nominal(finding, config, frame.spacing),
        _form(finding, frame.spacing),
        side_of(finding.segment, indexed, finding.coverage) if finding.measures else None,
    )


def _blends(
    findings: list[Finding], labels: NDArray[np.int32], prepared: Prepared, indexed: IndexedCloud
) -> list[CylinderFit]:
    """Put blends into scene units; a point belongs to the nearest of those that no cylinder has."""
    frame = prepared.frame
    owners, residuals = label_points([finding.segment for finding in findings], indexed)
    owners[labels >= 0] = -1
    out = []
    for i, finding in enumerate(findings):
        own = residuals[owners == i]
        if len(own):
            rmse = float(np.sqrt((own**2).mean())) * frame.spacing
            out.append(fit_of(finding, len(own), rmse, prepared, indexed))
    return out


def _form(finding: Finding | RejectedSegment, spacing: float) -> float | None:
    """Put the deviation of the surface from a cylinder into scene units; None if it was not measured."""
    share = finding.measures.get("form_radii")
    return None if share is None else share * finding.segment.radius * spacing


def _covariance(finding: Finding, spacing: float) -> FloatArray | None:
    """Put the covariance of a finding into scene units."""
    covariance = finding.segment.covariance
    if covariance is None:
        return None
    units = np.array([spacing, spacing, 1.0, 1.0, spacing])
    return np.asarray(covariance * np.outer(units, units))


def _nominal(finding: Finding, config: Config, spacing: float) -> NominalRadius | None:
    """Name the entry of the catalogue that was chosen for a finding, and why; None if none was asked for."""
    choice = finding.segment.choice
    if choice is None or not config.scene.catalogue:
        return None
    entry = config.scene.catalogue[choice.entry]
    return NominalRadius(
        choice.decision, entry.name, entry.radius, choice.ratio, choice.radius * spacing, choice.deviation * spacing
    )


def rejected_fits(segments: list[RejectedSegment], prepared: Prepared, indexed: IndexedCloud) -> list[RejectedFit]:
    """Put what was not accepted into scene units, the most trusted first; what has no shape at all is left out.

    Parameters
    ----------
    segments : list of RejectedSegment
    prepared : Prepared
    indexed : IndexedCloud
    """
    frame, config, out = prepared.frame, prepared.config, []
    game = config.method == "gt"
    verified = config.verification.enabled and game
    for one in segments:
        segment = one.segment
        if not (np.isfinite(segment.model).all() and segment.radius > 0.0 and segment.half >= 0.0):
            continue
        _, residuals, angles = surface_points(segment, indexed)
        fit = CylinderFit(
            frame.to_scene(segment.cylinder),
            len(residuals),
            float(np.sqrt((residuals**2).sum() / max(len(residuals), 1))) * frame.spacing,
            one.coverage if one.measures else covered_angle(angles),
            one.support,
            one.payoff if game else None,
            one.confidence if verified else None,
            one.measures,
            form=_form(one, frame.spacing),
        )
        out.append(RejectedFit(fit, one.reason))
    return sorted(out, key=by_trust)


def by_trust(one: RejectedFit) -> tuple[bool, float, int]:
    """Return what sorts the rejected: by confidence, then inliers; those not measured come last."""
    return one.fit.confidence is None, -(one.fit.confidence or 0.0), -one.fit.inliers


def _contradicted(config: Config, fits: list[CylinderFit]) -> list[str]:
    """Name what was said to be known and holds of no cylinder that was found."""
    radius, spread = config.scene.known_radius, config.scene.known_radius_sd or 0.0
    certain = [(fit.cylinder.radius, fit.covariance[4, 4]) for fit in fits if fit.covariance is not None]
    if radius is None or not certain:
        return []
    if any((found - radius) ** 2 <= CONTRADICTION**2 * (spread**2 + variance) for found, variance in certain):
        return []
    nearest = min((found for found, _ in certain), key=lambda found: abs(found - radius))
    return [
        f"no cylinder has the known radius of {radius:.5g}; the nearest has {nearest:.5g}, "
        "and all are as they are without it"
    ]


def _unlisted(config: Config, fits: list[CylinderFit]) -> list[str]:
    """Say so if a catalogue was of no use to what was found."""
    if not (config.scene.catalogue and fits):
        return []
    if any(fit.nominal is not None and fit.nominal.decision == "snapped" for fit in fits):
        return []
    return ["no radius was snapped to the catalogue: all are as they are without it; is it in the unit of the scan?"]


def _warnings(cloud: PointCloud, scene: Scene, fits: list[CylinderFit]) -> list[str]:
    """Say what a user should know before trusting the answer."""
    out = [str(caution) for caution in damage(cloud, scene)]
    thin = sum(1 for fit in fits if fit.coverage < np.radians(60.0))
    if thin:
        out.append(f"{thin} cylinder{'s' if thin > 1 else ''} covered by less than 60 degrees: the radius is uncertain")
    return out
