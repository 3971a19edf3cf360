"""The same scene in another unit, at another place, in another order and turned: is what is found the same?

Each SCENE.ply has its SCENE.truth.json beside it. Every copy is written with coordinates of eight bytes, extracted by
a process of its own, and put beside the cylinders of the scene itself, moved like the points.
"""

import argparse
import json
import sys
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from runs import extract, require_scenes, truth_of, warm_up
from tables import Bars, print_header, print_row

from cylx.evaluation import evaluate
from cylx.io import read_cloud, write_cloud

FAR = (1e6, -2e6, 5e5)
COLUMNS = ("scene", "copy", "F1", "found", "the same", "angle, °", "offset, r", "radius, %", "ends, r")


def some_rotation():
    """Give a rotation about no axis in particular."""
    turn = np.linalg.qr(np.random.default_rng(7).standard_normal((3, 3)))[0]
    return turn * np.linalg.det(turn)  # of an odd number of rows: -1 turns a mirror into a rotation


@dataclass(frozen=True)
class Copy:
    """A copy of a scene: x -> scale turn x + shift, and what else is done to it."""

    name: str
    scale: float = 1.0
    turn: np.ndarray = field(default_factory=lambda: np.eye(3))
    shift: np.ndarray = field(default_factory=lambda: np.zeros(3))
    suffix: str = ".ply"
    reordered: bool = False

    @property
    def exact(self):
        """Whether the very same draws are expected, and with them the very same cylinders."""
        return bool((self.turn == np.eye(3)).all())

    def place(self, points):
        """Move points."""
        if not self.exact:
            points = points @ self.turn.T
        return self.scale * points + self.shift

    def write(self, points, folder):
        """Write the copy; return its path."""
        path = Path(folder) / f"copy{self.suffix}"
        order = np.random.default_rng(5).permutation(len(points)) if self.reordered else slice(None)
        write_cloud(path, self.place(points)[order], dtype="f8", overwrite=True)
        return path

    def document(self, known):
        """Move the cylinders of a truth or of a result."""
        moved = []
        for entry in known["cylinders"]:
            places = {key: self.place(np.array(entry[key])).tolist() for key in ("axis_point", "start", "end")}
            sizes = {key: self.scale * entry[key] for key in ("radius", "height")}
            direction = (self.turn @ entry["axis_direction"]).tolist()
            moved.append({**entry, **places, **sizes, "axis_direction": direction})
        return {"cylinders": moved}


COPIES = (
    Copy("in mm", scale=1000.0),
    Copy("moved by 10⁶", shift=np.array(FAR)),
    Copy("moved by 10⁶, as text", shift=np.array(FAR), suffix=".xyz"),
    Copy("reordered", reordered=True),
    Copy("turned", turn=some_rotation()),
)


def end_difference(known, found):
    """Give how far the ends of a cylinder are from those of another, along the axis of the first, in its radii."""
    axis = np.array(known["axis_direction"])
    ends = [
        sorted((np.array(entry[end]) - known["axis_point"]) @ axis for end in ("start", "end"))
        for entry in (known, found)
    ]
    return float(np.abs(np.subtract(*ends)).max()) / known["radius"]


def largest_differences(known, found):
    """Pair two documents; give how many pairs there are, and the largest difference of angle, offset, radius, ends."""
    score = evaluate(known, found)
    if not score.pairs:
        return 0, [None] * 4
    ours, theirs = ({entry["id"]: entry for entry in document["cylinders"]} for document in (known, found))
    ends = max(end_difference(ours[pair.truth_id], theirs[pair.result_id]) for pair in score.pairs)
    return score.matched, [score.angle_deg.max, score.offset.max, 100 * score.radius.max, ends]


def compare_copies(scene, folder, copies, bars, bar):
    """Print the rows of a scene."""
    truth = json.loads(truth_of(scene).read_text(encoding="utf-8"))
    points = read_cloud(scene).points
    original = extract(Copy("itself").write(points, folder), folder)[1]
    if original is None:
        print_row(scene.stem, "itself", *["-"] * (len(COLUMNS) - 2), bars.at_most(None, bar))
        return
    print_row(scene.stem, "itself", evaluate(truth, original).f1, str(len(original["cylinders"])), *[""] * 6)
    for copy in copies:
        path = copy.write(points, folder)
        result = extract(path, folder)[1] or {"cylinders": []}
        path.unlink()
        known = copy.document(original)
        same, differences = largest_differences(known, result)
        whole = same == len(known["cylinders"]) == len(result["cylinders"])
        verdict = bars.at_most(differences[1] if whole else None, bar) if copy.exact else ""
        f1 = evaluate(copy.document(truth), result).f1
        print_row(scene.stem, copy.name, f1, str(len(result["cylinders"])), str(same), *differences, verdict)


def main():
    """Print the rows of all scenes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", metavar="SCENE.ply", nargs="+", type=Path)
    parser.add_argument("--only", nargs="+", choices=[copy.name for copy in COPIES], metavar="COPY", help="some copies")
    parser.add_argument(
        "--max-offset",
        type=float,
        metavar="BAR",
        help="exit with 1 if a copy that is not turned has other cylinders, or an axis that is farther off, in radii",
    )
    a = parser.parse_args()
    require_scenes(a.scenes)
    print_header(*COLUMNS, "bar")
    bars = Bars()
    with tempfile.TemporaryDirectory() as folder:
        warm_up(folder)
        for scene in a.scenes:
            chosen = [copy for copy in COPIES if not a.only or copy.name in a.only]
            compare_copies(scene, folder, chosen, bars, a.max_offset)
    return bars.exit_code()


if __name__ == "__main__":
    sys.exit(main())
