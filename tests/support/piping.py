"""A result with piping of every kind, made by hand, so that all that is written of it is known."""

import numpy as np
from pydantic import TypeAdapter

from cylx.geometry.cylinder import Cylinder, canonical_direction
from cylx.results import ResultCylinder
from cylx.results.fittings import AnyFitting, ResultRun

ANY_FITTING = TypeAdapter(AnyFitting)
R = {0: 0.1, 1: 0.1, 2: 0.06, 3: 0.06, 4: 0.04, 5: 0.03, 6: 0.03, 7: 0.04, 8: 0.04, 9: 0.04, 10: 0.05, 11: 0.05,
     12: 0.2, 13: 0.08}  # fmt: skip
ASLANT = np.array([np.sqrt(0.75), 0.5, 0.0])  # 60 degrees from the y axis
TURNED = np.array([np.sqrt(0.5), np.sqrt(0.5), 0.0])
LAST = np.array([6.2, 5.0, -0.02])
PIPES = {
    0: ((0.05, 0, 0), (2, 0, 0)), 1: ((2.4, 0, 0), (4, 0, 0)), 2: ((4.3, 0, 0), (6, 0, 0)),
    3: ((6.2, 0.2, 0), (6.2, 3, 0)), 4: ((6.2, 1, 0.06), (6.2, 1, 2)),
    5: (np.array([6.2, 2, 0]) + 0.07 * ASLANT, np.array([6.2, 2, 0]) + ASLANT),
    6: (np.array([6.2, 2, 0]) - 0.07 * ASLANT, np.array([6.2, 2, 0]) - ASLANT),
    7: ((6.2, 3.2, -0.02), (6.2, 4.99, -0.02)), 8: (LAST + 0.01 * TURNED, LAST + TURNED),
    9: (LAST + 1.3 * TURNED, LAST + 2.3 * TURNED), 10: ((0, 5, 0), (2, 5, 0)), 11: ((0, 5.3, 0), (2, 5.3, 0)),
    12: ((0, 0, 3), (0.5, 0.5, 4)), 13: ((0, -3, 0), (4, -3, 0)),
}  # fmt: skip
"""Where each cylinder was seen: from, to."""
FITTINGS = [
    {"kind": "cap", "joins": {0: 0}, "center": (0, 0, 0), "axis": (-1, 0, 0), "radius": 0.1},
    {"kind": "inline", "joins": {0: 1, 1: 0}, "start": (2, 0, 0), "end": (2.4, 0, 0)},
    {"kind": "reducer", "joins": {1: 1, 2: 0}, "start": (4, 0, 0), "end": (4.3, 0, 0), "start_radius": 0.1,
     "end_radius": 0.06, "offset": 0.0, "concentric": True},
    {"kind": "flange", "joins": {2: None}, "center": (5, 0, 0), "axis": (1, 0, 0), "radius": 0.12, "thickness": 0.04,
     "pair": True},
    {"kind": "elbow", "joins": {2: 1, 3: 0}, "center": (6, 0.2, 0), "normal": (0, 0, 1), "bend_radius": 0.2,
     "angle_deg": 90.0, "radius": 0.06, "start": (6, 0, 0), "end": (6.2, 0.2, 0)},
    {"kind": "tee", "joins": {3: None, 4: 0}, "center": (6.2, 1, 0), "main": [3], "branches": [4], "angle_deg": 90.0},
    {"kind": "cross", "joins": {3: None, 5: 0, 6: 0}, "center": (6.2, 2, 0), "main": [3], "branches": [5, 6],
     "angle_deg": 60.0},
    {"kind": "reducer", "joins": {3: 1, 7: 0}, "start": (6.2, 3, 0), "end": (6.2, 3.2, -0.02), "start_radius": 0.06,
     "end_radius": 0.04, "offset": 0.02, "concentric": False},
    {"kind": "elbow", "joins": {7: 1, 8: 0}, "center": tuple(LAST), "normal": (0, 0, -1), "bend_radius": 0.0,
     "angle_deg": 45.0, "radius": 0.04, "start": tuple(LAST), "end": tuple(LAST)},
    {"kind": "joint", "joins": {8: 1, 9: 0}, "start": tuple(LAST + TURNED), "end": tuple(LAST + 1.3 * TURNED),
     "length": 0.3, "assumed": True},
    {"kind": "flange", "joins": {9: 1}, "center": tuple(LAST + 2.29 * TURNED), "axis": tuple(TURNED), "radius": 0.08,
     "thickness": 0.02, "pair": False},
    {"kind": "elbow", "joins": {10: 1, 11: 1}, "center": (2, 5.15, 0), "normal": (0, 0, 1), "bend_radius": 0.15,
     "angle_deg": 180.0, "radius": 0.05, "start": (2, 5, 0), "end": (2, 5.3, 0)},
    {"kind": "inline", "joins": {13: None}, "start": (1.48, -3, 0), "end": (2.52, -3, 0)},
    {"kind": "flange", "joins": {13: None}, "center": (1.5, -3, 0), "axis": (1, 0, 0), "radius": 0.15,
     "thickness": 0.04, "pair": True},
    {"kind": "flange", "joins": {13: None}, "center": (2.5, -3, 0), "axis": (1, 0, 0), "radius": 0.15,
     "thickness": 0.04, "pair": True},
]  # fmt: skip
"""What joins them; `joins` says at which end of the pair above, None for on it."""
RUNS = [([0, 1, 2, 3, 7, 8, 9, 6, 5, 4], range(11)), ([10, 11], [11]), ([13], [12, 13, 14]), ([12], [])]
PLACES, DIRECTIONS = ("center", "start", "end"), ("axis", "normal")


