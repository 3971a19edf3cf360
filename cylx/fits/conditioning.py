"""Update a cylinder that was fitted without knowledge of its radius when the radius becomes known."""

from __future__ import annotations

import numpy as np

from cylx.geometry.arrays import FloatArray
from cylx.geometry.cylinder import DIRECTION, POINT, RADIUS
from cylx.geometry.numerics import fill_basis


def given_radius(
    model: FloatArray, covariance: FloatArray, radius: float, deviation: float
) -> tuple[FloatArray, FloatArray]:
    """Condition a fitted cylinder on its radius: the mean and covariance of a Gaussian, given one more observation.

    With the covariance C and its last column c, the parameters change by c (R - r) / (C_rr + t^2), and c c^T divided by
    the same is subtracted from the covariance.

    Parameters
    ----------
    model : ndarray of shape (7,)
        A point of the axis, its unit direction, the radius r. Not changed.
    covariance : ndarray of shape (5, 5)
        C, as in `cylx.fits.likelihood.MixtureFit`.
    radius : float
        R, in the unit of the model.
    deviation : float
        t, its standard deviation, > 0.

    Returns
    -------
    model, covariance : ndarray of shape (7,), (5, 5)
    """
    gain = covariance[:, 4] / (covariance[4, 4] + deviation**2)
    step = gain * (radius - model[RADIUS])
    basis = np.empty((2, 3))
    fill_basis(model[DIRECTION], basis)
    moved = model.copy()
    moved[POINT] += step[:2] @ basis
    moved[DIRECTION] += step[2:4] @ basis
    moved[DIRECTION] /= np.linalg.norm(moved[DIRECTION])
    moved[RADIUS] += step[4]
    return moved, covariance - np.outer(gain, covariance[4])
