"""A plot of a forest as scanners see it: stems with taper, lean and bark, branches, shrubs and ground.

Stems are not round, and thicken towards the ground. A terrestrial scanner stands at a few places, and sees the sides of
the stems that face it and that no other stem hides. A mobile one walks round and through the plot: it sees nearly all
sides, with a noise of centimetres.
"""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from cylx.geometry.arrays import FloatArray, MaskArray
from cylx.synthetic.plot import Plot, TrueStem
from cylx.synthetic.scene import demand

BREAST_HEIGHT = 1.3
HARMONICS = 12
"""Waves about a stem that its bark is made of."""
CLUTTER = -1
GROUND = -2


def forest(
    seed: int = 0,
    *,
    side: float = 20.0,
    stems_per_hectare: float = 700.0,
    scanner: Literal["terrestrial", "mobile"] = "terrestrial",
    stations: int = 4,
    slope: float = 0.2,
    shrubs_per_hectare: float = 400.0,
    spacing: float = 0.006,
) -> Plot:
    """Make a square plot of a forest.

    Parameters
    ----------
    seed : int
    side : float
        Metres.
    stems_per_hectare, shrubs_per_hectare : float
    scanner : {"terrestrial", "mobile"}
        Noise of 3 mm and few places, or of 20 to 30 mm and a path.
    stations : int
        Places of a terrestrial scanner.
    slope : float
        Of the ground, height per length.
    spacing : float
        Distance of points at 10 m from the scanner; a mobile one has four times as much.

    Returns
    -------
    Plot
        In metres, with a corner at the origin.

    Raises
    ------
    UsageError
        If a parameter is impossible.

    Examples
    --------
    >>> plot = forest(3, side=8.0, spacing=0.02)
    >>> len(plot.stems)
    5
    """
    params = {
        "side": side, "stems_per_hectare": stems_per_hectare, "scanner": scanner, "stations": stations, "slope": slope,
        "shrubs_per_hectare": shrubs_per_hectare, "spacing": spacing,
    }  # fmt: skip
    _check(side, stems_per_hectare, shrubs_per_hectare, scanner, stations, slope, spacing)
    rng = np.random.default_rng(seed)
    ground = _Terrain(rng, slope)
    feet = _scattered(rng, side, stems_per_hectare * side * side / 1e4, 1.0)
    trees = [_Tree(rng, foot) for foot in feet]
    mobile = scanner == "mobile"
    eyes = _path(side) if mobile else _stations(rng, side, stations, feet)
    discs = np.array([[*tree.center(BREAST_HEIGHT), 0.5 * tree.dbh] for tree in trees]).reshape(-1, 3)
    density = (1.0 / spacing) ** 2 / (16.0 if mobile else 1.0)
    parts: list[tuple[FloatArray, int]] = []
    stems = []
    for k, tree in enumerate(trees):
        seen, angles = _seen_of(rng, tree, eyes, discs, k, density)
        height = float(ground.at(tree.foot[None])[0])
        at_breast = np.abs(seen[:, 2] - BREAST_HEIGHT) < 0.3
        sectors = np.unique(((angles[at_breast] + math.pi) / (2.0 * math.pi) * 72).astype(np.int64))
        arc = len(sectors) / 72 * 2.0 * math.pi
        x, y = map(float, tree.foot)
        stems.append(TrueStem(x, y, height, tree.dbh, tree.lean, tree.height, arc))
        lift = np.array([0.0, 0.0, height])
        parts.append((seen + lift, k))
        parts.extend((piece + lift, CLUTTER) for piece in tree.crown(rng, mobile))
    for shrub in _scattered(rng, side, shrubs_per_hectare * side * side / 1e4, 0.2):
        parts.append((_shrub(rng, shrub, ground, mobile), CLUTTER))
    parts.append((_floor(rng, side, ground, mobile), GROUND))
    points = np.concatenate([part for part, _ in parts])
    labels = np.repeat([label for _, label in parts], [len(part) for part, _ in parts])
    noise = rng.uniform(0.02, 0.03) if mobile else 0.003
    points = points + rng.normal(0.0, noise, points.shape)
    inside = (np.abs(points[:, :2] - 0.5 * side) < 0.5 * side + 1.0).all(axis=1)
    return Plot(points[inside], labels[inside], tuple(stems), seed, params)


def _check(side: float, stems: float, shrubs: float, scanner: str, stations: int, slope: float, spacing: float) -> None:
    """Refuse what is no plot, or one of too many points."""
    demand(2.0 <= side <= 200.0, "side", f"must be 2 to 200 m, not {side}")
    demand(0.0 <= stems <= 5000.0, "stems_per_hectare", f"must be 0 to 5000, not {stems}")
    demand(0.0 <= shrubs <= 10000.0, "shrubs_per_hectare", f"must be 0 to 10000, not {shrubs}")
    demand(scanner in {"terrestrial", "mobile"}, "scanner", f"must be terrestrial or mobile, not {scanner}")
    demand(1 <= stations <= 100, "stations", f"must be 1 to 100, not {stations}")
    demand(0.0 <= slope <= 1.5, "slope", f"must be 0 to 1.5, not {slope}")
    demand(0.001 <= spacing <= 0.1, "spacing", f"must be 0.001 to 0.1 m, not {spacing}")


