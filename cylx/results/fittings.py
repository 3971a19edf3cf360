"""The fittings and runs of a result: the keys of each, and their meaning."""

from __future__ import annotations

from math import degrees
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import Field, TypeAdapter

from cylx.results.cylinders import Numbered
from cylx.results.parts import Count, Length, Number, Part, Vector, drop_missing, plain_numbers

if TYPE_CHECKING:
    from cylx.records.fittings import Fitting
    from cylx.records.piping import Adjustment, PipeRun

Positive = Annotated[Number, Field(gt=0)]
Share = Annotated[Number, Field(ge=0, le=1)]


class ResultFitting(Part):
    """What joins cylinders, or ends one, and the evidence for it."""

    id: Count
    """Position in the list; `fitting_id` of its points in the annotated cloud."""
    kind: str
    """What it is."""
    joins: list[Count]
    """Ids of the cylinders it joins."""
    ends: list[Literal["start", "end", "side"]]
    """Where it meets each of them: at one of the two ends, or on the surface between them."""
    confidence: Share
    """How well its points tell it, or the axes where it has no points: a score, not a probability fitted to truths."""
    inliers: Count
    """Points on its surface."""
    rms: Length
    """Root mean square distance of the inliers from it, scene units; 0 without inliers."""
    coverage: Share
    """Share of its surface that the inliers cover."""
    std: dict[str, Length]
    """Standard deviations of its values, by their names: scene units, degrees for `angle_deg`."""

    def to_object(self) -> dict[str, Any]:
        """Return the JSON object."""
        return self.model_dump(mode="json")


class ResultElbow(ResultFitting):
    """A bend: a part of a torus that touches both cylinders."""

    kind: Literal["elbow"]
    """What it is."""
    center: Vector
    """Middle of the circle that the centre line follows; of a mitre, where the axes meet; scene units."""
    normal: Vector
    """Unit normal of its plane; the centre line turns about it, right-handed, from `start` to `end`."""
    bend_radius: Length
    """Radius of the centre line, scene units; 0 for a mitre."""
    angle_deg: Annotated[Number, Field(gt=0, le=180)]
    """Change of direction, degrees."""
    radius: Positive
    """Radius of the tube, scene units."""
    start: Vector
    """Where the centre line leaves the first cylinder of `joins`, scene units."""
    end: Vector
    """Where it enters the second one, scene units."""


class _Junction(ResultFitting):
    center: Vector
    """Where the axes meet, on that of the main, scene units."""
    main: list[Count]
    """Cylinders of the main: one that goes through, or one on either side."""
    branches: list[Count]
    """Cylinders that end on the surface of the main."""
    angle_deg: Annotated[Number, Field(gt=0, le=90)]
    """Angle between the axes of the main and of the first branch, degrees."""


class ResultTee(_Junction):
    """A branch that ends on the surface of a main."""

    kind: Literal["tee"]
    """What it is."""


class ResultCross(_Junction):
    """Two branches that face each other and end on the surface of a main."""

    kind: Literal["cross"]
    """What it is."""


class ResultReducer(ResultFitting):
    """A piece between two cylinders of different radius with parallel axes."""

    kind: Literal["reducer"]
    """What it is."""
    start: Vector
    """End of its centre line on the axis of the first cylinder of `joins`, scene units."""
    end: Vector
    """End of its centre line on the axis of the second one, scene units."""
    start_radius: Positive
    """Radius at `start`, scene units."""
    end_radius: Positive
    """Radius at `end`, scene units."""
    offset: Length
    """Distance of the two axes, scene units."""
    concentric: bool
    """Whether the axes are one line."""


class ResultFlange(ResultFitting):
    """A disc about the axis, or a pair of discs face to face."""

    kind: Literal["flange"]
    """What it is."""
    center: Vector
    """Middle of the disc, or of both, on the axis, scene units."""
    axis: Vector
    """Unit direction of the axis."""
    radius: Positive
    """Radius of the rim, scene units."""
    thickness: Positive
    """Length along the axis, of both discs for a pair, scene units."""
    pair: bool
    """Whether pipes go on at both sides."""


class ResultInline(ResultFitting):
    """Something of unknown kind between two coaxial cylinders, such as a valve."""

    kind: Literal["inline"]
    """What it is."""
    start: Vector
    """Its end at the first cylinder of `joins`, on the axis, scene units."""
    end: Vector
    """Its end at the second one, scene units."""


class ResultCap(ResultFitting):
    """The closed end of a cylinder."""

    kind: Literal["cap"]
    """What it is."""
    center: Vector
    """The outermost point of the cap on the axis, scene units."""
    axis: Vector
    """Unit direction of the axis, out of the cylinder."""
    radius: Positive
    """Radius of the cylinder, scene units."""


class ResultJoint(ResultFitting):
    """A gap that is bridged: both cylinders point at each other, and nothing is seen of what is between them."""

    kind: Literal["joint"]
    """What it is."""
    start: Vector
    """End of the first cylinder of `joins`, scene units."""
    end: Vector
    """End of the second one, scene units."""
    length: Length
    """Length of the gap along the assumed centre line, scene units."""
    assumed: bool
    """Whether nothing but the axes speaks for it."""


