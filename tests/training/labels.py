"""What a fit is in the light of the truth: true, ignored, ambiguous or false."""

import numpy as np

from cylx.evaluation.matching import pair_errors, read_cylinders

TRUE, IGNORED, AMBIGUOUS, FALSE = "true", "ignored", "ambiguous", "false"
RIGHT = (5.0, 0.25, 0.15)
"""A fit is true within these errors of angle (degrees), offset (radii) and radius (relative)."""
NEAR = (8.0, 0.7, 0.30)
"""Within these it is neither clearly the true cylinder nor clearly something else."""


def label_fits(truth, cylinders):
    """Label fitted cylinders.

    Parameters
    ----------
    truth : mapping
        As `SyntheticScene.truth()` gives it.
    cylinders : sequence of Cylinder
        In scene units.

    Returns
    -------
    labels : list of str
    owners : list of int or None
        The `id` of the true cylinder that a fit is one of; None unless it is true or ignored.
    """
    known = read_cylinders(truth, "truth")
    if not len(known):
        return [FALSE] * len(cylinders), [None] * len(cylinders)
    fits = read_cylinders({"cylinders": [_entry(shape) for shape in cylinders]}, "fits")
    errors = pair_errors(known, fits)
    along = errors.shift < (0.5 * known.heights + known.radii)[:, None]
    right, near = (_within(errors, limits) & along for limits in (RIGHT, NEAR))
    # what touches something that is ignored may be a part of it
    touching = (errors.offset < 2.0) & (errors.shift < known.heights[:, None]) & known.ignore[:, None]
    return _judged(known, right, near | touching, errors)


def _judged(known, right, near, errors):
    labels, owners = [], []
    for j in range(right.shape[1]):
        asked, any_ = np.flatnonzero(right[:, j] & ~known.ignore), np.flatnonzero(right[:, j])
        rows = asked if len(asked) else any_
        if len(rows):
            best = rows[errors.offset[rows, j].argmin()]
            labels.append(TRUE if len(asked) else IGNORED)
            owners.append(known.ids[best])
        else:
            labels.append(AMBIGUOUS if near[:, j].any() else FALSE)
            owners.append(None)
    return labels, owners


def _within(errors, limits):
    angle, offset, radius = limits
    return (errors.angle_deg < angle) & (errors.offset < offset) & (errors.radius < radius)


def _entry(shape):
    return {
        "axis_point": shape.point.tolist(),
        "axis_direction": shape.direction.tolist(),
        "radius": shape.radius,
        "height": shape.height,
    }
