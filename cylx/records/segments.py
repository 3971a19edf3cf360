"""Records of segments, in the frame of the cloud: before verification, accepted, and rejected."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from cylx.fits.nominal_radius import Choice
from cylx.geometry.arrays import FloatArray, IndexArray
from cylx.geometry.cylinder import DIRECTION, POINT, RADIUS, Cylinder


@dataclass(frozen=True, slots=True, eq=False)
class Segment:
    """A piece of a cylinder in the frame of the cloud, before verification.

    Parameters
    ----------
    model : ndarray of shape (7,)
        Middle of the axis, unit direction, radius.
    half : float
        Half its height.
    spread : float
        Robust standard deviation of its residuals; 0 if it was not fitted.
    covariance : ndarray of shape (5, 5), optional
        Of two offsets of the axis, its two tilts and the radius, in the basis of `fill_basis`; None before the last
        fit.
    choice : Choice, optional
        The entry of a catalogue that was chosen for the radius; None before the last fit, and without a catalogue.
    flat_share : float
        Share of the flatness that makes points those of something flatter, from which they are left out here: less
        than 1 for an arc that goes on into planes.
    wedge : ndarray of shape (4,), optional
        Unit direction from the axis to the middle of an arc, and the cosine of half its angle: what lies beyond is of
        the planes that touch it. None for whatever is no such arc.
    upright : bool
        Whether it was fitted with its axis held to the normal of a plane.
    """

    model: FloatArray
    half: float
    spread: float
    covariance: FloatArray | None = None
    choice: Choice | None = None
    flat_share: float = 1.0
    wedge: FloatArray | None = None
    upright: bool = False

    @property
    def point(self) -> FloatArray:
        """Middle of the axis, shape (3,)."""
        return self.model[POINT]

    @property
    def direction(self) -> FloatArray:
        """Unit direction of the axis, shape (3,)."""
        return self.model[DIRECTION]

    @property
    def radius(self) -> float:
        """Radius, frame units."""
        return float(self.model[RADIUS])

    @property
    def cylinder(self) -> Cylinder:
        """The shape, in the frame of the cloud."""
        return Cylinder(self.point, self.direction, self.radius, 2.0 * self.half)


@dataclass(frozen=True, slots=True, eq=False)
class Finding:
    """An accepted segment with its evidence, in the frame of the cloud.

    Parameters
    ----------
    segment : Segment
    points : ndarray of shape (n,)
        Indices of the points on its surface.
    support : int
        Candidates of its cluster.
    payoff : float
        Mean payoff of its cluster; 0 if no game was played.
    confidence : float
        Probability that it is a cylinder.
    coverage : float
        Angle about the axis that is covered, radians.
    offset_error, tilt_error : float
        Standard deviations of the axis, at its middle and in angle.
    measures : mapping of str to float
        The measures of the verification.
    blend : bool
        Whether it is an arc that goes on tangentially, such as a round or a fillet.
    """

    segment: Segment
    points: IndexArray
    support: int
    payoff: float
    confidence: float
    coverage: float
    offset_error: float
    tilt_error: float
    measures: Mapping[str, float] = field(default_factory=dict)
    blend: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class RejectedSegment:
    """A segment that was rejected, in the frame of the cloud.

    Parameters
    ----------
    segment : Segment
        The fitted segment, or the average of its candidates if it was rejected before the fit.
    reason : str
        The term of the evidence that speaks most against it, or the limit it exceeds.
    support : int
        Candidates of its cluster.
    payoff : float
        Mean payoff of its cluster; 0 if no game was played.
    confidence : float or None
        Probability that it is a cylinder; None if it was rejected before measuring.
    coverage : float
        Angle about the axis that is covered, radians; 0 if it was not measured.
    measures : mapping of str to float
        The measures of the verification.
    """

    segment: Segment
    reason: str
    support: int
    payoff: float
    confidence: float | None = None
    coverage: float = 0.0
    measures: Mapping[str, float] = field(default_factory=dict)

    @classmethod
    def of(cls, finding: Finding, reason: str) -> RejectedSegment:
        """Turn a finding into a refusal."""
        confidence, coverage = finding.confidence, finding.coverage
        return cls(finding.segment, reason, finding.support, finding.payoff, confidence, coverage, finding.measures)