class _Terrain:
    """Sloping ground with hollows and humps."""

    def __init__(self, rng: np.random.Generator, slope: float) -> None:
        turn = rng.uniform(0.0, 2.0 * math.pi)
        self.plane = slope * np.array([math.cos(turn), math.sin(turn)])
        self.waves = rng.normal(0.0, 1.0, (6, 2)) * 2.0 * math.pi / rng.uniform(6.0, 25.0, (6, 1)) / 1.4
        self.phases = rng.uniform(0.0, 2.0 * math.pi, 6)

    def at(self, xy: FloatArray) -> FloatArray:
        """Return the height at places (n, 2)."""
        return np.asarray(xy @ self.plane + 0.12 * np.sin(xy @ self.waves.T + self.phases).sum(axis=1))


class _Tree:
    """A stem whose radius is a function of height and angle, about an axis that leans and bows."""

    def __init__(self, rng: np.random.Generator, foot: FloatArray) -> None:
        self.foot = foot
        self.dbh = float(np.clip(rng.lognormal(math.log(0.24), 0.45), 0.07, 0.7))
        self.height = float(min(rng.uniform(6.0, 12.0), 30.0 * self.dbh + 2.0))
        self.taper = float(rng.uniform(0.4, 0.9)) * self.dbh / 25.0 / 0.6
        self.swell = float(rng.uniform(0.0, 0.12))
        self.tilt = rng.normal(0.0, 0.025, 2) * (3.0 if rng.random() < 0.1 else 1.0)
        self.bow = rng.normal(0.0, 0.002, 2)
        n = np.arange(2, 2 + HARMONICS)
        size = 0.009 / (n - 1.0)
        self.cosines, self.sines = rng.normal(0.0, size), rng.normal(0.0, size)
        self.drift = rng.normal(0.0, 0.25, HARMONICS)
        self.bark = float(rng.uniform(0.002, 0.012))
        self.grain = rng.normal(0.0, 1.0, (12, 3)) * [9.0, 6.0, 0.0] + [0.0, 0.0, 1.0]
        self.phases = rng.uniform(0.0, 2.0 * math.pi, 12)
        self.lean = float(math.atan(np.linalg.norm(self.tilt + 2.0 * self.bow * BREAST_HEIGHT)))

    def center(self, z: FloatArray | float) -> FloatArray:
        """Return the axis at heights above its foot, shape (..., 2)."""
        heights = np.asarray(z, dtype=np.float64)[..., None]
        return np.asarray(self.foot + heights * self.tilt + heights**2 * self.bow)

    def radius(self, z: FloatArray, angle: FloatArray) -> FloatArray:
        """Return the distance of the bark from the axis."""
        mean = 0.5 * self.dbh - 0.5 * self.taper * (z - BREAST_HEIGHT)
        mean = mean + 0.5 * self.dbh * self.swell * (np.exp(-z / 0.35) - math.exp(-BREAST_HEIGHT / 0.35))
        out = np.ones_like(z)
        for k in range(HARMONICS):
            phase = (k + 2) * (angle + self.drift[k] * z / (k + 2))
            out += self.cosines[k] * np.cos(phase) + self.sines[k] * np.sin(phase)
        rough = sum(np.sin(round(g[0]) * angle + g[1] * z + p) for g, p in zip(self.grain, self.phases, strict=True))
        return np.maximum(mean, 0.015) * (out + self.bark * np.asarray(rough) / 2.5)

    def crown(self, rng: np.random.Generator, mobile: bool) -> list[FloatArray]:
        """Return the points of branches and leaves, heights above the foot."""
        out = []
        share = 0.25 if mobile else 1.0
        for _ in range(rng.integers(6, 25)):
            z = float(rng.uniform(1.0 if rng.random() < 0.2 else 3.0, self.height))
            turn, length = rng.uniform(0.0, 2.0 * math.pi), float(rng.uniform(0.3, 2.0))
            along = np.array([math.cos(turn), math.sin(turn), rng.uniform(-0.4, 0.6)])
            t = rng.uniform(0.0, length, max(4, int(600 * share * length)))
            start = np.array([*self.center(z), z])
            out.append(start + t[:, None] * along + rng.normal(0.0, 0.008, (len(t), 3)))
            leaves = rng.normal(0.0, 0.25, (int(rng.integers(0, 900) * share), 3))
            out.append(start + length * along + leaves)
        return out


