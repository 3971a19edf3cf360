"""Supports: small blocks below level pipes."""

from __future__ import annotations

import numpy as np

from cylx.synthetic.plant.layout import Layout
from cylx.synthetic.plant.surfaces import Block

_LEVEL = 0.02
_SHARE = 0.6  # of the level stretches that are long enough


def supports(rng: np.random.Generator, layout: Layout) -> list[Block]:
    """Return blocks that touch level pipes from below, where nothing else is."""
    found = []
    for straight in layout.straights:
        radius = straight.size.radius
        if abs(straight.direction[2]) > _LEVEL:
            continue
        for low, high in straight.bare():
            along = float(rng.uniform(0.06, 0.12))
            if high - low < along + 4 * radius or rng.random() > _SHARE:
                continue
            sides = np.array([along, 1.6 * radius, float(rng.uniform(0.05, 0.12))])
            top = straight.at(rng.uniform(low + 0.5 * along + radius, high - 0.5 * along - radius))
            center = top - np.array([0.0, 0.0, radius + 0.5 * sides[2]])
            reach = 0.5 * float(np.linalg.norm(sides))
            touched = layout.space.parts_at(top)
            if layout.space.inside(center, center, reach) and layout.space.free(center, center, reach, touched):
                level = straight.direction - np.array([0.0, 0.0, straight.direction[2]])
                level /= np.linalg.norm(level)
                turn = np.column_stack([level, np.cross([0.0, 0.0, 1.0], level), [0.0, 0.0, 1.0]])
                found.append(Block(center, sides, turn))
                layout.space.add(center, center, reach, -2)
    return found
