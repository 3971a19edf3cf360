"""Records of cylinders in the unit of the scan: fits with their evidence, refusals, and the extraction."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from cylx.fits.nominal_radius import Decision
from cylx.geometry.arrays import FloatArray
from cylx.geometry.cylinder import Cylinder
from cylx.records.clouds import PointCloud, Scene
from cylx.records.piping import Piping
from cylx.records.progress import StageReport
from cylx.records.shown import html_in_notebook
from cylx.wording import counted

if TYPE_CHECKING:
    from cylx.config import Config


@dataclass(frozen=True, slots=True, eq=False)
class NominalRadius:
    """The most likely entry of a catalogue for a cylinder.

    Parameters
    ----------
    decision : {'snapped', 'ambiguous', 'none'}
        `snapped` if the cylinder was fitted again with it (see `cylx.fits.nominal_radius.Choice`).
    name : str or None
        Name of the entry, if it has one.
    nominal_radius : float
        Nominal radius of the entry, scene units.
    likelihood_ratio : float
        Likelihood ratio of the entry to the stronger of its two rivals, the second entry and no entry; > 0.
    free_radius, free_radius_sd : float
        Radius of the fit without the catalogue, and its standard deviation, scene units.
    """

    decision: Decision
    name: str | None
    nominal_radius: float
    likelihood_ratio: float
    free_radius: float
    free_radius_sd: float


@dataclass(frozen=True, slots=True, eq=False)
class CylinderFit:
    """A cylinder and the evidence for it.

    Parameters
    ----------
    cylinder : Cylinder
        The shape in scene units; its point is the middle of the visible extent.
    inliers : int
        Points of the cloud with its label.
    rmse : float
        Root mean square of the inliers' distances to the surface, scene units.
    coverage : float
        Angle about the axis that the inliers cover, radians, in (0, 2 pi].
    support : int
        Candidates in its cluster.
    payoff : float or None
        Mean payoff of the cluster, in [0, 1]; None if no game was played.
    confidence : float or None
        Probability that it is a cylinder; None if it was not verified.
    evidence : mapping of str to float
        The measures of the verification, by name.
    covariance : ndarray of shape (5, 5) or None
        Covariance of two offsets of the axis at its point, along the two directions of
        `cylx.geometry.cylinder.axis_basis`, of two tilts of the axis towards them, and of the radius; scene units and
        radians. None if it was not computed.
    nominal : NominalRadius or None
        Its entry of the catalogue; None without a catalogue or a covariance.
    form : float or None
        Deviation of the surface from a cylinder, that neighbouring points share, scene units; None if not measured.
    side : {'convex', 'concave', 'unknown'} or None
        That of a pin, that of a bore, or neither can be told; None if not measured.
    measured : Cylinder or None
        The shape as it was measured, if it was moved since, so that its run is as it was built.
    """

    cylinder: Cylinder
    inliers: int
    rmse: float
    coverage: float
    support: int
    payoff: float | None
    confidence: float | None = None
    evidence: Mapping[str, float] = field(default_factory=dict)
    covariance: FloatArray | None = None
    nominal: NominalRadius | None = None
    form: float | None = None
    side: Literal["convex", "concave", "unknown"] | None = None
    measured: Cylinder | None = None

    @property
    def radius_sd(self) -> float | None:
        """Standard deviation of the radius, scene units; None if the covariance was not computed."""
        return None if self.covariance is None else math.sqrt(max(float(self.covariance[4, 4]), 0.0))

    @property
    def angle_sd(self) -> float | None:
        """Standard deviation of the direction of the axis, radians; None if the covariance was not computed."""
        return None if self.covariance is None else math.sqrt(max(float(np.trace(self.covariance[2:4, 2:4])), 0.0))


@dataclass(frozen=True, slots=True, eq=False)
class RejectedFit:
    """A possible cylinder that was rejected.

    Parameters
    ----------
    fit : CylinderFit
        Its shape and the evidence. Its inliers are the points on its surface, whatever their label. If it was rejected
        before measuring, it has no confidence and no evidence.
    reason : str
        The term of the evidence that speaks most against it, or the limit it exceeds.
    """

    fit: CylinderFit
    reason: str


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Extraction:
    """The full output of one run on one cloud.

    Parameters
    ----------
    cylinders : tuple of CylinderFit
        Ordered by confidence, then inliers, descending; the index is the `id`.
    labels : ndarray of shape (N,), int32
        Cylinder of each finite point of the cloud, -1 for none.
    residuals : ndarray of shape (N,), float32
        Signed distance of each labelled point to its cylinder's surface, scene units, + is outside; NaN without a
        label.
    cloud : PointCloud
        The input cloud.
    scene : Scene
        Scale and noise of the cloud.
    stages : tuple of StageReport
        Counts per stage, in order.
    config : Config
        The resolved configuration: nothing that the run used is None.
    warnings : tuple of str
        What a user should know before trusting the result.
    rejected : tuple of RejectedFit
        The rejected cylinders, ordered by confidence, then inliers, descending; those not measured come last. Near
        copies of one rejected segment may occur more than once.
    blends : tuple of CylinderFit or None
        Arcs that go on tangentially: rounds, fillets, slot ends. Ordered as the cylinders; their inliers are the points
        that no cylinder has. None if they were not looked for.
    piping : Piping or None
        The fittings and runs of the cylinders; None if they were not looked for.
    """

    cylinders: tuple[CylinderFit, ...]
    labels: NDArray[np.int32]
    residuals: NDArray[np.float32]
    cloud: PointCloud
    scene: Scene
    stages: tuple[StageReport, ...]
    config: Config
    warnings: tuple[str, ...] = ()
    rejected: tuple[RejectedFit, ...] = ()
    blends: tuple[CylinderFit, ...] | None = None
    piping: Piping | None = None

    def __repr__(self) -> str:
        return f"{counted(len(self.cylinders), len(self.blends or ()))} in {len(self.labels)} points"

    def _repr_html_(self) -> str:
        return html_in_notebook(self)

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """Return the cylinders as arrays, in their order.

        Returns
        -------
        dict of str to ndarray
            `points`, `directions`, `starts` and `ends` of shape (M, 3); `radii`, `heights`, `inliers` (integers),
            `rmse`, `coverages` and `confidences` of shape (M,). Scene units and radians; NaN for no confidence.
        """
        return arrays_of(self.cylinders)


def arrays_of(fits: Sequence[CylinderFit]) -> dict[str, NDArray[Any]]:
    """Return cylinders as arrays; see `Extraction.to_arrays`."""
    shapes = [fit.cylinder for fit in fits]
    return {
        "points": np.array([shape.point for shape in shapes], np.float64).reshape(-1, 3),
        "directions": np.array([shape.direction for shape in shapes], np.float64).reshape(-1, 3),
        "starts": np.array([shape.start for shape in shapes], np.float64).reshape(-1, 3),
        "ends": np.array([shape.end for shape in shapes], np.float64).reshape(-1, 3),
        "radii": np.array([shape.radius for shape in shapes], np.float64),
        "heights": np.array([shape.height for shape in shapes], np.float64),
        "inliers": np.array([fit.inliers for fit in fits], np.int64),
        "rmse": np.array([fit.rmse for fit in fits], np.float64),
        "coverages": np.array([fit.coverage for fit in fits], np.float64),
        "confidences": np.array([np.nan if fit.confidence is None else fit.confidence for fit in fits], np.float64),
    }
