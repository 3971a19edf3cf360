"""Run the pipeline on scans of others and write one JSON line for each fit that was judged, as `collect.py` does.

`fit4cad` are CAD parts, each with several noises; `depth` are scenes of a depth camera; `wild` are stems, columns and
parts. Their folders are looked for in `../shared/data`. Parts are named so that one under several noises stays in one
fold of `fit.py`.
"""

import argparse
import json
import sys
from collections import Counter
from pathlib import Path

from collect import done_before, judged_fits, row_of
from references import DATA, NOISES, cad_parts, depth_scenes, wild_scans

from cylx.config import Config
from cylx.pipeline import extract_cylinders

SOURCES = {"fit4cad": cad_parts, "depth": depth_scenes, "wild": wild_scans}
SEEDS = {"fit4cad": (0,), "depth": (0, 1), "wild": (0, 1)}
"""Seeds of the extraction: few scans say more with two."""


def rows_of(scan, seeds):
    """Give the rows of a scan. Accepted blends are among them: as cylinders they would be false, or are left out."""
    rows = []
    for seed in seeds:
        extraction = extract_cylinders(scan.cloud, Config().model_copy(update={"seed": seed}))
        for fit, reason in judged_fits(extraction, blends=True):
            label, owner = scan.judge(fit.cylinder)
            rows.append(row_of(scan.name, fit, reason, label, owner))
    return rows


def scans_of(source, a):
    """Give the scans of a source that were asked for."""
    if source == "fit4cad":
        return cad_parts(a.data, a.noise, a.every, a.start)
    return SOURCES[source](a.data, a.every, a.start)


def parse():
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("output", type=Path, metavar="OUT.jsonl")
    parser.add_argument("--sources", nargs="+", choices=SOURCES, default=list(SOURCES), help="default: all of them")
    parser.add_argument(
        "--noise",
        type=float,
        nargs="+",
        default=list(NOISES),
        metavar="SPACINGS",
        help="of CAD parts (default: 0 to 0.5)",
    )
    parser.add_argument("--every", type=int, default=1, metavar="N", help="only every so manyth scan")
    parser.add_argument("--start", type=int, default=0, metavar="N", help="from this one on (default: 0)")
    parser.add_argument("--data", type=Path, default=DATA, help="folder of the scans (default: ../shared/data)")
    parser.add_argument("--append", action="store_true", help="keep the scans that the file has already")
    return parser.parse_args()


def main():
    """Collect rows, scan by scan, and say how each went."""
    a = parse()
    there = done_before(a.output) if a.append else set()
    with a.output.open("a" if a.append else "w", encoding="utf-8") as file:
        for source in a.sources:
            for scan in scans_of(source, a):
                if scan.name in there:
                    continue
                rows = rows_of(scan, SEEDS[source])
                file.writelines(json.dumps(row) + "\n" for row in rows)
                file.flush()
                counts = Counter(row["label"] for row in rows)
                print(f"{scan.name}: {', '.join(f'{n} {label}' for label, n in sorted(counts.items())) or 'no fit'}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
