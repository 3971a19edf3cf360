"""A room with runs of pipes and all their fittings, scanned from a few places."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from cylx.geometry.arrays import FloatArray
from cylx.geometry.cylinder import Cylinder
from cylx.synthetic.plant.fittings import insulation_surfaces
from cylx.synthetic.plant.layout import Layout
from cylx.synthetic.plant.scan import Drawn, Item, draw
from cylx.synthetic.plant.space import Space
from cylx.synthetic.plant.supports import supports
from cylx.synthetic.plant.surfaces import Face, Revolved, pipe
from cylx.synthetic.runs import TrueFitting, TrueRun
from cylx.synthetic.scene import NOISE, OTHER_SURFACE, SyntheticScene, TrueCylinder, demand, true_cylinder

_ROOM = np.array([5.0, 4.0, 3.0])  # metres, for five runs
_RUNS_A_ROOM = 5
_POINTS_A_RUN = 50000
_BERTH = 0.35  # nothing is closer to a scanner, metres
_MIN_POINTS, _MIN_SEEN = 30, 0.15  # a fitting with fewer points, or a smaller part seen, need not be found


def piping(
    *,
    points: int | None = None,
    runs: int = 5,
    scanners: int = 4,
    planes: int = 2,
    noise: float = 0.01,
    sigma: float = 0.002,
    seed: int = 0,
) -> SyntheticScene:
    """Make a room with runs of pipes, seen from one side or from two as scanners see it.

    Lengths are metres, sizes DN40 to DN300. Each run is a line of straights with elbows and reducers between them, with
    flanges, valves, insulation, tees, crosses and gaps on them, caps or open ends, and supports below. A point is there
    if the ray to at least one scanner meets nothing on its way.

    Parameters
    ----------
    points : int, optional
        Number of points, noise included, > 0; 50 000 a run by default.
    runs : int
        Number of connected runs, > 0; the room grows with it.
    scanners : int
        Number of places it is seen from, 1 to 8: the corners of the room, then the middles of its sides.
    planes : int
        0 to 6: the floor, then four walls, then the ceiling.
    noise : float
        Share of the points that are uniform in the room, in [0, 1).
    sigma : float
        Standard deviation of the other points about their surface, each coordinate, metres, >= 0.
    seed : int
        Random seed, >= 0.

    Raises
    ------
    UsageError
        If a parameter is out of its range.

    Examples
    --------
    >>> scene = piping(points=20000, runs=2, seed=1)
    >>> len(scene.points), len(scene.runs)
    (20000, 2)
    """
    total = _POINTS_A_RUN * runs if points is None else points
    demand(runs > 0, "runs", f"must be > 0, not {runs}")
    demand(total > 0, "points", f"must be > 0, not {total}")
    demand(1 <= scanners <= 8, "scanners", f"must be 1 to 8, not {scanners}")
    demand(0 <= planes <= 6, "planes", f"must be 0 to 6, not {planes}")
    demand(0 <= noise < 1, "noise", f"must be in [0, 1), not {noise}")
    demand(0 <= sigma < np.inf, "sigma", f"must be >= 0, not {sigma}")
    demand(seed >= 0, "seed", f"must be >= 0, not {seed}")
    rng = np.random.default_rng(seed)
    size = room_size(runs)
    views = scanner_places(size)[:scanners]
    layout = Layout(rng, Space(size, views, _BERTH))
    layout.build(runs)
    items, shapes = _items(rng, layout, size, planes)
    drawn, chosen = draw(rng, items, layout, views, total - round(noise * total))
    order = rng.permutation(total)
    scattered = size * rng.random((total - len(chosen), 3))
    clean = drawn.points[chosen]
    nobody = np.full(len(scattered), NOISE, dtype=np.int32)
    cylinders = _true_cylinders(layout, shapes, clean, drawn.cylinders[chosen])
    labels = np.concatenate([drawn.cylinders[chosen], nobody])
    fitting_labels = np.concatenate([drawn.fittings[chosen], np.full_like(nobody, OTHER_SURFACE)])
    return SyntheticScene(
        points=np.concatenate([clean + sigma * rng.standard_normal(clean.shape), scattered])[order],
        labels=labels[order],
        cylinders=cylinders,
        sigma=float(sigma),
        family="piping",
        seed=int(seed),
        params={"points": total, "runs": runs, "scanners": scanners, "planes": planes, "noise": noise},
        fittings=_true_fittings(layout, drawn, chosen, cylinders),
        runs=tuple(_true_run(layout, run) for run in range(runs)),
        fitting_labels=fitting_labels[order],
    )


def room_size(runs: int) -> FloatArray:
    """Return the corner of the room opposite to the origin, metres; shape (3,)."""
    return np.asarray(_ROOM * max(1.0, runs / _RUNS_A_ROOM) ** (1 / 3))


def scanner_places(size: FloatArray) -> FloatArray:
    """Return the places of scanners in a room, metres: its corners, then the middles of its sides; shape (8, 3)."""
    (x, y, _), inset = size, 0.4
    sides = [(0, 0), (1, 1), (1, 0), (0, 1), (0.5, 0), (0.5, 1), (0, 0.5), (1, 0.5)]
    return np.array([(inset + (x - 2 * inset) * a, inset + (y - 2 * inset) * b, 1.7) for a, b in sides])


def _items(
    rng: np.random.Generator, layout: Layout, size: FloatArray, planes: int
) -> tuple[list[Item], list[tuple[Cylinder, dict[str, int]]]]:
    """Return all surfaces, and all cylinders among them with what they belong to."""
    items: list[Item] = []
    shapes: list[tuple[Cylinder, dict[str, int]]] = []

    def add(mantle: Revolved, of: dict[str, int], fitting: int = -1, root: float = 0.0, missing: bool = False) -> None:
        items.append(Item(mantle, len(shapes), fitting, missing))
        middle = mantle.base + 0.5 * (root + mantle.high) * mantle.direction
        shapes.append((Cylinder(middle, mantle.direction, mantle.radius, mantle.high - root), of))

    for straight in layout.straights:
        add(pipe(straight.start, straight.end, straight.size.radius), {"run": straight.run}, root=straight.root)
    for index, mantle in layout.insulation:
        _, *rings = insulation_surfaces(mantle, layout.straights[index].size.radius)
        items += [Item(ring) for ring in rings]
        add(mantle, {"insulates": index})
    for index, joining in enumerate(layout.joinings):
        for surface in joining.surfaces:
            if joining.kind == "flange" and isinstance(surface, Revolved):
                add(surface, {"part_of": index}, index)
            else:
                items.append(Item(surface, -1, index, joining.missing))
    items += [Item(block) for block in supports(rng, layout)]
    x, y, z = size
    sides = [(2, 0.0), (1, 0.0), (0, 0.0), (1, y), (0, x), (2, z)]
    return items + [Item(Face(size, axis, level)) for axis, level in sides[:planes]], shapes


def _true_cylinders(
    layout: Layout, shapes: list[tuple[Cylinder, dict[str, int]]], clean: FloatArray, labels: NDArray[np.int32]
) -> tuple[TrueCylinder, ...]:
    """Return the truth of the straights, then of insulation, then of the rims of flanges."""
    order = np.argsort(labels, kind="stable")
    bounds = np.searchsorted(labels[order], np.arange(len(shapes) + 1))
    found = []
    for index, (shape, of) in enumerate(shapes):
        true = true_cylinder(shape, clean[order[bounds[index] : bounds[index + 1]]])
        if index < len(layout.straights):
            straight = layout.straights[index]
            pieces = np.array([[straight.at(low), straight.at(high)] for low, high in straight.bare()])
            true = replace(true, pieces=pieces.reshape(-1, 2, 3))
        found.append(replace(true, of=of, ignore=true.ignore or "part_of" in of))
    return tuple(found)


def _true_fittings(
    layout: Layout, drawn: Drawn, chosen: NDArray[np.int64], cylinders: tuple[TrueCylinder, ...]
) -> tuple[TrueFitting, ...]:
    """Return the truth of the fittings, with how well they are seen."""
    n = len(layout.joinings)
    present = np.bincount(drawn.fittings[chosen] + 1, minlength=n + 1)[1:]
    outside = np.bincount(drawn.fittings + 1, minlength=n + 1)[1:]
    visible = np.bincount(drawn.fittings[drawn.seen] + 1, minlength=n + 1)[1:]
    found = []
    for index, joining in enumerate(layout.joinings):
        seen = float(visible[index]) / max(int(outside[index]), 1)
        hardly = present[index] < _MIN_POINTS or seen < _MIN_SEEN
        loose = any(cylinders[joined].points < _MIN_POINTS for joined in joining.joins)
        found.append(
            TrueFitting(
                joining.kind,
                tuple(joining.joins),
                joining.run,
                joining.geometry,
                int(present[index]),
                seen,
                bool(hardly or loose or joining.part_of is not None or joining.kind == "joint"),
                joining.part_of,
            )
        )
    return tuple(found)


def _true_run(layout: Layout, run: int) -> TrueRun:
    straights = [index for index, straight in enumerate(layout.straights) if straight.run == run]
    fittings = [index for index, joining in enumerate(layout.joinings) if joining.run == run]
    length = sum(layout.straights[index].length for index in straights)
    length += sum(layout.joinings[index].length for index in fittings)
    ends = tuple((end.cylinder, end.point, end.reason) for end in layout.ends if end.run == run)
    return TrueRun(tuple(straights), tuple(fittings), float(length), ends)
