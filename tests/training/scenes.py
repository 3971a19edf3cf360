"""Scenes with a known truth, to fit and to check what `cylx.evidence` weighs: made of nothing but their kind and seed.

As a program it writes one scene and its truth, to be looked at or extracted: `scenes.py plant 3 plant3.ply`.
"""

import argparse
import json
import sys
import zlib
from pathlib import Path

import numpy as np
from plant import plant
from rooms import clutter, room
from steel import steelwork
from tabletop import tabletop
from turned import turned

KINDS = {
    "room": room,
    "arcs": room,
    "correlated": room,
    "clutter": clutter,
    "plant": plant,
    "steelwork": steelwork,
    "tabletop": tabletop,
    "turned": turned,
}


def make(kind, seed, points=None):
    """Make a scene.

    Parameters
    ----------
    kind : str
        `room`: cylinders of any coverage among everything that is none; `arcs`: the same with 25 to 120 degrees of
        most of them; `correlated`: the same with noise that neighbours share; `clutter`: `cylx.synthetic.multi`;
        `plant`: a rack of pipes from four viewpoints; `steelwork`: rolled sections and a few pipes, likewise;
        `tabletop`: household things, as a depth camera sees them; `turned`: solids that are nearly cylinders.
    seed : int
    points : int, optional
        About how many; by default 50 000 to 400 000, drawn at random.

    Returns
    -------
    SyntheticScene
        True cylinders are cut to what is seen of them. Those with fewer than 40 points, less than 25 degrees, less
        than half a radius of length or a radius below three deviations of the noise are marked `ignore`, and so is
        what is a cylinder to some and none to others.
    """
    rng = np.random.default_rng([zlib.crc32(kind.encode()), seed])
    return KINDS[kind](rng, kind, seed, points)


def main():
    """Write one scene and its truth."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("kind", choices=KINDS)
    parser.add_argument("seed", type=int)
    parser.add_argument("output", type=Path, help="PLY, PCD or XYZ; the truth goes beside it")
    parser.add_argument("--points", type=int, help="about how many")
    a = parser.parse_args()
    from cylx.io import write_cloud

    scene = make(a.kind, a.seed, a.points)
    write_cloud(str(a.output), scene.points, properties=None, overwrite=True, dtype="f8")
    a.output.with_suffix(".truth.json").write_text(json.dumps(scene.truth(), indent=2) + "\n", encoding="utf-8")
    asked = sum(not true.ignore for true in scene.cylinders)
    print(f"{a.output}: {len(scene.points)} points, {len(scene.cylinders)} cylinders, {asked} to be found")
    return 0


if __name__ == "__main__":
    sys.exit(main())
