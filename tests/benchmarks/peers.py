"""cylx and other programs on the same scenes, in turns on the same machine: seconds, memory, F1, and how they compare.

The others are given what cylx has to find out: a threshold of three times the true noise, limits of half the smallest
and twice the largest radius of the family, and a least number of points. Their seconds are those of their own programs,
normals included; what the wrappers that start them add is left out of the comparison. cylx runs as a whole process.
"""

import argparse
import json
import os
import shutil
import statistics
import sys
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

from runs import SHARED, extract, give_up, require_scenes, run, truth_of, warm_up
from tables import Bars, number, print_header, print_row

from cylx.evaluation import evaluate

RADII = {"clutter": (0.01, 0.4), "rack": (0.0125, 0.6), "ycb": (0.016, 0.1)}
LEAST_POINTS = {
    "clutter": ((0, 60), (300_000, 100), (1_000_000, 200), (5_000_000, 600)),
    "rack": ((0, 100), (1_000_000, 150), (3_000_000, 300)),
    "ycb": ((0, 100),),
}  # (points of the scene from which on, points of a cylinder)
CLOUDCOMPARE = ("run_cloudcompare", "--shapes", "PLANE,SPHERE,CYLINDER")
PEERS = {
    "CloudCompare": CLOUDCOMPARE,
    "CloudCompare, jet normals": (*CLOUDCOMPARE, "--normals", "jet"),
    "CGAL": ("run_cgal",),
}
STRONGEST = "CloudCompare, jet normals"
NEEDS = {"CloudCompare": (), "CloudCompare, jet normals": ("normals_ply",), "CGAL": ("cgal_ransac",)}
COLUMNS = ("scene", "program", "seconds", "with its wrapper", "peak MB", "found", "F1", "cylx / it", "bar")


@dataclass
class Rounds:
    """What was measured of one program on one scene, round by round."""

    seconds: list = field(default_factory=list)
    whole: list = field(default_factory=list)
    peak_mb: list = field(default_factory=list)
    found: list = field(default_factory=list)
    f1: list = field(default_factory=list)
    notes: list = field(default_factory=list)

    def add(self, measured, seconds, truth, result):
        """Note a round."""
        self.seconds.append(seconds)
        self.whole.append(measured.seconds)
        self.peak_mb.append(measured.peak_mb)
        self.found.append(len(result["cylinders"]))
        self.f1.append(evaluate(truth, result).f1)
        self.notes += [result["note"]] if "note" in result else []

    def cells(self):
        """Write the numbers: median times, the largest peak, median count, mean F1."""
        if not self.seconds:
            return ["-"] * 5
        times = [number(statistics.median(each), 2) for each in (self.seconds, self.whole)]
        return [
            *times,
            f"{max(self.peak_mb):.0f}",
            f"{statistics.median(self.found):g}",
            f"{statistics.fmean(self.f1):.3f}",
        ]


def usable(peers, wrappers, programs, wanted):
    """Give the peers that can be run; say of the others what they lack."""
    chosen = {}
    for name, command in peers.items():
        if wanted and name not in wanted:
            continue
        files = [wrappers / command[0], *(programs / each for each in NEEDS[name])]
        lacking = [str(path) for path in files if not path.is_file()]
        if command[0] == "run_cloudcompare" and shutil.which("CloudCompare") is None:
            lacking.append("the program CloudCompare")
        if lacking:
            print(f"{name}: left out; missing: {', '.join(lacking)}", file=sys.stderr)
        else:
            chosen[name] = command
    return chosen


def told(truth):
    """Give the options that tell a peer about a scene."""
    family = truth["family"].partition("-")[0]
    if family not in RADII:
        give_up(f"the radii of the family {family!r} are not known here")
    smallest, largest = RADII[family]
    least = [points for size, points in LEAST_POINTS[family] if truth["points"] >= size][-1]
    options = {"threshold": 3 * truth["sigma"], "radius-min": smallest, "radius-max": largest, "min-points": least}
    return [word for key, value in options.items() for word in (f"--{key}", f"{value:g}")]


