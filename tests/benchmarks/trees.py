"""Stems of scans of others beside their references: the diameter at breast height of each, found and fitted by hand.

    python trees.py [--ground lowest]

The references are circles that were fitted to sections of these trees by other means. Slices of 10 cm, in which no stem
can be followed, are told apart.
"""

import argparse
import json
import math
import sys
from pathlib import Path

import numpy as np
from runs import SHARED
from tables import print_header, print_row

import cylx

WILD = SHARED / "data" / "wild"


def place_of(reference):
    """Give where a reference is at breast height, (2,): the section of its profile that is nearest to 1.3 m."""
    if "profile" not in reference:
        return np.array(reference["point"][:2])
    one = min(reference["profile"], key=lambda section: abs(section["h"] - 1.3))
    return np.array([one["x"], one["y"]])


def pairs_of(references, stems):
    """Give (reference, stem or None) for each reference, and the stems without one."""
    left, pairs = list(stems), []
    for reference in references:
        place, dbh = place_of(reference), reference.get("diameter_1_3") or 2.0 * reference["radius"]
        near = [one for one in left if math.hypot(*(one.breast[:2] - place)) < 0.15 + 0.3 * dbh]
        best = min(near, key=lambda one: abs(one.dbh - dbh), default=None)
        if best is not None:
            left.remove(best)
        pairs.append((reference, dbh, best))
    return pairs, left


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--ground", choices=["classes", "cloth", "lowest"], help="how the ground is found")
    args = parser.parse_args()
    if not (WILD / "references.json").is_file():
        sys.exit(f"{WILD}: not there")
    listed = json.loads((WILD / "references.json").read_text(encoding="utf-8"))
    print_header("file", "reference, cm", "found, cm", "difference", "seen", "quality", "remarks")
    differences, missed, more, slices = [], 0, 0, 0
    for name, about in listed.items():
        if about["group"] != "trees":
            continue
        stems = cylx.find_stems(WILD / name, ground=args.ground).stems
        pairs, left = pairs_of(about["refs"], stems)
        for reference, dbh, one in pairs:
            is_slice = "profile" not in reference
            slices += is_slice
            if one is None:
                missed += not is_slice
                remark = "a slice of 10 cm" if is_slice else "not found"
                print_row(Path(name).stem, f"{100 * dbh:.1f}", "-", "-", "-", "-", remark)
                continue
            difference = one.dbh / dbh - 1.0
            differences.append(difference)
            found = f"{100 * one.dbh:.1f} ± {100 * one.dbh_sd:.1f}"
            seen, quality = f"{math.degrees(one.arc):.0f}°", f"{one.quality:.2f}"
            told = "; ".join(one.flags)
            print_row(Path(name).stem, f"{100 * dbh:.1f}", found, f"{100 * difference:+.1f} %", seen, quality, told)
        for one in left:
            more += 1
            found = f"{100 * one.dbh:.1f} ± {100 * one.dbh_sd:.1f}"
            seen, quality = f"{math.degrees(one.arc):.0f}°", f"{one.quality:.2f}"
            print_row(Path(name).stem, "-", found, "-", seen, quality, "; ".join([*one.flags, "no reference"]))
    e = np.array(differences)
    print(
        f"\n{len(e)} of {len(e) + missed} found, {more} without a reference, {slices} slices; bias "
        f"{100 * e.mean():+.1f} %, median {100 * np.median(e):+.1f} %, rmse {100 * math.sqrt((e**2).mean()):.1f} %, "
        f"largest {100 * np.abs(e).max():.1f} %"
    )


if __name__ == "__main__":
    main()
