"""Clusters -> cylinders (section 3.4), and the fit of the average to all its points.

The paper stops at the average of the winning candidates. A candidate uses only the points of one slice or window;
fitted to all points about it, and followed along its axis for as long as the surface goes on, the average reaches the
accuracy of a fit to the segmented cylinder.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from cylx.config import AveragingConfig
from cylx.fits.conditioning import given_radius
from cylx.fits.likelihood import Prior, fit_mixture
from cylx.fits.nominal_radius import Catalogue, choose_entry
from cylx.fits.robust import FIT_BEYOND_ENDS, TUKEY, TUKEY_SPREAD, WeightSchedule, fit_cylinder, unbiased_radius
from cylx.geometry.arrays import FloatArray
from cylx.geometry.cylinder import DIRECTION, POINT, RADIUS, distances_to, points_on
from cylx.geometry.dual_quaternions import blend, line_screws, move_points, turn_vectors
from cylx.geometry.extent import visible_extent
from cylx.records import Candidates, Cluster, IndexedCloud, Segment

MARGIN_OF_AVERAGE = 0.4
"""Candidates speak for their places and this share of their extents to either side."""
GROWTH_STEPS = 8
"""Rounds of fitting and growing at most; a few suffice, because the height may double in each."""
FIRST_STEPS, LATER_STEPS = 25, 12
"""Gauss-Newton steps of the first fit, which starts from the rough average, and of the later ones."""
FIRST_REACH, REACH_RADII, REACH_HALVES = 0.5, 1.5, 0.7
"""How far beyond the ends points are taken: in radii before the first fit; later in radii or half heights, whichever
is more, so that a long pipe grows as fast as a short one."""
FIRST_SHELL, LATER_SHELL, LEAST_SHELL = 0.12, 0.05, 5.0
"""Half width of the shell in which points have a say: in radii at first, in radii later, and at least in noises."""
NARROW_SHELLS, NARROW_TIMES = (0.002, 0.01), 4.0
"""Half widths in radii of narrow shells, which are enough where points are so many times denser in them than about."""
SHELL_MARGIN = 8.0
"""Points are gathered this many noises beyond the shell: it moves with the fit."""
LEAST_WIDTH = 3.0
"""The width of the weights does not fall below this many noises: a Gaussian ends there."""
SURFACE_WIDTH, MOST_SPREAD = 3.0, 2.0
"""Points within so many deviations are on the surface; no deviation is taken for more than so many noises."""
MOST_RADIUS_RATIO = 2.0
"""A fit whose radius changes more than this has left the candidates it came from."""
LEAST_POINTS_OF_AVERAGE = 20
"""Without so many points five parameters are not fitted robustly."""
SHORTEST_HALF, SHORTEST_SPACINGS = 0.02, 0.5
"""A cylinder has at least this half height, in radii or in spacings: what is shorter is a circle."""
SETTLED = 0.01
"""Growth ends when half the height changes less than this share of itself and of the radius."""
SHELL_OF_FIT, LEAST_SHELL_OF_FIT = 4.0, 0.02
"""Half width of the shell of the last fits: in noises, and at least in radii, as real surfaces are no cylinders."""
REFIT_STEPS, MOST_REFIT_STEPS = 15, 60
"""Gauss-Newton steps of a fit to a sample of the points, and of one to all of them, which goes to its fixed point."""
DOUBT_INSIDE = 0.4
"""A piece of the height that was found to belong before is asked for this share of what one beyond the ends is."""
STRICT_FLATNESS, STRICT_FROM_RADIUS = 0.75, 5.0
"""While a cylinder grows, points in flat windows of this share of what is too flat are left out, too, so that it does
not follow what it touches, such as the floor under a can; but if its radius is fewer spacings than these, the strip
that is seen of it may be flat itself."""
ROUGH_TOLERANCE = 0.02
"""While a cylinder grows, a fit may end at steps of this share of the spread."""
ENOUGH_TO_GROW = 6000
"""Points that suffice while a cylinder grows."""
ENOUGH_TO_JUDGE = 20000
"""Points that suffice to judge it; the last fit takes all."""
STRUCTURED_LACK_OF_FIT = 1.4
"""A lack of fit (chi-square per cell) beyond this is none by chance."""
WIDEST_IN_LAST_FIT = 8.0
"""Deviations from the surface up to which points have a say in the last fit; outliers are hardly further away."""
MOST_FORM, MOST_FORM_NOISES = 0.04, 6.0
"""Scatter that a surface may have beyond that, as a share of the radius, and in noises."""
LEAST_COSINE = math.cos(math.radians(25.0))
"""A fit whose axis turns further than this has left the candidates it came from."""


def average_cluster(candidates: Candidates, cluster: Cluster, config: AveragingConfig) -> Segment:
    """Average the candidates of a cluster: eq. 8 for the radius, dual-quaternion iterative blending for the axis.

    What is refined afterwards is not blended: the weighted mean of points and directions, which agrees to first order,
    is as good a start.

    Parameters
    ----------
    candidates : Candidates
    cluster : Cluster
    config : AveragingConfig

    Returns
    -------
    Segment
        The average; its height is that of its candidates along the axis.
    """
    points, directions = candidates.points[cluster.members], candidates.directions[cluster.members]
    weights = cluster.weights
    lead = directions[int(np.argmax(weights))]
    directions = np.where((directions @ lead)[:, None] < 0, -directions, directions)
    # step 1; the frame is moved to the initial point, because blending depends on the origin
    origin = weights @ points
    direction = weights @ directions
    direction /= np.linalg.norm(direction)
    point, axis = origin, direction
    if not config.refine:  # a fit to the points sets out from here as well as from the blend of all screws
        motions, _, _ = line_screws(np.zeros(3), direction, points - origin, directions)
        motion = blend(motions, weights, config.max_iterations)
        axis = turn_vectors(motion, direction)
        axis /= np.linalg.norm(axis)
        point = move_points(motion, np.zeros(3)) + origin
    heights = (points - point) @ axis
    margin = MARGIN_OF_AVERAGE * float(np.median(candidates.extents[cluster.members]))
    low, high = float(heights.min()) - margin, float(heights.max()) + margin
    model = np.concatenate([point + 0.5 * (low + high) * axis, axis, [weights @ candidates.radii[cluster.members]]])
    return Segment(model, 0.5 * (high - low), 0.0)


def refine(segment: Segment, indexed: IndexedCloud) -> Segment | str:
    """Fit a rough cylinder to the cloud and let it grow along its axis until the surface ends.

    Parameters
    ----------
    segment : Segment
        The start.
    indexed : IndexedCloud
        The cloud.

    Returns
    -------
    Segment or str
        The fitted cylinder with its visible extent, or why there is none.
    """
    model, half = segment.model, segment.half
    noise = indexed.noise_about(model, half)
    first = model
    for step in range(GROWTH_STEPS):
        beyond = max(REACH_RADII * model[RADIUS], REACH_HALVES * half) if step else FIRST_REACH * model[RADIUS]
        shell = max((LATER_SHELL if step else FIRST_SHELL) * model[RADIUS], LEAST_SHELL * noise)
        width = shell + SHELL_MARGIN * noise
        strict = STRICT_FLATNESS if model[RADIUS] > STRICT_FROM_RADIUS else 1.0
        points = _own_points(indexed, model, half + beyond, width, ENOUGH_TO_JUDGE, strict)
        if len(points) < LEAST_POINTS_OF_AVERAGE:
            return "too few points"
        stride = max(1, len(points) // ENOUGH_TO_GROW)
        shell = _narrowed(points, model, half, shell, noise)
        schedule = WeightSchedule(shell, LEAST_WIDTH * noise, 1.0, TUKEY * TUKEY_SPREAD, ROUGH_TOLERANCE)
        end = FIT_BEYOND_ENDS * half
        fit = fit_cylinder(
            points[::stride], model, low=-end, high=end, schedule=schedule, steps=LATER_STEPS if step else FIRST_STEPS
        )
        if fit is None:
            return "no fit"
        model, spread = fit
        alike = first[RADIUS] / MOST_RADIUS_RATIO <= model[RADIUS] <= MOST_RADIUS_RATIO * first[RADIUS]
        if not alike or abs(model[DIRECTION] @ first[DIRECTION]) < LEAST_COSINE:
            return "drifted away"
        spread = TUKEY_SPREAD * spread
        most = max(MOST_SPREAD * noise, min(MOST_FORM * model[RADIUS], MOST_FORM_NOISES * noise))
        heights, angles = points_on(points, model, SURFACE_WIDTH * min(max(spread, noise), most))
        found = visible_extent(heights, angles, half, model[RADIUS], doubt=DOUBT_INSIDE if step else 1.0)
        if found is None:
            return "too few points"
        low, high = found
        before = half
        half = 0.5 * (high - low)
        model[POINT] += 0.5 * (low + high) * model[DIRECTION]
        if half < min(SHORTEST_HALF * model[RADIUS], SHORTEST_SPACINGS):
            return "too short"
        if step and abs(half - before) < SETTLED * before + SETTLED * model[RADIUS]:
            break
    return refit(Segment(model, half, noise), indexed, most=ENOUGH_TO_JUDGE)


def _narrowed(points: FloatArray, model: FloatArray, half: float, shell: float, noise: float) -> float:
    """Return the half width of the shell of a fit: a narrow one, if by far the most points of the wide one lie in it.

    Other surfaces about the same axis lie in the wide one as well: the wall of a tube, steps of a shaft.
    """
    heights, residuals = distances_to(points, model)
    residuals = residuals[np.abs(heights) <= half]
    all_around = int((residuals < shell).sum())
    for share in NARROW_SHELLS:
        narrow = max(share * model[RADIUS], LEAST_SHELL * noise)
        within = int((residuals < narrow).sum())
        dense = within * (shell - narrow) > NARROW_TIMES * (all_around - within) * narrow
        if narrow < shell and within >= LEAST_POINTS_OF_AVERAGE and dense:
            return float(narrow)
    return shell


def refit(segment: Segment, indexed: IndexedCloud, most: int | None = None) -> Segment | str:
    """Fit a cylinder to its points between its ends, to the fixed point of the robust estimate.

    Parameters
    ----------
    segment : Segment
    indexed : IndexedCloud
    most : int, optional
        Points that suffice; all by default.

    Returns
    -------
    Segment or str
        With the bias of the radius taken off; or why there is none.
    """
    fit = _robust_fit(
        *_shell(segment, indexed, most), segment, indexed, steps=REFIT_STEPS if most else MOST_REFIT_STEPS
    )
    if fit is None:
        return "no fit"
    model, spread = fit
    model[RADIUS] = unbiased_radius(model[RADIUS], min(spread, 0.5 * model[RADIUS]))
    return replace(segment, model=model, spread=spread, covariance=None, choice=None)


def inflation(measures: Mapping[str, float]) -> float:
    """Return how many times larger a covariance is than noise makes it, from what the verification measured.

    Where the residuals are structured beyond noise, because the object is no perfect cylinder or its noise is shared by
    neighbours, the parameters are as much less certain as the mean residuals over its surface scatter more.
    """
    lack = measures.get("lack_of_fit", 1.0)
    return lack if lack > STRUCTURED_LACK_OF_FIT else 1.0


def finish(
    segment: Segment,
    indexed: IndexedCloud,
    known: Prior | None = None,
    catalogue: Catalogue | None = None,
    *,
    inflated: float = 1.0,
) -> Segment | str:
    """Fit a cylinder to all its points by maximum likelihood, and say how uncertain it is.

    What is known draws the fit to it, as far as the points do not contradict it: a prior that is wrong by many
    standard deviations would spoil the fit. A nominal radius draws the fit only where the points bear it out.

    Parameters
    ----------
    segment : Segment
    indexed : IndexedCloud
    known : Prior, optional
    catalogue : Catalogue, optional
        Nominal radii, in the unit of the cloud's frame.
    inflated : float
        `inflation` of its covariance. If it is above 1, the object is no perfect cylinder, and its residuals are no
        noise. The likelihood would be that of its most cylindrical part; the robust fit is drawn by all of it, and
        stays.

    Returns
    -------
    Segment or str
        With its covariance, not inflated; that of `refit` without one if the points are too few for it; or why there
        is none.
    """
    points, width = _shell(segment, indexed, None)
    fit = _robust_fit(points, width, segment, indexed, steps=REFIT_STEPS, tolerance=ROUGH_TOLERANCE)
    if fit is None:
        return "no fit"
    model, spread = fit
    _turn_as_given(model)
    end, deviation = (
        FIT_BEYOND_ENDS * segment.half,
        max(spread, 1e-9 * model[RADIUS]),
    )  # points may lie on the surface exactly
    limits = {
        "low": -end,
        "high": end,
        "width": min(WIDEST_IN_LAST_FIT * deviation, 2.0 * width),
        "deviation": deviation,
    }
    likely = fit_mixture(points, model, **limits)
    if likely is None:
        return refit(segment, indexed)
    prior = None if known is None else known.as_far_as_borne_out(likely)
    robust = inflated > 1.0 and prior is None
    if robust:
        fitted = refit(segment, indexed)
        if isinstance(fitted, str):
            return fitted
        free = replace(fitted, covariance=likely.covariance)
    else:
        if prior is not None:
            likely = fit_mixture(points, model, **limits, prior=prior) or likely
        free = replace(segment, model=likely.model, spread=spread, covariance=likely.covariance, choice=None)
    if catalogue is None:
        return free
    choice = choose_entry(free.radius, math.sqrt(inflated * likely.covariance[4, 4]), catalogue)
    if choice.decision != "snapped":
        return replace(free, choice=choice)
    nominal = catalogue.radii[choice.entry]
    # inflated with the rest, it is the tolerance again, and the points weigh as little as they should
    tolerance = catalogue.tolerances[choice.entry] / math.sqrt(inflated)
    snapping = (prior or Prior())._replace(radius=nominal, radius_deviation=tolerance)
    snapped = None if robust else fit_mixture(points, model, **limits, prior=snapping)
    if snapped is not None:
        return replace(free, model=snapped.model, spread=spread, covariance=snapped.covariance, choice=choice)
    start = free.model.copy()
    _turn_as_given(start)
    moved, covariance = given_radius(start, likely.covariance, nominal, tolerance)
    return replace(free, model=moved, covariance=covariance, choice=choice)


def _turn_as_given(model: FloatArray) -> None:
    """Turn the direction of a model as the result has it, which the covariance goes by: its largest part positive."""
    direction = model[DIRECTION]
    direction *= np.sign(direction[np.abs(direction).argmax()])


def _shell(segment: Segment, indexed: IndexedCloud, most: int | None) -> tuple[FloatArray, float]:
    """Return the points about the surface of a segment, and how near to it those lie that have a say at first."""
    width = max(SHELL_OF_FIT * indexed.noise_about(segment.model, segment.half), LEAST_SHELL_OF_FIT * segment.radius)
    end = FIT_BEYOND_ENDS * segment.half
    return _own_points(indexed, segment.model, end, 2.0 * width, most, segment.flat_share), width


def _robust_fit(
    points: FloatArray, width: float, segment: Segment, indexed: IndexedCloud, *, steps: int, tolerance: float = 1e-9
) -> tuple[FloatArray, float] | None:
    """Fit a cylinder to the points of a segment; give it and the standard deviation about it."""
    noise, end = indexed.noise_about(segment.model, segment.half), FIT_BEYOND_ENDS * segment.half
    schedule = WeightSchedule(width, LEAST_WIDTH * noise, 1.0, TUKEY * TUKEY_SPREAD, tolerance)
    if len(points) < LEAST_POINTS_OF_AVERAGE:
        return None
    fit = fit_cylinder(points, segment.model, low=-end, high=end, schedule=schedule, steps=steps)
    return None if fit is None else (fit[0], fit[1] * TUKEY_SPREAD)


def _own_points(
    indexed: IndexedCloud, model: FloatArray, half: float, width: float, most: int | None, strict: float = 1.0
) -> FloatArray:
    """Return points near a cylinder's surface not of something flatter, about `most` of them."""
    limit = strict * indexed.too_flat(model[RADIUS])
    if indexed.normals is None:
        return indexed.cells.surface_points(model, half, width, most, indexed.flatness, limit)
    radius = float(model[RADIUS])
    near = indexed.cells.near_cylinder(model, -half, half, max(0.0, radius - width), radius + width)
    near = near[indexed.may_be_on(near, model) & (indexed.flatness[near] < limit)]
    return indexed.points[near[:: max(1, len(near) // most) if most else 1]]