def run_peer(command, scene, folder, truth, a):
    """Run a peer on a scene; return the run of its wrapper, its own seconds, and the result (None if there is none)."""
    wrapper, *options = command
    path = a.wrappers / wrapper
    python = path.read_bytes().startswith(b"#!/usr/bin/env python3")
    output = Path(folder) / "peer.json"
    output.unlink(missing_ok=True)
    words = [*([sys.executable] if python else []), path, scene.resolve(), output, *told(truth), *options]
    measured = run([*words, "--time-limit", f"{a.time_limit:g}"], PEERS_BIN=str(a.programs))
    if measured.code or not output.is_file():
        print(f"{scene}: {' '.join(command)}: exit {measured.code}: {measured.complaint}", file=sys.stderr)
        return measured, None, None
    result = json.loads(output.read_text(encoding="utf-8"))
    return measured, result["seconds"]["total"], result


def play(scene, folder, peers, a):
    """Run all programs on a scene, round after round; return what was measured by program."""
    truth = json.loads(truth_of(scene).read_text(encoding="utf-8"))
    measures = {name: Rounds() for name in ("cylx", *peers)}
    for _ in range(a.rounds):
        measured, result = extract(scene, folder)
        if result is not None:
            measures["cylx"].add(measured, measured.seconds, truth, result)
        for name, command in peers.items():
            measured, seconds, result = run_peer(command, scene, folder, truth, a)
            if result is not None:
                measures[name].add(measured, seconds, truth, result)
    return measures


def report(scene, measures, bars, bar):
    """Print the rows of a scene."""
    own = measures["cylx"].seconds
    for name, rounds in measures.items():
        ratio = None
        if name != "cylx" and own and rounds.seconds:
            ratio = statistics.median(own) / statistics.median(rounds.seconds)
        verdict = bars.at_most(ratio, bar) if name == STRONGEST else ""
        print_row(scene.stem, name, *rounds.cells(), "" if name == "cylx" else number(ratio, 2), verdict)
        for note in dict.fromkeys(rounds.notes):
            print(f"{scene.stem}: {name}: {note}", file=sys.stderr)


def main():
    """Print the rows of all scenes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", metavar="SCENE.ply", nargs="+", type=Path)
    parser.add_argument("--rounds", type=int, default=3, help="of which the median is given (default: %(default)s)")
    parser.add_argument("--only", nargs="+", choices=PEERS, metavar="NAME", help=f"some of: {', '.join(PEERS)}")
    parser.add_argument("--time-limit", type=float, default=600, help="of a peer, seconds (default: %(default)s)")
    parser.add_argument(
        "--wrappers",
        type=Path,
        default=SHARED / "bench" / "peers",
        help="folder of what starts the peers (default: ../shared/bench/peers)",
    )
    parser.add_argument(
        "--programs",
        type=Path,
        default=Path(os.environ.get("PEERS_BIN", Path(tempfile.gettempdir(), "cylx-peers"))),
        help="folder of the peers' programs, as ../shared/bench/peers/build.sh leaves them (default: $PEERS_BIN)",
    )
    parser.add_argument(
        "--max-ratio", type=float, metavar="BAR", help=f"exit with 1 if cylx needs more of the time of: {STRONGEST}"
    )
    a = parser.parse_args()
    require_scenes(a.scenes)
    peers = usable(PEERS, a.wrappers, a.programs, a.only)
    if not peers:
        give_up("there is no other program to compare with")
    bars = Bars()
    print_header(*COLUMNS)
    with tempfile.TemporaryDirectory() as folder:
        warm_up(folder)
        for scene in a.scenes:
            report(scene, play(scene, folder, peers, a), bars, a.max_ratio)
    return bars.exit_code()


if __name__ == "__main__":
    sys.exit(main())
