"""The paper's synthetic data: one cylinder of unit radius (section 4.1)."""

from __future__ import annotations

import numpy as np

from cylx.geometry.cylinder import Cylinder
from cylx.synthetic.scene import NOISE, SyntheticScene, demand, true_cylinder
from cylx.synthetic.surfaces import Mantle


def single(
    *,
    points: int = 10000,
    height: float = 4.0,
    sigma: float = 0.01,
    p: float = 0.0,
    sigma_o: float = 0.04,
    theta_deg: float = 360.0,
    seed: int = 0,
) -> SyntheticScene:
    """Make the paper's cylinder: unit radius, on the z axis, about the origin.

    Each point is moved by zero-mean isotropic Gaussian noise of standard deviation `sigma`, or, with probability `p`,
    of `sigma_o` instead (the paper's salt and pepper noise).

    Parameters
    ----------
    points : int
        Number of points, > 0.
    height : float
        Height of the cylinder, in radii, > 0.
    sigma, sigma_o : float
        Noise of a point and of an outlier, in radii, >= 0.
    p : float
        Probability that a point is an outlier, in [0, 1].
    theta_deg : float
        Angle of the visible part of the surface, degrees, in (0, 360].
    seed : int
        Random seed, >= 0.

    Raises
    ------
    UsageError
        If a parameter is out of its range.

    Examples
    --------
    >>> scene = single(points=1000, sigma=0.0, seed=3)
    >>> scene.points.shape, scene.cylinders[0].cylinder.radius, scene.cylinders[0].coverage_deg
    ((1000, 3), 1.0, 360.0)
    """
    demand(points > 0, "points", f"must be > 0, not {points}")
    demand(0 < height < np.inf, "height", f"must be > 0, not {height}")
    demand(0 <= sigma < np.inf, "sigma", f"must be >= 0, not {sigma}")
    demand(0 <= p <= 1, "p", f"must be in [0, 1], not {p}")
    demand(0 <= sigma_o < np.inf, "sigma_o", f"must be >= 0, not {sigma_o}")
    demand(0 < theta_deg <= 360, "theta_deg", f"must be in (0, 360], not {theta_deg}")
    demand(seed >= 0, "seed", f"must be >= 0, not {seed}")
    rng = np.random.default_rng(seed)
    shape = Cylinder(np.zeros(3), np.array([0.0, 0.0, 1.0]), radius=1.0, height=height)
    surface = Mantle(shape, 0.0, np.radians(theta_deg)).sample(rng, points)
    outlier = rng.random(points) < p
    noise = np.where(outlier, sigma_o, sigma)[:, None] * rng.standard_normal((points, 3))
    return SyntheticScene(
        points=surface + noise,
        labels=np.where(outlier, NOISE, 0).astype(np.int32),
        cylinders=(true_cylinder(shape, surface[~outlier]),),
        sigma=float(sigma),
        family="single",
        seed=int(seed),
        params={"points": points, "height": height, "p": p, "sigma_o": sigma_o, "theta_deg": theta_deg},
    )
