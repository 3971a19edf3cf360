"""Each kind of fitting, built from its measures: its surfaces and its truth."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from cylx.geometry.arrays import FloatArray
from cylx.geometry.cylinder import axis_basis
from cylx.synthetic.plant.network import Joining, Span, Straight
from cylx.synthetic.plant.sizes import PipeSize
from cylx.synthetic.plant.surfaces import Bend, Block, PipingSurface, Revolved, Ring, pipe

GASKET = 0.003
"""Between the discs of a pair of flanges, metres."""


def built_bend(
    run: int,
    before: int,
    after: int,
    point: FloatArray,
    direction: FloatArray,
    aside: FloatArray,
    size: PipeSize,
    bend_radius: float,
    angle: float,
) -> tuple[Joining, list[FloatArray], FloatArray]:
    """Return an elbow that turns from a direction towards `aside`, nodes of its centre line, and the new direction."""
    center, normal = point + bend_radius * aside, np.cross(direction, aside)
    bend = Bend(center, normal, -aside, bend_radius, size.radius, angle)
    nodes, radial = bend.at(np.linspace(0.0, angle, 5))
    geometry = {
        "center": center,
        "bend_radius": bend_radius,
        "angle_deg": math.degrees(angle),
        "radius": size.radius,
        "normal": normal,
        "start": point,
        "end": nodes[-1],
    }
    joining = Joining("elbow", run, [before, after], geometry, [bend], length=bend_radius * angle)
    turned = np.cross(normal, radial[-1])
    return joining, list(nodes), np.asarray(turned / np.linalg.norm(turned))


def built_reducer(
    run: int,
    before: int,
    after: int,
    point: FloatArray,
    direction: FloatArray,
    size: PipeSize,
    other: PipeSize,
    aside: FloatArray | None,
) -> tuple[Joining, list[FloatArray]]:
    """Return a reducer (eccentric if there is a side to go to) and the ends of its centre line."""
    length = max(size.reducer_length, other.reducer_length)
    offset = 0.0 if aside is None else abs(size.radius - other.radius)
    skew = np.zeros(3) if aside is None else offset / length * aside
    end = point + length * (direction + skew)
    cone = Revolved(
        point, direction, 0.0, length, size.radius, slope=(other.radius - size.radius) / length, skew=np.asarray(skew)
    )
    geometry = {
        "center": 0.5 * (point + end),
        "start": point,
        "end": end,
        "start_radius": size.radius,
        "end_radius": other.radius,
        "offset": offset,
        "concentric": aside is None,
    }
    centre_line = float(np.linalg.norm(end - point))
    return Joining("reducer", run, [before, after], geometry, [cone], length=centre_line), [point, end]


def built_cap(run: int, straight: int, point: FloatArray, direction: FloatArray, radius: float) -> Joining:
    """Return a cap: half an ellipsoid, half as high as wide."""
    head = Revolved(point, direction, 0.0, 0.5 * radius, radius, bulge=4.0)
    geometry = {"center": point + 0.25 * radius * direction, "axis": direction, "radius": radius}
    return Joining("cap", run, [straight], geometry, [head])


def built_flange(run: int, straight: int, low: FloatArray, high: FloatArray, size: PipeSize) -> Joining:
    """Return one disc at the end of a pipe."""
    return _flange(run, straight, low, high, size, pair=False)


def _flange(run: int, straight: int, low: FloatArray, high: FloatArray, size: PipeSize, *, pair: bool) -> Joining:
    """Return one disc, or two with a gasket between them."""
    thickness = float(np.linalg.norm(high - low))
    axis = (high - low) / thickness
    geometry = {
        "center": 0.5 * (low + high),
        "axis": axis,
        "radius": size.flange_radius,
        "thickness": thickness,
        "pair": pair,
    }
    surfaces: list[PipingSurface] = []
    depth = 0.5 * (thickness - GASKET) if pair else thickness
    for inner in (low, high - depth * axis) if pair else (low,):
        surfaces.append(pipe(inner, inner + depth * axis, size.flange_radius))
    surfaces.append(Ring(low, -axis, size.radius, size.flange_radius))
    surfaces.append(Ring(high, axis, size.radius, size.flange_radius))
    return Joining("flange", run, [straight], geometry, surfaces)


def tee_geometry(meeting: FloatArray, main: int, branches: list[int], angle_deg: float) -> dict[str, Any]:
    """Return what is true of a tee or a cross."""
    return {"center": meeting, "main": [main], "branches": list(branches), "angle_deg": angle_deg}


def reach_of(span: Span, size: PipeSize) -> float:
    """Return how far from the axis a straight reaches where something sits on it, metres."""
    if span.kind in {"flange", "inline"}:
        return 1.05 * size.flange_radius
    return size.radius + span.thickness


def furnish(
    rng: np.random.Generator, index: int, straight: Straight, count: int
) -> tuple[list[Joining], list[Revolved]]:
    """Return the fittings on a straight, and the mantles of its insulation.

    Parameters
    ----------
    rng : numpy.random.Generator
        Chooses the bodies of valves.
    index : int
        Of the straight.
    straight : Straight
        With its spans.
    count : int
        Number of the fittings there are already.
    """
    found: list[Joining] = []
    covers = []
    for span in straight.spans:
        low, high = straight.at(span.low), straight.at(span.high)
        if span.kind == "flange":
            found.append(_flange(straight.run, index, low, high, straight.size, pair=True))
        elif span.kind == "inline":
            found += _inline(rng, index, straight, span, count + len(found))
        elif span.kind == "gap":
            geometry = {"center": 0.5 * (low + high), "start": low, "end": high}
            found.append(Joining("joint", straight.run, [index], geometry, missing=True))
        elif span.kind == "insulation":
            covers.append(pipe(low, high, straight.size.radius + span.thickness))
    return found, covers


def _inline(rng: np.random.Generator, index: int, straight: Straight, span: Span, own: int) -> list[Joining]:
    """Return something between two pairs of flanges, and these; its own number is `own`."""
    size, axis = straight.size, straight.direction
    disc = 2 * size.flange_thickness + GASKET
    low, high = straight.at(span.low), straight.at(span.high)
    between, middle = span.high - span.low - 2 * disc, 0.5 * (low + high)
    least = 1.04 * size.radius  # the pipe is inside
    wide = max(float(rng.uniform(0.75, 0.95)) * size.flange_radius, 1.1 * size.radius)
    body: PipingSurface
    if rng.random() < 0.5:
        turn = np.column_stack([axis, *axis_basis(axis)])
        side = 2 * max(0.7 * wide, least)
        body = Block(middle, np.array([between, side, side]), turn)
    else:
        body = Revolved(
            middle, axis, -0.5 * between, 0.5 * between, wide, bulge=(wide**2 - least**2) / (0.5 * between) ** 2
        )
    geometry = {
        "center": middle,
        "axis": axis,
        "radius": size.flange_radius,
        "length": span.high - span.low,
        "start": low,
        "end": high,
    }
    ends = [(low, low + disc * axis), (high - disc * axis, high)]
    pairs = [_flange(straight.run, index, *pair, size, pair=True) for pair in ends]
    for pair in pairs:
        pair.part_of = own
    return [Joining("inline", straight.run, [index], geometry, [body]), *pairs]


def insulation_surfaces(cover: Revolved, radius: float) -> list[PipingSurface]:
    """Return the mantle and the two ends of an insulation about a pipe of a radius."""
    low = cover.base + cover.low * cover.direction
    high = cover.base + cover.high * cover.direction
    rings = [Ring(low, -cover.direction, radius, cover.radius), Ring(high, cover.direction, radius, cover.radius)]
    return [cover, *rings]
