"""The sections of the configuration: one frozen model per stage, each value with default, unit and meaning."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

Number = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[Number, Field(gt=0)]
Share = Annotated[Number, Field(ge=0, le=1)]
Axis = Annotated[list[Number], Field(min_length=3, max_length=3)]


Inclination = Annotated[Number, Field(ge=0, le=90)]


class Section(BaseModel):
    """A part of the configuration: unknown keys, wrong types and impossible values are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, use_attribute_docstrings=True)


class CatalogueEntry(Section):
    """A nominal radius."""

    name: str | None = None
    """Its name, such as `DN50`: up to 40 printable characters."""
    radius: Positive
    """Nominal radius, scene units."""
    tolerance: Positive | None = None
    """Standard deviation of true radii about the nominal one, scene units; null is 0.2 % of it."""

    @field_validator("name")
    @classmethod
    def _check_name(cls, name: str | None) -> str | None:
        if name is not None and not (0 < len(name) <= 40 and name.isprintable() and name == name.strip()):
            raise ValueError("the name is invalid; write 1 to 40 printable characters without spaces around them")
        return name

    @property
    def spread(self) -> float:
        """The tolerance, scene units, with null replaced by its default."""
        return self.tolerance or 2e-3 * self.radius


class SceneConfig(Section):
    """Prior knowledge of the cloud; `null` values are measured in the cloud."""

    spacing: Positive | None = None
    """Distance of neighbouring points on a surface, scene units."""
    noise: Positive | None = None
    """Standard deviation of the points about their surface, scene units."""
    radius_min: Positive | None = None
    """Smallest radius to find, scene units. Raising it drops thin pipes."""
    radius_max: Positive | None = None
    """Largest radius to find, scene units. Lowering it drops tanks and walls that are hardly curved."""
    axis: Axis | None = None
    """Direction of the cylinders to find, in the coordinates of the scan; its length and sign do not matter."""
    axis_tolerance_deg: Annotated[Number, Field(gt=0, le=90)] = 10.0
    """Largest angle between a cylinder and `axis`, degrees; has no effect without `axis`."""
    axis_sd_deg: Annotated[Number, Field(gt=0, le=90)] | None = None
    """Standard deviation of the cylinders' tilts from `axis`, degrees: a prior for each fit; null sets no prior."""
    known_radius: Positive | None = None
    """Known radius of the cylinders, scene units: a prior for each fit that does not contradict it."""
    known_radius_sd: Positive | None = None
    """Standard deviation of `known_radius`, scene units; null is a thousandth of it."""
    catalogue: Annotated[list[CatalogueEntry], Field(min_length=1)] | None = None
    """Nominal radii, each `{name: DN50, radius: 0.03015, tolerance: 0.0001}`: priors for the fits that support one."""

    @property
    def given(self) -> tuple[str, ...]:
        """Which of `spacing` and `noise` are given instead of measured."""
        return tuple(name for name in ("spacing", "noise") if getattr(self, name) is not None)

    @model_validator(mode="after")
    def _check_axis(self) -> SceneConfig:
        if self.axis is not None and not any(self.axis):
            raise ValueError("axis [0, 0, 0] is not a direction; write [0, 0, 1] for upright")
        return self

    @model_validator(mode="after")
    def _check_radii(self) -> SceneConfig:
        if self.radius_min is not None and self.radius_max is not None and self.radius_min > self.radius_max:
            raise ValueError(f"radius_min {self.radius_min:g} is above radius_max {self.radius_max:g}; swap them")
        return self

    @model_validator(mode="after")
    def _check_catalogue(self) -> SceneConfig:
        radii = [entry.radius for entry in self.catalogue or []]
        if twice := [radius for radius in radii if radii.count(radius) > 1]:
            raise ValueError(f"catalogue has the radius {twice[0]:g} twice; leave one of them out")
        return self


class SlicingConfig(Section):
    """Planes through the whole cloud and through windows of every scale, and the points close to them."""

    planes: Annotated[int, Field(ge=0)] = 40
    """Number of random planes N. More planes find more cylinders and take longer."""
    inclination_deg: Annotated[list[Inclination], Field(min_length=2, max_length=2)] | None = None
    """Least and greatest angle of the normals of these planes to `scene.axis`, degrees; null sets no limits."""
    local_planes: Annotated[int, Field(ge=0)] = 1
    """Planes through each window, besides one across its longest direction; 0 uses no windows."""
    windows: Annotated[int, Field(ge=1)] = 2000
    """Most windows of one scale, at points not explained otherwise. More windows find more thin, sparse pipes."""
    thickness: Positive | None = None
    """Full thickness of a slice through the whole cloud, scene units. Thicker slices smear the ellipse."""
    min_points: Annotated[int, Field(ge=6)] = 20
    """A slice, or a piece of one, with fewer points is dropped."""

    @model_validator(mode="after")
    def _check_inclination(self) -> SlicingConfig:
        if self.inclination_deg is not None and self.inclination_deg[0] > self.inclination_deg[1]:
            low, high = self.inclination_deg
            raise ValueError(f"inclination_deg [{low:g}, {high:g}] has its least angle above its greatest; swap them")
        return self


