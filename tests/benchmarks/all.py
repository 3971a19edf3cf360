"""Run every benchmark and write its command and its tables into docs/benchmarks.md, between the markers there.

FOLDER has the scenes that `scenes_make.py FOLDER` makes, with --large for those that --large runs. A table whose data
are missing is left as it is.
Exits with 1 if a bar was missed, with 2 if something could not be run.
"""

import argparse
import platform
import re
import shlex
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

from runs import ROOT

PAGE = ROOT / "docs" / "benchmarks.md"
HERE = Path(__file__).parent
SCENES = "scenes"  # what the folder is called on the page

QUICK = {
    "single-paper": "single.py --preset paper --max-angle 0.4 --max-offset 0.01 --max-radius 0.5",
    "single-auto": "single.py --preset auto --max-angle 0.05 --max-offset 0.002 --max-radius 0.1",
    "single-arc": "single.py --preset auto --theta 135 --sigma 0.005 --sigma-o 0.01 --p 0.1 --max-angle 0.05",
    "calibration": "calibration.py --trials 200 --max-ratio 1.3",
    "catalogue": "catalogue.py --trials 40 --max-wrong 5",
    "recall-coverage": "recall.py --only coverage --trials 10",
    "recall-height": "recall.py --only height --trials 10",
    "recall-points": "recall.py --only points --trials 10",
    "recall-outliers": "recall.py --only outliers --trials 10",
    "sources": "sources.py --trials 3",
    "negatives": "negatives.py --max-found 0",
    "piping": "piping.py --bars",
    "cans": "scenes.py scenes/five?.ply scenes/pair?.ply --min-f1 1",
    "pair": "pair.py scenes/pair?.ply scenes/half?.ply --max-angle 0.1",
    "mug": "mug.py --max-angle 1.5 --max-radius 1",
    "tables": "scenes.py scenes/table?.ply scenes/view?.ply",
    "clutter": "scenes.py scenes/clutter100k_?.ply scenes/clutter300k_?.ply scenes/clutter1M_?.ply",
    "rack": "scenes.py scenes/rack1M_?.ply",
    "oracle": "oracle.py scenes/clutter1M_?.ply scenes/rack1M_?.ply --max-ratio 1.5",
    "invariance": "invariance.py scenes/clutter300k_0.ply scenes/view0.ply --max-offset 0.001",
    "peers-clutter": "peers.py scenes/clutter300k_0.ply scenes/clutter1M_0.ply --rounds 2",
    "peers-rack": "peers.py scenes/rack1M_0.ply --max-ratio 0.5",
    "startup": "startup.py",
    "batch": "batch.py",
}
LARGE = {
    "clutter-large": "scenes.py scenes/clutter5M_?.ply",
    "rack-large": "scenes.py scenes/rack3M_?.ply",
    "growth": "growth.py scenes/rack300k_0.ply scenes/rack?M_0.ply scenes/rack10M_0.ply --max-ratio 12",
}
BENCHMARKS = {**QUICK, **LARGE}


def arguments(command, folder):
    """Split a command of the page and put in the scenes there are; an empty list if there are none."""
    words = []
    for word in shlex.split(command):
        if word.startswith(f"{SCENES}/"):
            found = sorted(folder.glob(word.removeprefix(f"{SCENES}/")))
            if not found:  # one kind of scene is missing: the table would not be what its command says
                return []
            words += map(str, found)
        else:
            words.append(word)
    return [str(HERE / words[0]), *words[1:]]


def between_markers(page, name, text):
    """Put text between the markers of a name."""
    begin, end = f"<!-- begin {name} -->\n", f"<!-- end {name} -->"
    pattern = re.compile(f"{re.escape(begin)}.*?{re.escape(end)}", re.DOTALL)
    if len(pattern.findall(page)) != 1:
        sys.exit(f"{PAGE}: must have one pair of markers '{begin.strip()}' and '{end}'")
    return pattern.sub(lambda _: f"{begin}{text}\n{end}", page)


def write(name, text):
    """Write a part of the page at once, so that a long run that is stopped has not been for nothing."""
    PAGE.write_text(between_markers(PAGE.read_text(encoding="utf-8"), name, text), encoding="utf-8")


def versions():
    """Say what was measured."""
    parts = [f"cylx {version('cylx')}", f"Python {platform.python_version()}"]
    return ", ".join([*parts, *(f"{name} {version(name)}" for name in ("numpy", "numba", "scipy"))])


def run(name, folder):
    """Run one benchmark and write its part; return its exit code."""
    command = arguments(BENCHMARKS[name], folder)
    if not command:
        print(f"{name}: no such scenes in {folder}; scenes_make.py makes them", flush=True)
        return 2
    done = subprocess.run([sys.executable, *command], stdout=subprocess.PIPE, text=True, check=False)
    print(f"{name}: exit {done.returncode}\n{done.stdout}", flush=True)
    if done.returncode in (0, 1) and done.stdout:
        write(name, f"\n```console\npython tests/benchmarks/{BENCHMARKS[name]}\n```\n\n{done.stdout.strip()}\n")
        return done.returncode
    return 2


def main():
    """Run all of them, one after the other."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="folder of the scenes")
    parser.add_argument(
        "--only", nargs="+", choices=BENCHMARKS, metavar="NAME", help=f"some of: {' '.join(BENCHMARKS)}"
    )
    parser.add_argument("--large", action="store_true", help=f"also run {' '.join(LARGE)}")
    a = parser.parse_args()
    codes = {name: run(name, a.folder) for name in a.only or (BENCHMARKS if a.large else QUICK)}
    if not a.only:
        write("versions", f"\nMeasured with {versions()}.\n")
    print(*(f"{name}: {('all bars met', 'BAR MISSED', 'NOT RUN')[code]}" for name, code in codes.items()), sep="\n")
    return max(codes.values())


if __name__ == "__main__":
    sys.exit(main())
