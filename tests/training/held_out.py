"""Say of rows of `collect.py`, of scenes the weights were not fitted to, how often a confidence was right.

Counted are the cylinders that were accepted. Of scenes with other seeds than those of the fit this is a test of the
whole pipeline, with the confidences as a user gets them.
"""

import argparse
import sys
from collections import Counter
from pathlib import Path

from fit import read_rows
from labels import AMBIGUOUS, FALSE, IGNORED, TRUE
from logistic import kind_of

sys.path.append(str(Path(__file__).parents[1] / "benchmarks"))
from tables import print_header, print_row

BINS = ((0.5, 0.7), (0.7, 0.9), (0.9, 0.97), (0.97, 1.0))


def print_confidences(lines):
    """Print how many of the accepted of each confidence are true."""
    print_header(
        "confidence", "accepted", "true", "false", "near a true one", "ones that need not be found", "share true"
    )
    for low, high in BINS:
        own = [line for line in lines if low <= line["confidence"] < high or line["confidence"] == high == 1.0]
        counts = Counter(line["label"] for line in own)
        judged = counts[TRUE] + counts[FALSE]
        cells = [str(counts[label]) for label in (TRUE, FALSE, AMBIGUOUS, IGNORED)]
        print_row(f"{low:g} to {high:g}", str(len(own)), *cells, f"{counts[TRUE] / judged:.3f}" if judged else "-")


def print_kinds(lines):
    """Print the same for each kind of scene, all confidences together."""
    print_header("kind", "scenes", "accepted", "true", "false", "near a true one", "ones that need not be found")
    kinds = sorted({kind_of(line["scene"]) for line in lines})
    for kind in kinds:
        own = [line for line in lines if kind_of(line["scene"]) == kind]
        counts = Counter(line["label"] for line in own)
        cells = [str(counts[label]) for label in (TRUE, FALSE, AMBIGUOUS, IGNORED)]
        print_row(kind, str(len({line["scene"] for line in own})), str(len(own)), *cells)


def main():
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rows", nargs="+", type=Path, metavar="ROWS.jsonl")
    lines = [line for line in read_rows(parser.parse_args().rows) if not line["reason"]]
    print_confidences(lines)
    print()
    print_kinds(lines)
    return 0


if __name__ == "__main__":
    sys.exit(main())
