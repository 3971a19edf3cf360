"""Figures cut down, outcomes and scans made up."""

import numpy as np

from cylx.experiments import (
    FIGURES,
    ObjectScan,
    Outcome,
)
from cylx.geometry.cylinder import Cylinder
from cylx.synthetic.surfaces import Mantle

NAN = float("nan")

UNIT = (("points", 1500), ("height", 4.0), ("sigma", 0.01), ("sigma_o", 0.04), ("p", 0.1))


def cut_down(number, *, cells=2, points=1500):
    """Give a figure with a few cells of few points."""
    figure = FIGURES[number]
    chosen = [cell._replace(scene=tuple({**dict(cell.scene), "points": points}.items())) for cell in figure.cells]
    return figure._replace(cells=tuple(chosen[:cells]))


def outcome(found=2, angle=0.5, offset=0.25, radius=1.5, seconds=2.0):
    return Outcome(found, angle, offset, radius, seconds)


def can_scan(points, seed=0):
    """Scan a can of 33 mm radius and 100 mm height, in metres, away from the origin."""
    rng = np.random.default_rng(seed)
    mantle = Mantle(Cylinder((0.2, -0.1, 0.05), (0, 0, 1), 0.033, 0.1), 0.0, 2 * np.pi).sample(rng, points)
    return ObjectScan.of(mantle, None)
