"""Clusters -> cylinders (section 3.4), and the fit of the average to all its points.

The paper stops at the average of the winning candidates. A candidate uses only the points of one slice or window;
fitted to all points about it, and followed along its axis for as long as the surface goes on, the average reaches the
accuracy of a fit to the segmented cylinder.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from cylx.config import AveragingConfig
from cylx.fits.robust import FIT_BEYOND_ENDS, TUKEY, TUKEY_SPREAD, WeightSchedule, fit_cylinder
from cylx.geometry.arrays import FloatArray
from cylx.geometry.crossings import between_crossings, evened
from cylx.geometry.cylinder import DIRECTION, POINT, RADIUS, distances_to, points_on
from cylx.geometry.dual_quaternions import blend, line_screws, move_points, turn_vectors
from cylx.geometry.extent import visible_extent
from cylx.records import Candidates, Cluster, IndexedCloud, Segment
from cylx.segments.refitting import LEAST_POINTS_OF_AVERAGE, LEAST_WIDTH, ROUGH_TOLERANCE, own_points, refit, shell_of

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
SURFACE_WIDTH, MOST_SPREAD = 3.0, 2.0
"""Points within so many deviations are on the surface; no deviation is taken for more than so many noises."""
MOST_RADIUS_RATIO = 2.0
"""A fit whose radius changes more than this has left the candidates it came from."""
SHORTEST_HALF, SHORTEST_SPACINGS = 0.02, 0.5
"""A cylinder has at least this half height, in radii or in spacings: what is shorter is a circle."""
SETTLED = 0.01
"""Growth ends when half the height changes less than this share of itself and of the radius."""
DOUBT_INSIDE = 0.4
"""A piece of the height that was found to belong before is asked for this share of what one beyond the ends is."""
STRICT_FLATNESS, STRICT_FROM_RADIUS = 0.75, 5.0
"""While a cylinder grows, points in flat windows of this share of what is too flat are left out, too, so that it does
not follow what it touches, such as the floor under a can; but if its radius is fewer spacings than these, the strip
that is seen of it may be flat itself."""
ENOUGH_TO_GROW = 6000
"""Points that suffice while a cylinder grows."""
ENOUGH_TO_JUDGE = 20000
"""Points that suffice to judge it; the last fit takes all."""
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
        points = own_points(indexed, model, half + beyond, width, ENOUGH_TO_JUDGE, strict)
        if len(points) < LEAST_POINTS_OF_AVERAGE:
            return "too few points"
        stride = max(1, len(points) // ENOUGH_TO_GROW)
        shell = _narrowed(points, model, half, shell, noise)
        some = points[::stride]
        some = some[evened((some - model[POINT]) @ model[DIRECTION], half)]
        schedule = WeightSchedule(shell, LEAST_WIDTH * noise, 1.0, TUKEY * TUKEY_SPREAD, ROUGH_TOLERANCE)
        end = FIT_BEYOND_ENDS * half
        steps = LATER_STEPS if step else FIRST_STEPS
        fit = fit_cylinder(some, model, low=-end, high=end, schedule=schedule, steps=steps)
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
    return _refit_between_crossings(Segment(model, half, noise), indexed)


def _refit_between_crossings(segment: Segment, indexed: IndexedCloud) -> Segment | str:
    """Fit a cylinder to its points, without the ends that lids, rims and tables cross."""
    fitted = refit(segment, indexed, most=ENOUGH_TO_JUDGE, even=True)
    if isinstance(fitted, str):
        return fitted
    points, width = shell_of(fitted, indexed, ENOUGH_TO_JUDGE)
    heights, residuals = distances_to(points, fitted.model)
    deviation = min(max(fitted.spread, 1e-9 * fitted.radius), 0.5 * width)
    low, high = between_crossings(heights, residuals, fitted.half, SURFACE_WIDTH * deviation, 2.0 * width)
    if high - low > (1.0 - 1e-9) * 2.0 * fitted.half:
        return refit(segment, indexed, most=ENOUGH_TO_JUDGE)
    model = fitted.model.copy()
    model[POINT] += 0.5 * (low + high) * model[DIRECTION]
    return refit(replace(fitted, model=model, half=0.5 * (high - low)), indexed, most=ENOUGH_TO_JUDGE)


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
