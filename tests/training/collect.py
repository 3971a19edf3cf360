"""Run the pipeline on scenes with a known truth and write one JSON line for each fit that was judged.

A line says which scene it is of, what the fit is (`label`: true, ignored, ambiguous or false; `cylinder`: the true
one), what was measured of it (`measures`: all that `cylx.evidence` may weigh), and what was made of that. Rows of a
scene are written when it is done, so that a run that is stopped has not been for nothing; `--append` goes on with it.
"""

import argparse
import json
import sys
import time
from collections import Counter
from pathlib import Path

from labels import label_fits
from scenes import KINDS, make

from cylx.config import Config
from cylx.evaluation import evaluate
from cylx.pipeline import extract_cylinders
from cylx.records import PointCloud


def extracted(scene):
    """Extract the cylinders of a scene with the defaults."""
    return extract_cylinders(PointCloud(scene.points), Config())


def judged_fits(extraction, *, blends=False):
    """Give each fit that was measured, accepted or not, and why not; accepted blends only if they are asked for."""
    judged = [(fit, "") for fit in [*extraction.cylinders, *(extraction.blends if blends else ())]]
    judged += [(rejection.fit, rejection.reason) for rejection in extraction.rejected]
    return [(fit, reason) for fit, reason in judged if fit.evidence]


def row_of(scene, fit, reason, label, owner):
    """Give the row of a fit."""
    return {
        "scene": scene,
        "label": label,
        "cylinder": owner,
        "measures": measures_of(fit),
        "support": fit.support,
        "confidence": fit.confidence,
        "reason": reason,
    }


def rows_of(name, scene, extraction):
    """Give a row for each fit that was judged, accepted or not."""
    judged = judged_fits(extraction)
    labels, owners = label_fits(scene.truth(), [fit.cylinder for fit, _ in judged])
    return [
        row_of(name, fit, reason, label, owner)
        for (fit, reason), label, owner in zip(judged, labels, owners, strict=True)
    ]


def measures_of(fit):
    """Give all that may be weighed of a fit, as numbers that JSON has."""
    own = {"coverage": fit.coverage, "inliers": fit.inliers, "payoff": fit.payoff}
    return {key: float(value) for key, value in {**fit.evidence, **own}.items()}


def result_of(extraction):
    """Give an extraction as `cylx.evaluation` understands it."""
    return {
        "cylinders": [
            {
                "axis_point": fit.cylinder.point.tolist(),
                "axis_direction": fit.cylinder.direction.tolist(),
                "radius": fit.cylinder.radius,
                "height": fit.cylinder.height,
                "inliers": fit.inliers,
            }
            for fit in extraction.cylinders
        ]
    }


def summary(scene, extraction, rows):
    """Say in a line how right an extraction is, and what its fits were labelled."""
    score = evaluate(scene.truth(), result_of(extraction))
    counts = ", ".join(f"{count} {label}" for label, count in sorted(Counter(row["label"] for row in rows).items()))
    return f"precision {score.precision:.3f}, recall {score.recall:.3f} of {score.truth}; {counts or 'no fit'}"


def seed_range(text):
    """Read `A:B`, which ends before B, as a range."""
    low, high = text.split(":")
    return range(int(low), int(high))


def done_before(path):
    """Give the names of the scenes that a file has rows of."""
    if not path.exists():
        return set()
    return {json.loads(line)["scene"] for line in path.read_text(encoding="utf-8").splitlines()}


def parse():
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("output", type=Path, metavar="OUT.jsonl")
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=list(KINDS), help="default: all of them")
    parser.add_argument(
        "--seeds", type=seed_range, default=range(10), metavar="A:B", help="of each kind (default: 0:10)"
    )
    parser.add_argument("--points", type=int, help="about how many in a scene (default: 50 000 to 400 000)")
    parser.add_argument("--append", action="store_true", help="keep the scenes that the file has already")
    return parser.parse_args()


def main():
    """Collect rows, scene by scene, and say how each went."""
    a = parse()
    there = done_before(a.output) if a.append else set()
    with a.output.open("a" if a.append else "w", encoding="utf-8") as file:
        for seed in a.seeds:
            for kind in a.kinds:
                name = f"{kind}{seed}"
                if name in there:
                    continue
                start = time.perf_counter()
                scene = make(kind, seed, a.points)
                made = time.perf_counter()
                extraction = extracted(scene)
                found = time.perf_counter()
                rows = rows_of(name, scene, extraction)
                file.writelines(json.dumps(row) + "\n" for row in rows)
                file.flush()
                times = f"made in {made - start:.1f} s, extracted in {found - made:.1f} s"
                print(f"{name}: {len(scene.points)} points, {times}; {summary(scene, extraction, rows)}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
