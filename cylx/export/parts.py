"""The parts of piping to write: straights and fittings with their solids and ports, and what these are joined with."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from cylx.export.claims import bend_of, elbow_of
from cylx.export.layout import TINY, Key, Layout, Port, lay_out
from cylx.export.solids import Cone, Mitre, Solid, unit
from cylx.geometry.arrays import FloatArray
from cylx.geometry.cylinder import cylinder_between
from cylx.results import ResultCylinder
from cylx.results.fittings import (
    AnyFitting,
    ResultCross,
    ResultElbow,
    ResultFlange,
    ResultReducer,
    ResultRun,
    ResultTee,
)

Color = tuple[int, int, int]
Path = tuple[FloatArray, ...]
GREY: Color = (150, 150, 150)
"""Colour of the fittings."""


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """A straight or a fitting.

    Parameters
    ----------
    name : str
        Its name in formats with names.
    color : tuple of int
        Red, green and blue, 0 to 255.
    solids : tuple of solid
        Together they are its body; none if it has no length.
    lines : tuple of tuple of ndarray of shape (3,)
        Its centre lines as places to go through, scene units; that of a bend is the arc of its solid.
    ports : tuple of Port
        Of a straight: its start and its end. Of a junction: those of the main, then those of the branches.
    cylinder : ResultCylinder or None
        What it is a piece of.
    fitting : fitting or None
        What it is.
    """

    name: str
    color: Color
    solids: tuple[Solid, ...]
    lines: tuple[Path, ...]
    ports: tuple[Port, ...]
    cylinder: ResultCylinder | None = None
    fitting: AnyFitting | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Piping:
    """The straights and fittings of a result.

    Parameters
    ----------
    parts : tuple of Part
    links : tuple of pair of pair of int
        Ports that are joined: number of the part, and of its port.
    systems : tuple of tuple of int
        Numbers of the parts of each run, in their order along it.
    names : tuple of str
        Of the runs.
    bores : dict of int to float
        Diameter of each cylinder, one for all of a size in a run, scene units.
    """

    parts: tuple[Part, ...]
    links: tuple[tuple[tuple[int, int], tuple[int, int]], ...]
    systems: tuple[tuple[int, ...], ...]
    names: tuple[str, ...]
    bores: dict[int, float]

    @property
    def fittings(self) -> int:
        """Number of fittings."""
        return sum(part.fitting is not None for part in self.parts)


def piping_of(
    cylinders: Sequence[ResultCylinder],
    colors: Sequence[Color],
    fittings: Sequence[AnyFitting],
    runs: Sequence[ResultRun],
) -> Piping:
    """Make the parts of piping.

    Parameters
    ----------
    cylinders : sequence of ResultCylinder
    colors : sequence of tuple of int
        Of the cylinders.
    fittings : sequence of fittings
        Those whose cylinders are not all there are left out.
    runs : sequence of ResultRun
        Cylinders in none of them are runs of their own.
    """
    layout = lay_out(cylinders, fittings)
    by_id = {one.id: (one, color) for one, color in zip(cylinders, colors, strict=True)}
    found_by_id = {one.id: one for one in cylinders}
    parts: list[Part] = []
    links: list[tuple[tuple[int, int], tuple[int, int]]] = []
    where: dict[Key, tuple[int, int]] = {}
    of_cylinder: dict[int, list[int]] = {}
    of_fitting: dict[int, int] = {}
    keys: dict[int, list[Key]] = {}
    for key in layout.ports:
        keys.setdefault(key[0], []).append(key)
    for number, fitting in sorted(layout.fittings.items()):
        if number in keys:
            own = sorted(keys[number], key=lambda key, joins=fitting.joins: (joins.index(key[1]), key[2] == "high"))  # type: ignore[misc]  # a default binds the loop's value
            where |= {key: (len(parts), k) for k, key in enumerate(own)}
            of_fitting[number] = len(parts)
            parts.append(_fitting(fitting, own, layout, elbow_of(fitting, found_by_id)))
    counts: dict[int, int] = {}
    for straight in layout.straights:
        counts[straight.cylinder] = counts.get(straight.cylinder, 0) + 1
    for straight in layout.straights:
        found, color = by_id[straight.cylinder]
        pieces = of_cylinder.setdefault(found.id, [])
        name = f"cylinder {found.id}" + (f" piece {len(pieces)}" if counts[found.id] > 1 else "")
        u = unit(straight.end - straight.start, layout.directions[found.id])
        ports = Port(straight.start, -u, found.radius), Port(straight.end, u, found.radius)
        rod = cylinder_between(straight.start, straight.end, found.radius)
        for k, hold in enumerate(straight.holds):
            if hold is not None:
                links.append((where[hold], (len(parts), k)))
        pieces.append(len(parts))
        parts.append(Part(name, color, (rod,), ((straight.start, straight.end),), ports, found))
    links += [(where[first], where[second]) for first, second in layout.links]
    near: dict[int, dict[int, int]] = {k: {} for k in range(len(parts))}
    for (one, port), (other, its) in links:
        near[one][port], near[other][its] = other, one
    names, systems = _systems(cylinders, runs, of_cylinder, of_fitting, near)
    return Piping(tuple(parts), tuple(links), systems, names, _bores(cylinders, runs))


def _fitting(fitting: AnyFitting, keys: Sequence[Key], layout: Layout, elbow: ResultElbow | None) -> Part:
    """Make the part of a fitting, or of the elbow it is drawn as, from its ports."""
    ports = tuple(layout.ports[key] for key in keys)
    lines: tuple[Path, ...] = ((ports[0].place, ports[-1].place),)
    solids: Iterable[Solid | None]
    if elbow is not None:
        bend = bend_of(elbow)
        if bend is not None:
            solids = (bend,)
            lines = ((bend.start, bend.at(0.5 * bend.angle), bend.at(bend.angle)),)
        else:
            solids, lines = _mitre(elbow, ports)
    elif isinstance(fitting, ResultTee | ResultCross):
        solids, lines = _junction(fitting, keys, layout)
    elif isinstance(fitting, ResultReducer):
        solids = (_cone(fitting, ports),)
    elif isinstance(fitting, ResultFlange):
        solids, lines = _disc(fitting, ports)
    elif len(ports) == 1:  # a cap
        end = np.array(fitting.center) if hasattr(fitting, "center") else ports[0].place
        lines = ((ports[0].place, end),)
        solids = (_rod(ports[0].place, end, ports[0].radius),)
    else:
        solids = (_rod(ports[0].place, ports[1].place, max(port.radius for port in ports)),)
    body = tuple(solid for solid in solids if solid is not None)
    return Part(f"{fitting.kind} {fitting.id}", GREY, body, lines, ports, fitting=fitting)


def _rod(start: FloatArray, end: FloatArray, radius: float) -> Solid | None:
    """Return a rod; None if it has no length."""
    return cylinder_between(start, end, radius) if np.linalg.norm(end - start) > TINY * radius else None


def _mitre(elbow: ResultElbow, ports: Sequence[Port]) -> tuple[tuple[Solid | None, ...], tuple[Path, ...]]:
    """Return the solid and the line of an elbow without a torus."""
    (first, second), radius = ports, elbow.radius
    # the corner is where the lines of both pipes go, which are their ports' directions backwards
    turn = float(np.arccos(np.clip(-first.outward @ second.outward, -1.0, 1.0)))
    apart = float(np.linalg.norm(second.place - first.place))
    if apart <= TINY * radius or turn < 1e-6 or turn > np.pi - 0.1:
        return (_rod(first.place, second.place, radius),), ((first.place, second.place),)
    reach = 0.5 * apart / np.cos(0.5 * turn)
    corner = 0.5 * (first.place - reach * first.outward + second.place - reach * second.outward)
    return (Mitre(first.place, corner, second.place, radius),), ((first.place, corner, second.place),)


def _junction(
    fitting: ResultTee | ResultCross, keys: Sequence[Key], layout: Layout
) -> tuple[tuple[Solid | None, ...], tuple[Path, ...]]:
    """Return a rod along the main and one along each branch, and their lines."""
    mains, branches = ports_of(fitting, keys, layout)
    center = mains[0].place
    if len(mains) == 2:
        along = mains[1].place - mains[0].place
        share = float((np.array(fitting.center) - mains[0].place) @ along) / max(float(along @ along), 1e-300)
        center = mains[0].place + np.clip(share, 0.0, 1.0) * along
    solids = [_rod(mains[0].place, mains[-1].place, max(port.radius for port in mains))]
    solids += [_rod(center, port.place, port.radius) for port in branches]
    return tuple(solids), ((mains[0].place, center, mains[-1].place), *((center, port.place) for port in branches))


def ports_of(fitting: ResultTee | ResultCross, keys: Sequence[Key], layout: Layout) -> tuple[list[Port], list[Port]]:
    """Return the ports of the main of a junction, and those of its branches."""
    mains = [layout.ports[key] for key in keys if key[1] in fitting.main]
    return mains, [layout.ports[key] for key in keys if key[1] not in fitting.main]


def _cone(reducer: ResultReducer, ports: Sequence[Port]) -> Solid | None:
    """Return the cone of a reducer."""
    away = ports[1].place - ports[0].place
    axis = unit(away, ports[0].outward)
    if not reducer.concentric:
        axis = unit(ports[1].outward - ports[0].outward, axis)
    if away @ axis <= TINY * min(reducer.start_radius, reducer.end_radius):
        return None
    return Cone(ports[0].place, ports[1].place, axis, reducer.start_radius, reducer.end_radius)


def _disc(flange: ResultFlange, ports: Sequence[Port]) -> tuple[tuple[Solid | None, ...], tuple[Path, ...]]:
    """Return the disc of a flange."""
    start = ports[0].place
    end = ports[1].place if len(ports) > 1 else start - flange.thickness * ports[0].outward
    return (_rod(start, end, flange.radius),), ((start, end),)


def _systems(
    cylinders: Sequence[ResultCylinder],
    runs: Sequence[ResultRun],
    of_cylinder: dict[int, list[int]],
    of_fitting: dict[int, int],
    near: dict[int, dict[int, int]],
) -> tuple[tuple[str, ...], tuple[tuple[int, ...], ...]]:
    """Return the names of the runs and their parts, in the order of a walk; each part is in one of them."""
    names, systems, seen = [], [], set[int]()
    alone = [(f"cylinder {one.id}", [one.id], list[int]()) for one in cylinders]
    for name, members, joined in [*((f"run {run.id}", run.cylinders, run.fittings) for run in runs), *alone]:
        pieces = [of_cylinder[number] for number in members if number in of_cylinder]
        own = {k for own in pieces for k in own} | {of_fitting[number] for number in joined if number in of_fitting}
        first = [_head(pieces[0], near)] if pieces else []
        order: list[int] = []
        for seed in [*first, *(k for part in pieces for k in part), *sorted(own)]:
            stack = [seed] if seed in own else []
            while stack:
                k = stack.pop()
                if k not in seen:
                    seen.add(k)
                    order.append(k)
                    stack += [other for _, other in sorted(near[k].items(), reverse=True) if other in own]
        if order:
            names.append(name)
            systems.append(tuple(order))
    left = tuple(k for k in of_fitting.values() if k not in seen)
    return (*names, *(["other fittings"] if left else [])), (*systems, *([left] if left else []))


def _head(pieces: Sequence[int], near: dict[int, dict[int, int]]) -> int:
    """Return the part with which a walk from a cylinder begins: an open end of it, or what closes one."""
    for piece, port in ((pieces[0], 0), (pieces[-1], 1)):
        if port not in near[piece]:
            return piece
        if len(near[near[piece][port]]) == 1:
            return near[piece][port]
    return pieces[0]


def _bores(cylinders: Sequence[ResultCylinder], runs: Sequence[ResultRun]) -> dict[int, float]:
    """Return the diameter of each cylinder: that of its size in its run."""
    out = {one.id: 2.0 * one.radius for one in cylinders}
    for run in runs:
        for size in run.sizes:
            out |= {number: 2.0 * size.radius for number in size.cylinders if number in out}
    return out
