"""Tanks whose dents, ovality and place are known."""

import numpy as np

from cylx.geometry.cylinder import Cylinder, axis_basis

DEPTH, REACH = 0.02, 0.5
"""Of the dent: a bump of a cosine."""


def tank(
    points=60_000, radius=3.0, height=8.0, noise=0.002, dent=DEPTH, oval=0.0, taper=0.0, arc=2 * np.pi, seed=0,
    direction=(0.0, 0.0, 1.0), middle=(0.0, 0.0, 0.0),
):  # fmt: skip
    """Return points of a tank with a dent at the angle 1 and the height 1.5, the tank, and the middle of the dent.

    `oval` is the largest diameter minus the smallest, `taper` the change of the diameter per length.
    """
    rng = np.random.default_rng(seed)
    angle = 1.0 + rng.uniform(-arc / 2, arc / 2, points)
    along = rng.uniform(-height / 2, height / 2, points)
    far = np.hypot(radius * np.angle(np.exp(1j * (angle - 1.0))), along - 1.5) / REACH
    inwards = np.where(far < 1, 0.5 * dent * (1 + np.cos(np.pi * np.minimum(far, 1))), 0.0)
    away = radius - inwards + 0.25 * oval * np.cos(2 * angle) + 0.5 * taper * along + rng.normal(0, noise, points)
    shape = Cylinder(middle, direction, radius, height)
    u, v = axis_basis(shape.direction)
    radial = np.cos(angle)[:, None] * u + np.sin(angle)[:, None] * v
    place = shape.point + radius * (np.cos(1.0) * u + np.sin(1.0) * v) + 1.5 * shape.direction
    return shape.point + away[:, None] * radial + along[:, None] * shape.direction, shape, place
