"""Line fit: a line through the centres of the ellipses of all slices, and the mean of their semi-minor axes.

After the method that the paper takes from its reference 26 and describes in sections 3.2 and 4.2. Slices and ellipses
are the same as for the game, all with equal weight; the cylinder is then refined by a non-linear optimisation.

Our readings: of the ellipses of one slice, which belong to different cylinders, the best supported one is used. The
paper does not say what is optimised; here it is the sum of squared orthogonal distances of the points near the surface,
over the five parameters. The method is for one cylinder: with several, the result fits none of them.
"""

from __future__ import annotations

import math

import numpy as np

from cylx.baselines.proposal import Proposal
from cylx.config import LineFitConfig
from cylx.fits.robust import WeightSchedule, fit_cylinder
from cylx.geometry.cylinder import DIRECTION, POINT, RADIUS, canonical_direction, cylinder_coordinates
from cylx.records import EllipseFit, Frame

UNBOUNDED_WIDTH = 1e6
"""With a weight function this many radii wide all points have the same weight."""


def fit_line_of_centres(fits: list[list[EllipseFit]], frame: Frame, config: LineFitConfig) -> list[Proposal]:
    """Find one cylinder from the ellipses of all slices.

    Parameters
    ----------
    fits : list of list of EllipseFit
        Ellipses of each slice.
    frame : Frame
    config : LineFitConfig

    Returns
    -------
    list of Proposal
        One proposal; none with fewer than two ellipses.
    """
    ellipses = [max(ones, key=lambda fit: fit.inliers) for ones in fits if ones]
    if len(ellipses) < 2:
        return []
    centers = np.array([fit.plane.lift(fit.ellipse.center) for fit in ellipses])
    radius = float(np.mean([fit.ellipse.semi_minor for fit in ellipses]))
    point = centers.mean(axis=0)
    direction = canonical_direction(np.linalg.svd(centers - point)[2][0])
    found = Proposal.spanning(point, direction, radius, centers, len(ellipses))
    if not config.refine:
        return [found]
    model = found.segment.model
    _, distances, _ = cylinder_coordinates(frame.points, model[POINT], model[DIRECTION])
    near = frame.points[np.abs(distances - radius) < config.reach * radius]
    wide = UNBOUNDED_WIDTH * radius
    fit = fit_cylinder(
        near, model, low=-math.inf, high=math.inf, schedule=WeightSchedule(wide, wide, 1.0, math.inf), steps=50
    )
    if fit is None:
        return [found]
    model = fit[0]
    return [Proposal.spanning(model[POINT], model[DIRECTION], float(model[RADIUS]), near, len(ellipses))]