def one_sided(branch, main):
    """Give the volume that a branch from the middle of a main at right angles shares with it."""
    x = np.linspace(-1.0, 1.0, 20001)[1:-1] * branch
    return float(2 * np.trapezoid(np.sqrt(branch**2 - x**2) * np.sqrt(main**2 - x**2), x))


def disc(radius, length):
    return np.pi * radius**2 * length


def frustum(first, second, height):
    return np.pi * height / 3 * (first**2 + first * second + second**2)


BEYOND = 0.5
SIN60 = np.sqrt(0.75)
TEE_MAIN, TEE_BRANCH = (1 + BEYOND) * 0.04, 0.06 + BEYOND * 0.04
CROSS_MAIN, CROSS_BRANCH = ((0.03 + 0.03) / SIN60 + 0.015, (0.06 + 0.015) / SIN60 + 0.015)
LEG = 0.04 * np.tan(np.radians(22.5))
VOLUMES = {
    "cap 0": disc(0.1, 0.05), "inline 1": disc(0.1, 0.4), "reducer 2": frustum(0.1, 0.06, 0.3),
    "flange 3": disc(0.12, 0.04), "elbow 4": disc(0.06, 0.2 * np.pi / 2),
    "tee 5": disc(0.06, 2 * TEE_MAIN) + disc(0.04, TEE_BRANCH) - one_sided(0.04, 0.06),
    "cross 6": disc(0.06, 2 * CROSS_MAIN) + 2 * disc(0.03, CROSS_BRANCH) - 2 * one_sided(0.03, 0.06) / SIN60,
    "reducer 7": frustum(0.06, 0.04, 0.2), "elbow 8": disc(0.04, 2 * LEG), "joint 9": disc(0.04, 0.3),
    "flange 10": disc(0.08, 0.02), "elbow 11": disc(0.05, 0.15 * np.pi), "inline 12": disc(0.08, 0.96),
    "flange 13": disc(0.15, 0.04), "flange 14": disc(0.15, 0.04),
    "cylinder 0": disc(0.1, 1.95), "cylinder 1": disc(0.1, 1.6),
    "cylinder 2 piece 0": disc(0.06, 0.68), "cylinder 2 piece 1": disc(0.06, 0.98),
    "cylinder 3 piece 0": disc(0.06, 0.8 - TEE_MAIN), "cylinder 3 piece 1": disc(0.06, 1 - TEE_MAIN - CROSS_MAIN),
    "cylinder 3 piece 2": disc(0.06, 1 - CROSS_MAIN), "cylinder 4": disc(0.04, 2 - TEE_BRANCH),
    "cylinder 5": disc(0.03, 1 - CROSS_BRANCH), "cylinder 6": disc(0.03, 1 - CROSS_BRANCH),
    "cylinder 7": disc(0.04, 1.8 - LEG), "cylinder 8": disc(0.04, 1 - LEG), "cylinder 9": disc(0.04, 0.98),
    "cylinder 10": disc(0.05, 2), "cylinder 11": disc(0.05, 2), "cylinder 12": disc(0.2, np.sqrt(1.5)),
    "cylinder 13 piece 0": disc(0.08, 1.48), "cylinder 13 piece 1": disc(0.08, 1.48),
}  # fmt: skip
"""Volume of each part, in closed form."""
LINKS = 29


