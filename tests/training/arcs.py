"""Run the pipeline on CAD parts and boxes, and write one JSON line for each verdict that a law of its own weighs.

Rounds, fillets and slot ends go on tangentially, and are weighed by a law of their own. The pipeline keeps of them
those that it accepts; here all verdicts on them are taken down, and those on short cylinders that were held upright on
a plane. `fit.py` tells these lines from others by `arc` and `upright`. Boxes with sharp edges have no arcs, but what a
coarse and noisy scan shows of an edge may pass for one.
"""

import argparse
import json
import sys
from collections import Counter
from contextlib import contextmanager
from itertools import chain
from pathlib import Path

import numpy as np
from collect import done_before
from labels import FALSE
from references import CAD_NEAR_OF_ARCS, DATA, NOISES, Scan, cad_parts

from cylx.config import Config
from cylx.pipeline import extract_cylinders, judging
from cylx.records import PointCloud
from cylx.scene import prepare

BOXES = [
    (20, 12, 40),
    (3, 12, 40),
    (2, 12, 40),
    (1.2, 20, 40),
    (30, 30, 3),
    (6, 6, 30),
    (4, 8, 12),
    (2, 2, 30),
    (1, 6, 25),
]
"""Sides of the boxes: blocks, plates, beams and strips."""
NOISES_OF_BOXES = 0.005, 0.02, 0.05, 0.1, 0.2
"""Noises, in the same unit; the points of a box lie 0.25 to 0.6 apart."""


def boxes(seed):
    """Give boxes with sharp edges, turned anyhow, in several noises."""
    for k, (sides, noise) in enumerate((sides, noise) for sides in BOXES for noise in NOISES_OF_BOXES):
        rng = np.random.default_rng([seed, k])
        spacing = rng.uniform(0.25, 0.6)
        faces = []
        for axis in range(3):
            wide, high = sides[axis], sides[(axis + 1) % 3]
            for end in (-0.5, 0.5):
                face = np.empty((int(wide * high / spacing**2), 3))
                face[:, axis] = wide * rng.uniform(-0.5, 0.5, len(face))
                face[:, (axis + 1) % 3] = high * rng.uniform(-0.5, 0.5, len(face))
                face[:, (axis + 2) % 3] = end * sides[(axis + 2) % 3]
                faces.append(face)
        points = np.concatenate(faces)
        points += noise * rng.standard_normal(points.shape)
        turn = np.linalg.qr(rng.standard_normal((3, 3)))[0]
        yield Scan(f"box_{k}@{seed}", PointCloud.from_array(points @ turn), lambda cylinder: (FALSE, None))


@contextmanager
def noted():
    """Take down the segments that are judged as arcs or held upright, with the verdicts and payoffs, for a while."""
    before, found = judging.verify, []

    def verify(segment, indexed, payoff, counts, config, *, arc=False):
        verdict = before(segment, indexed, payoff, counts, config, arc=arc)
        if (arc or segment.upright) and verdict.measures:
            found.append((segment, verdict, payoff, arc))
        return verdict

    judging.verify = verify
    try:
        yield found
    finally:
        judging.verify = before


def rows_of(scan):
    """Give a row for each verdict on an arc, or on what was held upright, of a part."""
    with noted() as found:
        extract_cylinders(scan.cloud, Config(), threads=1)  # in order, so that the rows are the same again
    frame = prepare(scan.cloud, Config()).frame
    rows = []
    for segment, verdict, payoff, arc in found:
        label, owner = scan.judge(frame.to_scene(segment.cylinder))
        own = {"coverage": verdict.coverage, "inliers": len(verdict.points), "payoff": payoff}
        rows.append(
            {
                "scene": scan.name,
                "arc": arc,
                "upright": segment.upright,
                "label": label,
                "cylinder": owner,
                "measures": {key: float(value) for key, value in {**verdict.measures, **own}.items()},
                "confidence": verdict.confidence,
                "reason": verdict.reason,
            }
        )
    return rows


def parse():
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("output", type=Path, metavar="OUT.jsonl")
    parser.add_argument(
        "--noise", type=float, nargs="+", default=list(NOISES[:3]), metavar="SPACINGS", help="default: 0 to 0.2"
    )
    parser.add_argument("--every", type=int, default=1, metavar="N", help="only every so manyth part")
    parser.add_argument("--start", type=int, default=0, metavar="N", help="from this one on (default: 0)")
    parser.add_argument("--boxes", type=int, nargs="*", default=[0], metavar="SEED", help="also boxes (default: 0)")
    parser.add_argument("--data", type=Path, default=DATA, help="folder of the parts (default: ../shared/data)")
    parser.add_argument("--append", action="store_true", help="keep the parts that the file has already")
    return parser.parse_args()


def main():
    """Collect rows, part by part, and say what they are."""
    a = parse()
    there = done_before(a.output) if a.append else set()
    with a.output.open("a" if a.append else "w", encoding="utf-8") as file:
        parts = cad_parts(a.data, a.noise, a.every, a.start, near=CAD_NEAR_OF_ARCS)
        for scan in chain(parts, *(boxes(seed) for seed in a.boxes)):
            if scan.name in there:
                continue
            rows = rows_of(scan)
            file.writelines(json.dumps(row) + "\n" for row in rows)
            file.flush()
            counts = Counter(row["label"] for row in rows)
            print(f"{scan.name}: {', '.join(f'{n} {label}' for label, n in sorted(counts.items())) or 'no arc'}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
