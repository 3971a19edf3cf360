"""The Cramér-Rao bound: the smallest error of a cylinder for a given noise."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from scipy.integrate import quad

from cylx.geometry.arrays import FloatArray


def outlier_information(sigma: float, sigma_o: float, p: float) -> float:
    """Return the Fisher information of noise with outliers about a location, relative to Gaussian noise.

    Parameters
    ----------
    sigma, sigma_o : float
        Standard deviations of points and of outliers, > 0.
    p : float
        Share of outliers, in [0, 1].

    Returns
    -------
    float
        Fisher information of (1 - p) N(0, sigma^2) + p N(0, sigma_o^2) about its location, times sigma^2.
    """
    if p == 0 or sigma == sigma_o:
        return 1.0

    def integrand(e: float) -> float:
        inner = (1 - p) / sigma * np.exp(-0.5 * (e / sigma) ** 2)
        outer = p / sigma_o * np.exp(-0.5 * (e / sigma_o) ** 2)
        density = inner + outer
        slope = e * (inner / sigma**2 + outer / sigma_o**2)
        return float(slope**2 / density / np.sqrt(2 * np.pi)) if density > 0 else 0.0

    narrow, wide = sorted((sigma, sigma_o))
    edges = [0.0, narrow, 3 * narrow, 6 * narrow, 6 * narrow + wide, 6 * narrow + 3 * wide, 12 * wide + 6 * narrow]
    half = sum(float(quad(integrand, low, high)[0]) for low, high in pairwise(edges))
    return 2 * half * sigma**2


def covariance_bound(points: int, height: float, theta: float, sigma: float, information: float = 1.0) -> FloatArray:
    """Return the bound on the covariance of a cylinder of unit radius, from points even over an arc and its height.

    A point at angle phi and height z measures (cos phi, sin phi, z cos phi, z sin phi, 1) times the parameters, with
    noise sigma.

    Parameters
    ----------
    points : int
        Number of points, > 0.
    height : float
        In radii, > 0.
    theta : float
        Arc, about the first axis, radians, in (0, 2 pi].
    sigma : float
        Standard deviation of the noise, radii.
    information : float
        From `outlier_information`.

    Returns
    -------
    ndarray of shape (5, 5)
        Of the offset along the view, the offset across it, two tilts (radians) and the radius.
    """
    mean_cos = np.sin(theta / 2) / (theta / 2)
    cos_cos = (1 + np.sin(theta) / theta) / 2
    sin_sin = 1 - cos_cos
    fisher = np.zeros((5, 5))
    fisher[np.ix_([0, 1, 4], [0, 1, 4])] = [[cos_cos, 0, mean_cos], [0, sin_sin, 0], [mean_cos, 0, 1]]
    fisher[[2, 3], [2, 3]] = height**2 / 12 * np.array([cos_cos, sin_sin])
    return np.asarray(np.linalg.inv(fisher * points * information / sigma**2))


def mean_length(covariance: FloatArray) -> float:
    """Return the mean length of a Gaussian vector in the plane: sqrt(pi/2) times the mean deviation over directions.

    Parameters
    ----------
    covariance : ndarray of shape (2, 2)
    """
    variances = np.linalg.eigvalsh(covariance)
    turn = np.pi * (np.arange(4096) + 0.5) / 4096
    deviations = np.sqrt(variances[0] * np.cos(turn) ** 2 + variances[1] * np.sin(turn) ** 2)
    return float(np.sqrt(np.pi / 2) * deviations.mean())


def mean_errors_at_bound(
    points: int, height: float, theta: float, sigma: float, sigma_o: float, p: float
) -> tuple[float, float, float]:
    """Return the least mean errors: of the axis in degrees, of its position in radii, of the radius in percent.

    Parameters
    ----------
    points : int
        Number of points, > 0.
    height : float
        In radii, > 0.
    theta : float
        Arc, radians, in (0, 2 pi].
    sigma, sigma_o : float
        Standard deviations of points and of outliers, radii, > 0.
    p : float
        Share of outliers, in [0, 1].
    """
    covariance = covariance_bound(points, height, theta, sigma, outlier_information(sigma, sigma_o, p))
    angle = float(np.degrees(mean_length(covariance[2:4, 2:4])))
    return angle, mean_length(covariance[:2, :2]), 100 * float(np.sqrt(2 / np.pi * covariance[4, 4]))
