"""Run the pipeline without each term of the evidence, on scenes that the weights were not fitted to.

Each term is taken out of `cylx.evidence.weights.TERMS`, and the others get the weights that were fitted without it,
from the file that `fit.py --ablation FILE` writes. What that costs is counted end to end: cylinders missed, and false
ones.
"""

import argparse
import json
import sys
from contextlib import contextmanager
from pathlib import Path

from collect import extracted, result_of, seed_range
from scenes import KINDS, make

sys.path.append(str(Path(__file__).parents[1] / "benchmarks"))
from tables import print_header, print_row

from cylx.evaluation import evaluate
from cylx.evidence import weights as evidence_weights

HELD_OUT = range(10000, 10003)
POINTS = 80000


@contextmanager
def weighed_by(law):
    """Let `cylx.evidence` weigh the terms that a law has, by its weights, for a while."""
    before = evidence_weights.BIAS, evidence_weights.TERMS
    weights = law["weights"]
    kept = [term._replace(weight=weights[term.reason]) for term in evidence_weights.TERMS if term.reason in weights]
    if len(kept) < len(weights):
        unknown = set(weights) - {term.reason for term in kept}
        raise SystemExit(f"cylx.evidence has no term {', '.join(sorted(unknown))}; run fit.py --ablation again")
    evidence_weights.BIAS, evidence_weights.TERMS = law["bias"], tuple(kept)
    try:
        yield
    finally:
        evidence_weights.BIAS, evidence_weights.TERMS = before


def counts_of(scenes):
    """Extract scenes; give how many true cylinders were asked for, found, and how many false ones there were."""
    asked = found = false = 0
    for scene in scenes:
        score = evaluate(scene.truth(), result_of(extracted(scene)))
        asked, found, false = asked + score.truth, found + score.matched, false + len(score.false)
    return asked, found, false


def parse():
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("weights", type=Path, metavar="FILE", help="what fit.py --ablation wrote")
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=list(KINDS), help="default: all of them")
    parser.add_argument("--seeds", type=seed_range, default=HELD_OUT, metavar="A:B", help="default: 10000:10003")
    parser.add_argument("--points", type=int, default=POINTS, help="about how many in a scene (default: %(default)s)")
    parser.add_argument("--scenes", type=int, metavar="N", help="no more than so many scenes")
    return parser.parse_args()


def main():
    """Print a row for the whole evidence and one for each term left out."""
    a = parse()
    laws = json.loads(a.weights.read_text(encoding="utf-8"))
    names = [(kind, seed) for seed in a.seeds for kind in a.kinds][: a.scenes]
    scenes = [make(kind, seed, a.points) for kind, seed in names]
    print(f"{len(scenes)} scenes: {', '.join(f'{kind}{seed}' for kind, seed in names)}\n")
    print_header("without", "precision", "recall", "F1", "missed", "false")
    for name, law in [("nothing", laws["all"]), *laws["without"].items()]:
        with weighed_by(law):
            asked, found, false = counts_of(scenes)
        precision = found / (found + false) if found + false else 1.0
        recall = found / asked if asked else 1.0
        f1 = 2 * found / (asked + found + false) if asked + found + false else 1.0
        print_row(name, f"{precision:.3f}", f"{recall:.3f}", f"{f1:.3f}", str(asked - found), str(false))
    return 0


if __name__ == "__main__":
    sys.exit(main())
