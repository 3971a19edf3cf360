"""What the tiles have found -> groups of parts that have to be joined, and cylinders of one tile alone."""

from __future__ import annotations

from typing import Any

import numpy as np

from cylx.io.scratch import Scratch
from cylx.records import Scene
from cylx.tiles.gather import corridors_of, thinning_of, touches
from cylx.tiles.groups import groups_of, is_whole
from cylx.tiles.join import REACHED, group_name
from cylx.tiles.parts import Part
from cylx.tiles.search import WHOLE, Plan


def write_groups(plan: Plan, found: dict[int, dict[str, Any]], scene: Scene) -> list[int]:
    """Tell which parts have to be joined, and write them down; return the numbers of their groups."""
    scratch = plan.scratch
    parts: list[Part] = [one for tile in sorted(found) for one in found[tile]["parts"]]
    tiles = [tile for tile in sorted(found) for _ in found[tile]["parts"]]
    alone: list[Part] = []
    joint: dict[str, Any] = {}
    for group in groups_of(parts, tiles):
        members = [parts[i] for i in group]
        best = is_whole(members)
        if best is not None and tiles[group[best]] != WHOLE:
            alone.append(members[best])
            continue
        if len(members) == 1 and tiles[group[0]] != WHOLE and _is_all_in(plan, members[0], tiles[group[0]]):
            alone.append(members[0])
            continue
        number = len(joint)
        joint[str(number)] = {"corridors": corridors_of(members), "halvings": thinning_of(members)}
        about = {"parts": [part.to_object() for part in members], "found_in": [tiles[i] for i in group]}
        whole = [scene.spacing, scene.noise, scene.extent, list(scene.given)]
        scratch.write_json(group_name(number), {**about, **joint[str(number)], "scene": whole})
    scratch.write_json("alone.json", [part.to_object() for part in alone])
    scratch.write_json("groups.json", joint)
    return [int(group) for group in joint]


def _is_all_in(plan: Plan, part: Part, tile: int) -> bool:
    """Return whether no tile but its own has points about a part."""
    rows = np.array(corridors_of([part]))
    return not any(touches(rows, box) for other, box in enumerate(plan.boxes) if other != tile)


def tell_tiles(scratch: Scratch, groups: list[int], tiles: int) -> None:
    """Write down which tiles have points about each group."""
    reached: dict[str, list[int]] = {str(group): [] for group in groups}
    for tile in range(tiles if groups else 0):
        for group in scratch.read_json(f"gathered-{tile}.json"):
            reached[str(group)].append(tile)
    scratch.write_json(REACHED, reached)
