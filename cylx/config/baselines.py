"""The configuration sections of the four methods that the paper compares itself with; see `cylx.baselines`."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from cylx.config.sections import Number, Positive, Section, Share

Angle = Annotated[Number, Field(gt=0, lt=90)]


class MsacConfig(Section):
    """Sample consensus with normals; used by `method: msac` only."""

    neighbours: Annotated[int, Field(ge=3)] = 50
    """Points used to fit a normal. More points smooth the noise, and round off thin pipes."""
    iterations: Annotated[int, Field(ge=1)] = 5000
    """Pairs of points tried for each cylinder."""
    distance: Positive | None = None
    """Distance from the surface up to which a point supports a cylinder, scene units; null is three noises."""
    refine: bool = False
    """Fit the best cylinder to its support by least squares; the paper does not mention it."""
    removal: Annotated[Number, Field(gt=0, lt=1)] = 0.05
    """Points this close to the surface of an accepted cylinder, in radii, are removed from the search."""
    min_share: Share = 0.01
    """A cylinder supported by a smaller share of all points ends the search; the paper assumes a known number."""


class LineFitConfig(Section):
    """A line through the centres of ellipses; used by `method: line-fit` only, for clouds of one cylinder."""

    refine: bool = True
    """Finally fit the cylinder to the points by least squares."""
    reach: Annotated[Number, Field(gt=0, lt=1)] = 0.5
    """The final fit uses the points this close to the surface, in radii."""


class TranConfig(Section):
    """Growing from seeds with normals, and mean shift; used by `method: tran` only."""

    neighbours: Annotated[int, Field(ge=3)] = 50
    """Points used to fit a normal."""
    start_neighbours: Annotated[int, Field(ge=6)] = 50
    """Points used to fit the first cylinder of a seed."""
    seeds: Annotated[int, Field(ge=1)] = 100
    """Points from which cylinders are grown."""
    iterations: Annotated[int, Field(ge=1)] = 10
    """Number of times a cylinder is fitted and its support collected again."""
    min_curvature: Annotated[Number, Field(ge=1)] = 2.0
    """Least ratio of the two largest spreads (variances) of the normals about a seed: a plane has 1."""
    distance: Positive | None = None
    """Distance from the surface up to which a point supports a cylinder, scene units; null is three noises."""
    normal_angle_deg: Angle = 20.0
    """Angle between normal and radial direction up to which a point supports a cylinder, degrees."""
    min_support: Annotated[int, Field(ge=6)] = 50
    """alpha in our reading: fewest points of a valid cylinder."""
    min_coverage_deg: Annotated[Number, Field(ge=0, le=360)] = 0.0
    """alpha in another reading: the angle about its axis that a valid cylinder covers, degrees."""
    min_agreement: Share = 0.95
    """beta in our reading: share of the points within `distance` of a valid cylinder whose normals agree with it."""
    bandwidth_deg: Angle = 5.0
    """Mean shift: bandwidth of the angle between axes, degrees."""
    bandwidth: Positive = 0.1
    """Mean shift: bandwidth of the offset of axes and of the difference of radii, in radii."""
    min_share: Share = 0.05
    """A mode of mean shift with a smaller share of the valid cylinders is dropped."""


class JinConfig(Section):
    """Spheres that roll within a pipe; used by `method: jin` only."""

    seeds: Annotated[int, Field(ge=1)] = 400
    """Neighbourhoods in which a sphere is searched."""
    neighbourhood: Positive | None = None
    """Radius of a neighbourhood, scene units; null tries many, from 6 spacings to a quarter of the extent."""
    iterations: Annotated[int, Field(ge=1)] = 200
    """Spheres through four points tried in each neighbourhood."""
    distance: Positive | None = None
    """Distance from its surface up to which a point supports a sphere, scene units; null is three noises."""
    min_share: Share = 0.15
    """A sphere supported by a smaller share of its neighbourhood is dropped."""
    min_linearity: Share = 0.7
    """Share of the largest variance of the centres about a centre above which the pipe is straight there."""
    line_distance: Positive = 0.2
    """Distance from a line up to which a centre belongs to it, in radii; also the limit for the difference of radii."""
    line_iterations: Annotated[int, Field(ge=1)] = 500
    """Lines through two centres tried for each cylinder."""
    min_spheres: Annotated[int, Field(ge=3)] = 10
    """A line with fewer centres is not a cylinder."""
