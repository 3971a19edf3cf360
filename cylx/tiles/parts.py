"""What a tile has found: cylinders in scene units with what is needed to join them, as plain data for the disk."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from cylx.geometry.arrays import FloatArray
from cylx.geometry.cylinder import POINT, RADIUS, Cylinder
from cylx.records import CylinderFit, Finding, Frame, NominalRadius, Segment

NO_POINTS = np.empty(0, np.int64)


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """A cylinder that was found in a tile, or joined from several.

    Parameters
    ----------
    finding : Finding
        Scene units, without its points.
    fit : CylinderFit
        Scene units; its inliers are not counted yet.
    spacing : float
        Of the points where it was found, scene units.
    inliers : int
        Points on its surface that were seen.
    inside : float
        Share of them inside the tile rather than in its margin.
    clipped : bool
        Whether it may go on beyond what was seen.
    sample : ndarray of shape (n, 3)
        Some of its points.
    """

    finding: Finding
    fit: CylinderFit
    spacing: float
    inliers: int
    inside: float
    clipped: bool
    sample: FloatArray

    def to_object(self) -> dict[str, Any]:
        """Return it as plain data."""
        fit, finding, segment = self.fit, self.finding, self.finding.segment
        return {
            "segment": {
                "model": segment.model.tolist(),
                "half": segment.half,
                "spread": segment.spread,
                "flat_share": segment.flat_share,
                "wedge": _plain(segment.wedge),
            },
            "finding": {
                "support": int(finding.support),
                "payoff": float(finding.payoff),
                "confidence": float(finding.confidence),
                "coverage": float(finding.coverage),
                "offset_error": float(finding.offset_error),
                "tilt_error": float(finding.tilt_error),
                "measures": {name: float(value) for name, value in finding.measures.items()},
                "blend": finding.blend,
            },
            "cylinder": {
                "point": fit.cylinder.point.tolist(),
                "direction": fit.cylinder.direction.tolist(),
                "radius": fit.cylinder.radius,
                "height": fit.cylinder.height,
            },
            "fit": {
                "confidence": fit.confidence,
                "payoff": fit.payoff,
                "covariance": _plain(fit.covariance),
                "nominal": None if fit.nominal is None else asdict(fit.nominal),
                "form": fit.form,
                "side": fit.side,
            },
            "spacing": self.spacing,
            "inliers": int(self.inliers),
            "inside": float(self.inside),
            "clipped": bool(self.clipped),
            "sample": self.sample.tolist(),
        }

    @classmethod
    def of_object(cls, content: Mapping[str, Any]) -> Part:
        """Make one from plain data."""
        held, fit = content["segment"], content["fit"]
        segment = Segment(
            np.array(held["model"]),
            held["half"],
            held["spread"],
            flat_share=held["flat_share"],
            wedge=None if held["wedge"] is None else np.array(held["wedge"]),
        )
        finding = Finding(segment, NO_POINTS, **content["finding"])
        shape = content["cylinder"]
        cylinder = Cylinder(shape["point"], shape["direction"], shape["radius"], shape["height"])
        made = CylinderFit(
            cylinder,
            0,
            0.0,
            finding.coverage,
            finding.support,
            fit["payoff"],
            fit["confidence"],
            finding.measures,
            None if fit["covariance"] is None else np.array(fit["covariance"]),
            None if fit["nominal"] is None else NominalRadius(**fit["nominal"]),
            fit["form"],
            fit["side"],
        )
        sample = np.array(content["sample"]).reshape(-1, 3)
        numbers = content["spacing"], content["inliers"], content["inside"], content["clipped"]
        return cls(finding, made, *numbers, sample)


def in_frame(segment: Segment, origin: FloatArray, spacing: float) -> Segment:
    """Return a segment of the scene in a frame."""
    model = segment.model.copy()
    model[POINT] = (model[POINT] - origin) / spacing
    model[RADIUS] /= spacing
    return replace(segment, model=model, half=segment.half / spacing, spread=segment.spread / spacing, covariance=None)


def in_scene(segment: Segment, frame: Frame) -> Segment:
    """Return a segment of a frame in scene units, without its covariance."""
    model, spacing = segment.model.copy(), frame.spacing
    model[POINT] = spacing * model[POINT] + frame.origin
    model[RADIUS] *= spacing
    return replace(
        segment, model=model, half=segment.half * spacing, spread=segment.spread * spacing, covariance=None, choice=None
    )


def _plain(array: FloatArray | None) -> Any:  # noqa: ANN401  (plain data)
    return None if array is None else array.tolist()