def piping(rotation=None, origin=(0, 0, 0), scale=1.0, jitter=0.0, rng=None):
    """Give the cylinders, fittings and runs, moved; with a jitter, the axes of the cylinders do not quite meet."""
    rotation = np.eye(3) if rotation is None else rotation

    def moved(point):
        return scale * (rotation @ np.asarray(point, float)) + origin

    cylinders = []
    for number, ends in PIPES.items():
        noise = np.zeros((2, 3)) if rng is None else rng.normal(0, jitter, (2, 3))
        first, last = (moved(np.asarray(end) + off) for end, off in zip(ends, noise, strict=True))
        shape = Cylinder(0.5 * (first + last), last - first, scale * R[number], float(np.linalg.norm(last - first)))
        vectors = {"axis_point": shape.point, "axis_direction": shape.direction, "start": shape.start, "end": shape.end}
        keys = {name: vector.tolist() for name, vector in vectors.items()}
        keys |= {"id": number, "radius": shape.radius, "height": shape.height, "inliers": 100, "rmse": 0.01}
        cylinders.append(
            ResultCylinder.model_validate({**keys, "support": 3, "coverage_deg": 180.0, "confidence": 0.9})
        )
    evidence = {"confidence": 0.8, "inliers": 50, "rms": 0.001, "coverage": 0.5, "std": {}}
    fittings = []
    for number, one in enumerate(FITTINGS):
        keys = {"id": number, **one, **evidence, "joins": list(one["joins"])}
        keys["ends"] = [name_of(rotation, pipe, end) for pipe, end in one["joins"].items()]
        keys |= {name: moved(keys[name]).tolist() for name in PLACES if name in keys}
        keys |= {name: (rotation @ np.array(keys[name])).tolist() for name in DIRECTIONS if name in keys}
        lengths = ("radius", "bend_radius", "thickness", "start_radius", "end_radius", "offset", "length")
        keys |= {name: scale * keys[name] for name in lengths if name in keys}
        fittings.append(ANY_FITTING.validate_python(keys))
    runs = [
        ResultRun.model_validate(
            {
                "id": k,
                "cylinders": pipes,
                "fittings": list(joined),
                "length": 1.0,
                "sizes": [],
                "open_ends": [],
                "loops": 0,
            }
        )
        for k, (pipes, joined) in enumerate(RUNS)
    ]
    return cylinders, fittings, runs


def name_of(rotation, pipe, end):
    """Give the name of an end of a pipe, as a cylinder has it: its direction goes by the sign of a component."""
    if end is None:
        return "side"
    first, last = (np.asarray(point, float) for point in PIPES[pipe])
    along = rotation @ (last - first)
    return "end" if (float(canonical_direction(along) @ along) > 0) == bool(end) else "start"