def _scattered(rng: np.random.Generator, side: float, count: float, apart: float) -> FloatArray:
    """Return places (n, 2) in a square, at least so far apart."""
    places: list[FloatArray] = []
    for _ in range(20 * int(count)):
        place = rng.uniform(0.0, side, 2)
        if all(np.hypot(*(place - other)) > apart for other in places):
            places.append(place)
        if len(places) >= count:
            break
    return np.array(places).reshape(-1, 2)


def _stations(rng: np.random.Generator, side: float, count: int, feet: FloatArray) -> FloatArray:
    """Return places of a scanner (n, 2), spread over the plot, away from stems."""
    out: list[FloatArray] = []
    for k in range(count):
        turn = 2.0 * math.pi * k / max(count, 1)
        middle = np.full(2, 0.5 * side) + (0.35 * side * np.array([math.cos(turn), math.sin(turn)]) if count > 1 else 0)
        tries = middle + rng.normal(0.0, 0.06 * side, (50, 2))
        away = np.hypot(*(tries[:, None] - feet[None]).transpose(2, 0, 1)).min(axis=1, initial=9.0)
        out.append(tries[int(np.argmax(away > 1.0))])
    return np.array(out)


def _path(side: float) -> FloatArray:
    """Return the places of a mobile scanner: lanes through the plot, and about it."""
    lanes = np.arange(-2.0, side + 2.1, 6.0)
    steps = np.arange(-2.0, side + 2.1, 3.0)
    return np.array([[x, y] for x in lanes for y in steps])


def _seen_of(
    rng: np.random.Generator, tree: _Tree, eyes: FloatArray, discs: FloatArray, own: int, density: float
) -> tuple[FloatArray, FloatArray]:
    """Return the points of a stem that scanners see, heights above its foot, and their angles."""
    places, turns = [np.empty((0, 3))], [np.empty(0)]
    others = np.delete(discs, own, axis=0)
    for eye in eyes:
        away = float(np.hypot(*(tree.foot - eye)))
        if away > 30.0 or away < 0.5 * tree.dbh + 0.05:
            continue
        many = density * (10.0 / max(away, 3.0)) ** 2 * math.pi * tree.dbh * tree.height / len(eyes) ** 0.5
        n = int(min(many, 60000))
        z, angle = rng.uniform(0.0, tree.height, n), rng.uniform(-math.pi, math.pi, n)
        outward = np.column_stack([np.cos(angle), np.sin(angle)])
        place = tree.center(z) + tree.radius(z, angle)[:, None] * outward
        ray = eye - place
        facing = np.einsum("ij,ij->i", ray, outward) / np.hypot(*ray.T)
        keep = (facing > 0.12) & (rng.random(n) < facing) & ~_hidden(place, eye, others)
        places.append(np.column_stack([place, z])[keep])
        turns.append(angle[keep])
    return np.concatenate(places), np.concatenate(turns)


def _hidden(places: FloatArray, eye: FloatArray, discs: FloatArray) -> MaskArray:
    """Return which places (n, 2) are behind a disc, seen from an eye."""
    out = np.zeros(len(places), dtype=np.bool_)
    rays = places - eye
    length = np.hypot(*rays.T)
    for x, y, r in discs:
        to = np.array([x, y]) - eye
        along = rays @ to / length
        across = np.abs(rays[:, 0] * to[1] - rays[:, 1] * to[0]) / length
        out |= (across < r) & (along > 0.0) & (along < length)
    return out


def _shrub(rng: np.random.Generator, foot: FloatArray, ground: _Terrain, mobile: bool) -> FloatArray:
    """Return the points of a shrub: twigs from one foot, and leaves."""
    height, wide = float(rng.uniform(0.4, 2.2)), float(rng.uniform(0.2, 0.9))
    z0 = float(ground.at(foot[None])[0])
    parts = []
    for _ in range(rng.integers(8, 30)):
        tip = np.array([*rng.normal(0.0, 0.5 * wide, 2), height * rng.uniform(0.5, 1.0)])
        t = rng.uniform(0.0, 1.0, 40 if mobile else 160)
        parts.append(t[:, None] * tip + rng.normal(0.0, 0.01, (len(t), 3)))
        parts.append(tip * rng.uniform(0.6, 1.0) + rng.normal(0.0, 0.08, (20 if mobile else 80, 3)))
    return np.asarray(np.concatenate(parts) + np.array([*foot, z0]))


def _floor(rng: np.random.Generator, side: float, ground: _Terrain, mobile: bool) -> FloatArray:
    """Return the points of ground and herbs."""
    n = int((side + 2.0) ** 2 * (150 if mobile else 500))
    xy = rng.uniform(-1.0, side + 1.0, (n, 2))
    herbs = np.where(rng.random(n) < 0.3, rng.exponential(0.08, n), 0.0)
    return np.column_stack([xy, ground.at(xy) + herbs + rng.normal(0.0, 0.01, n)])