class EllipsesConfig(Section):
    """Ellipses in each slice, by RANSAC and the direct least-squares fit."""

    pieces: bool = True
    """Search each connected piece of a slice by itself; false searches the whole slice, as the paper does."""
    iterations: Annotated[int, Field(ge=1)] = 200
    """RANSAC samples per ellipse. More samples tolerate more outliers and take longer."""
    tolerance: Positive | None = None
    """Distance within which a point supports an ellipse, scene units."""
    min_inliers: Annotated[int, Field(ge=6)] = 20
    """An ellipse with fewer supporting points is dropped."""
    min_share: Share = 0.3
    """An ellipse with a smaller share of its piece's remaining points is dropped."""
    max_per_slice: Annotated[int, Field(ge=1)] = 50
    """Most ellipses taken from one slice."""
    max_aspect: Annotated[Number, Field(gt=1)] = 4.0
    """Largest ratio of the semi-axes; slices more oblique than this say little about the axis."""


class CandidatesConfig(Section):
    """Cylinder candidates, from the ellipses of slices and from local curvature."""

    sources: Annotated[list[Literal["slices", "curvature"]], Field(min_length=1)] = ["slices", "curvature"]
    """Where candidates come from; the paper uses slices only."""
    polish: bool = True
    """Fit each candidate to the points around it before the game."""
    octave: Annotated[Number, Field(gt=1.1, le=4)] = 1.6
    """Ratio of successive window radii. A smaller ratio uses more scales and takes longer."""
    window_spacings: Positive = 2.2
    """Radius of the smallest curvature window, in spacings."""
    window_noises: Positive = 5.0
    """Least radius of the smallest curvature window, in noises."""
    min_inliers: Annotated[int, Field(ge=6)] = 15
    """A polished candidate with fewer supporting points is dropped."""
    min_share: Share = 0.25
    """A polished candidate that explains a smaller share of its window is dropped."""


class ClusteringConfig(Section):
    """The game that groups candidates into clusters."""

    kernel: Literal["screw", "local"] = "local"
    """`screw`: eq. 1 and 2 of the paper; `local`: angle, offset at the candidates in radii, and ratio of radii."""
    screw_scale: Positive = 5.0
    """Lambda of eq. 2, used by the `screw` kernel; lengths in the median candidate radius. Larger is more tolerant."""
    angle_deg: Annotated[Number, Field(gt=0, lt=90)] = 4.0
    """Axis angle at which the `local` kernel has fallen to 1/e, degrees."""
    offset: Positive = 0.1
    """Axis offset at which the `local` kernel has fallen to 1/e, in radii."""
    radius: Positive = 0.06
    """Relative difference of radii at which the `local` kernel has fallen to 1/e."""
    min_radius_ratio: Share = 0.75
    """p of eq. 2: candidates whose radii differ by more are incompatible."""
    diagonal: Annotated[Number, Field(ge=0, le=1)] = 0.0
    """Payoff of a candidate against itself; with 1, as in eq. 5, every stable state is a single candidate."""
    dynamics: Literal["replicator", "infection-immunization"] = "infection-immunization"
    """How the population evolves: eq. 7, or a faster way to the same equilibria."""
    population: Literal["whole", "local"] = "local"
    """Players of a game: all remaining candidates, or the best connected one and its neighbours."""
    max_iterations: Annotated[int, Field(ge=1)] = 300
    """Most steps of the dynamics per cluster."""
    tolerance: Positive = 1e-4
    """The dynamics stop when a step changes the shares by less than this, or no player could gain more than this."""
    min_support: Annotated[int, Field(ge=1)] = 3
    """A cluster with fewer candidates is dropped."""
    min_payoff: Share = 0.3
    """A cluster with a smaller mean payoff is dropped."""


class AveragingConfig(Section):
    """From the candidates of a cluster to one cylinder."""

    max_iterations: Annotated[int, Field(ge=1)] = 20
    """Most steps of the dual-quaternion blending; not used if `refine` is on, whose fit replaces it."""
    refine: bool = True
    """Fit the average to all its points in the cloud, and extend it along its axis."""
    merge: bool = True
    """Join pieces of one pipe if one cylinder explains both."""


class VerificationConfig(Section):
    """What a cylinder must fulfil to be accepted: a confidence, and limits that hold whatever the confidence."""

    enabled: bool = True
    """Verify cylinders; the paper does not."""
    min_confidence: Share = 0.5
    """Least confidence. Raising it gives fewer false cylinders and more missed ones."""
    blends: bool = True
    """Report arcs that go on tangentially on both sides (rounds, fillets, slot ends) by themselves, as blends."""
    min_inliers: Annotated[int, Field(ge=0)] = 20
    """Fewest points of a cylinder."""
    min_coverage_deg: Annotated[Number, Field(ge=0, le=360)] = 20.0
    """Smallest angle about the axis that must be covered, degrees. This limit holds even if `enabled` is false."""
    min_height: Annotated[Number, Field(ge=0)] | None = None
    """Smallest visible length, in radii; null leaves it to the confidence."""
    max_slope: Annotated[Number, Field(ge=0)] | None = None
    """Largest change of the radius along the axis, beyond three standard errors; null leaves it to the confidence."""
    max_bulge: Annotated[Number, Field(ge=0)] | None = None
    """Largest curvature along the axis times the radius, beyond three standard errors; null: as above."""