AnyFitting = Annotated[
    ResultElbow | ResultTee | ResultCross | ResultReducer | ResultFlange | ResultInline | ResultCap | ResultJoint,
    Field(discriminator="kind"),
]
"""A fitting of any kind, told by its `kind`."""
_FITTING: TypeAdapter[AnyFitting] = TypeAdapter(AnyFitting)


def fitting_of(index: int, fitting: Fitting) -> AnyFitting:
    """Describe number `index` of a list of fittings."""
    keys: dict[str, Any] = {"id": index, "kind": fitting.kind}
    for name in _names_of(fitting):
        value = getattr(fitting, name)
        if name == "angle":
            name, value = "angle_deg", degrees(value)  # noqa: PLW2901  its name in the file
        elif name == "std":
            value = {key: float(deviation) for key, deviation in value.items()}
        elif isinstance(value, tuple):
            value = list(value)
        elif hasattr(value, "shape"):
            value = plain_numbers(value)
        keys[name] = value
    return _FITTING.validate_python(keys)


def _names_of(fitting: Fitting) -> list[str]:
    """Return the names of the fields of a fitting."""
    from dataclasses import fields  # noqa: PLC0415  for this alone

    return [one.name for one in fields(fitting)]


class ResultOpenEnd(Part):
    """An end of a run."""

    cylinder: Count
    """Id of the cylinder."""
    end: Literal["start", "end"]
    """Which end of it."""
    reason: Literal["nothing_there", "leaves_cloud", "hidden"]
    """`nothing_there`: seen to end; `leaves_cloud`: at the border of the cloud; `hidden`: no points about it."""


class ResultSize(Part):
    """The cylinders of a run that have one size, taken together."""

    radius: Positive
    """Their common radius, scene units."""
    std: Length
    """Its standard deviation, scene units."""
    length: Length
    """Length along the centre line, with the elbows, scene units."""
    cylinders: list[Count]
    """Their ids."""
    nominal: str | None = None
    """The entry of the catalogue that all of them together support; absent if there is none."""


class ResultRun(Numbered):
    """Cylinders that are joined with each other, in their order."""

    id: Count
    """Position in the list; `run_id` of its points in the annotated cloud."""
    cylinders: list[Count]
    """Ids of its cylinders, in order from one end; a branch comes after all that lies ahead of it."""
    fittings: list[Count]
    """Ids of its fittings, in order."""
    length: Length
    """Length along the centre line, scene units."""
    slope: Number | None = None
    """Rise along z over horizontal distance of its level cylinders, in its direction; absent if none is level."""
    nominal: str | None = None
    """The entry of the catalogue of most of its length; absent if there is none."""
    sizes: list[ResultSize]
    """Its sizes, that of the greatest length first."""
    open_ends: list[ResultOpenEnd]
    """Where nothing joins its cylinders, and why."""
    loops: Count
    """Number of ways round; 0 for a tree."""

    @classmethod
    def of(cls, index: int, run: PipeRun) -> ResultRun:
        """Describe number `index` of a list of runs."""
        return cls(
            id=index,
            cylinders=list(run.cylinders),
            fittings=list(run.fittings),
            length=run.length,
            slope=run.slope,
            nominal=run.sizes[0].nominal if run.sizes else None,
            sizes=[
                ResultSize(
                    radius=size.radius,
                    std=size.std,
                    length=size.length,
                    cylinders=list(size.cylinders),
                    nominal=size.nominal,
                )
                for size in run.sizes
            ],
            open_ends=[
                ResultOpenEnd.model_validate({"cylinder": one.cylinder, "end": one.end, "reason": one.reason})
                for one in run.open_ends
            ],
            loops=run.loops,
        )

    def to_object(self) -> dict[str, Any]:
        """Return the JSON object; what was not computed is left out."""
        content = self.model_dump(mode="json")
        drop_missing([content, *content["sizes"]])
        return content


class ResultAdjustment(Part):
    """What came of a constraint on a run that was fitted as it was built."""

    fitting: Count | None = None
    """Id of the fitting that asks for it; absent for a radius."""
    what: Literal["meeting", "angle_deg", "line", "radius"]
    """Axes meet; their angle is round; they are one line, or parallel; one radius for all cylinders of a size."""
    cylinders: list[Count]
    """Ids of the cylinders it is about."""
    measured: Number
    """Value before: scene units, degrees for `angle_deg`; of `line` also radians."""
    target: Number
    """Value if it holds, in the same unit."""
    std: Length
    """Standard deviation of the measured value."""
    applied: bool
    """Whether it holds now; otherwise the measured value contradicts it."""

    def to_object(self) -> dict[str, Any]:
        """Return the JSON object."""
        content = self.model_dump(mode="json")
        drop_missing([content])
        return content

    @classmethod
    def of(cls, one: Adjustment) -> ResultAdjustment:
        """Describe an adjustment."""
        return cls.model_validate(
            {
                "fitting": one.fitting,
                "what": one.what,
                "cylinders": list(one.cylinders),
                "measured": float(one.measured),
                "target": float(one.target),
                "std": float(one.std),
                "applied": one.applied,
            }
        )
