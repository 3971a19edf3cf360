"""Documents to judge: cylinders as a result or a truth lists them."""

import math

import numpy as np


def cylinder(point=(0, 0, 0), direction=(0, 0, 1), radius=1.0, height=4.0, **more):
    entry = {"axis_point": list(point), "axis_direction": list(direction), "radius": radius, "height": height}
    return {**entry, **more}


def document(*cylinders):
    return {"cylinders": [{"id": i, **entry} for i, entry in enumerate(cylinders)]}


def tilted(angle_deg):
    return (math.sin(math.radians(angle_deg)), 0.0, math.cos(math.radians(angle_deg)))


def random_documents(seed):
    """Give a truth and a result that is partly right: duplicates, false ones, wrong ones, ignored ones."""
    rng = np.random.default_rng(seed)
    true, found = [], []
    for _ in range(rng.integers(0, 12)):
        entry = cylinder(rng.uniform(-3, 3, 3), rng.standard_normal(3), float(rng.uniform(0.3, 2)))
        true.append({**entry, "ignore": bool(rng.random() < 0.3)})
        for _ in range(rng.integers(0, 3)):
            step = rng.uniform(0, 1.3)
            point = np.array(entry["axis_point"]) + 0.25 * step * entry["radius"] * rng.standard_normal(3)
            direction = np.array(entry["axis_direction"]) + 0.05 * step * rng.standard_normal(3)
            found.append(cylinder(point, direction, entry["radius"] * float(1 + 0.1 * step * rng.standard_normal())))
    for _ in range(rng.integers(0, 4)):
        found.append(cylinder(rng.uniform(-3, 3, 3), rng.standard_normal(3), float(rng.choice([0.5, math.nan]))))
    order = rng.permutation(len(found))
    return document(*true), document(*(found[i] for i in order))
