"""A plant made in pieces, extracted as a whole and in tiles: what is found, how long it takes, how much memory.

A piece is a rack of 6 x 6 m with fifteen pipes in layers, which lie on I-beams, and a floor; four more pipes run
through all pieces of a row. The memory is that of all processes together, looked at up to ten times a second.

With `--kept`, what was measured is written down run by run, and is not measured again: a plant of 100 M points takes
hours on a machine that has other work. The picture has all that is kept. What was not measured to its end may be added
there by hand with `"projected": true`; it is drawn as an open circle, and does not count for the slope.
"""

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
from contextlib import contextmanager
from pathlib import Path

import laspy
import numpy as np
from pictures import COLORS, PICTURES, can_draw, open_picture, save_picture
from runs import CYLX, truth_of, warm_up
from tables import Bars, print_header, print_row

from cylx.evaluation import evaluate

SIDE, LARGEST, OF_LAYER, HEADERS, SIGMA = 6.0, (0.2, 0.08, 0.15), 5, 4, 0.002
BEAMS, BEAM = (1.0, 3.0, 5.0), 0.1
A_PIECE = 1_000_000
WHOLE = "whole, one thread"
LOOKS = 50.0
"""Times that a look at the memory takes until the next one: the kernel walks through all pages."""


def layout(rng, corner):
    """Give the pipes of a piece: (start, end, radius, seen angle), and the height that each layer lies on."""
    pipes, heights, z = [], [], 0.4
    for layer, most in enumerate(LARGEST):
        heights.append(z)
        radii = np.exp(rng.uniform(np.log(0.025), np.log(most), OF_LAYER))
        gaps = rng.dirichlet(np.full(OF_LAYER + 1, 2.0)) * (SIDE - 0.4 - 2.0 * radii.sum() - 0.05 * OF_LAYER) + 0.05
        across = 0.2
        for radius, gap in zip(radii, gaps, strict=False):
            across += gap + radius
            length = rng.uniform(2.0, SIDE - 0.2)
            first = rng.uniform(0.1, SIDE - 0.1 - length)
            place = z + radius
            ends = [(first, across, place), (first + length, across, place)]
            if layer % 2:
                ends = [(y, x, h) for x, y, h in ends]
            seen = np.radians(rng.uniform(160.0, 360.0))
            pipes.append((*(np.array(end) + corner for end in ends), float(radius), seen))
            across += radius
        z += 2.0 * most + 0.2
    return pipes, heights


def on_beam(rng, place, height, turned, count):
    """Give points on the two flanges and the web of a beam below a layer of pipes, across them."""
    along, (across, down) = SIDE * rng.random(count), BEAM * rng.random((2, count))
    part = rng.integers(3, size=count)
    across[part == 2] = 0.5 * BEAM
    down[part < 2] = BEAM * part[part < 2]
    x, z = place + across, height - down
    return np.column_stack([along, x, z] if turned else [x, along, z])


def on_pipe(rng, start, end, radius, seen, count):
    """Give points on a pipe."""
    along = (end - start) / np.linalg.norm(end - start)
    across = np.cross(along, [0.0, 0.0, 1.0])
    up = np.cross(across, along)
    turn = 0.5 * np.pi + seen * (rng.random(count) - 0.5)
    at = start + rng.random(count)[:, None] * (end - start)
    return at + radius * (np.cos(turn)[:, None] * across + np.sin(turn)[:, None] * up)


def piece(seed, column, row, headers):
    """Give the points and the pipes of a piece; the headers are those of its row."""
    rng = np.random.default_rng([7, seed, column, row])
    corner = np.array([column * SIDE, row * SIDE, 0.0])
    pipes, heights = layout(rng, corner)
    step = np.array([SIDE, 0.0, 0.0])
    through = [(np.array([corner[0], y, z]), np.array([corner[0], y, z]) + step, r, 2 * np.pi) for y, z, r in headers]
    areas = np.array([np.linalg.norm(b - a) * r * seen for a, b, r, seen in [*pipes, *through]])
    floor, beam = SIDE * SIDE, 3.0 * SIDE * BEAM
    total = areas.sum() + 0.5 * floor + len(BEAMS) * len(LARGEST) * beam
    counts = (A_PIECE * areas / total).astype(int)
    points = [on_pipe(rng, *one, n) for one, n in zip([*pipes, *through], counts, strict=True)]
    flat = int(A_PIECE * beam / total)
    for layer, height in enumerate(heights):
        points += [corner + on_beam(rng, place, height, layer % 2, flat) for place in BEAMS]
    left = A_PIECE - sum(map(len, points))
    points.append(corner + rng.random((left, 3)) * [SIDE, SIDE, 0.0])
    cloud = np.concatenate(points)
    cloud += SIGMA * rng.standard_normal(cloud.shape)
    return cloud[rng.permutation(A_PIECE)], pipes


@contextmanager
def writer(path, points):
    """Yield what writes pieces of a cloud as LAZ, to a tenth of a millimetre, or as NPY."""
    if path.suffix == ".npy":
        with path.open("wb") as file:
            about = {"descr": "<f8", "fortran_order": False, "shape": (points, 3)}
            np.lib.format.write_array_header_1_0(file, about)
            yield lambda cloud: file.write(cloud.tobytes())
        return
    header = laspy.LasHeader(version="1.4", point_format=6)
    header.scales = np.full(3, 1e-4)

    def write(cloud):
        record = laspy.ScaleAwarePointRecord.zeros(len(cloud), header=header)
        record.x, record.y, record.z = cloud.T
        file.write_points(record)

    with laspy.open(path, "w", header=header) as file:
        yield write


def make(path, pieces, seed):
    """Write a plant of so many pieces, piece by piece, and its truth."""
    columns = int(np.ceil(np.sqrt(pieces)))
    truth, rng = [], np.random.default_rng([8, seed])
    rows = [
        [(r * SIDE + 0.5 + 1.4 * k, 3.2 + 0.3 * k, float(rng.uniform(0.05, 0.12))) for k in range(HEADERS)]
        for r in range(-(-pieces // columns))
    ]
    with writer(path, pieces * A_PIECE) as write:
        for number in range(pieces):
            row, column = divmod(number, columns)
            points, pipes = piece(seed, column, row, rows[row])
            write(points)
            truth += [(start, end, radius) for start, end, radius, _ in pipes]
    for r, headers in enumerate(rows):
        length = SIDE * min(columns, pieces - r * columns)
        truth += [(np.array([0.0, y, z]), np.array([length, y, z]), radius) for y, z, radius in headers]
    entries = [
        {
            "id": i,
            "axis_point": (0.5 * (start + end)).tolist(),
            "axis_direction": ((end - start) / np.linalg.norm(end - start)).tolist(),
            "radius": radius,
            "height": float(np.linalg.norm(end - start)),
            "ignore": False,
        }
        for i, (start, end, radius) in enumerate(truth)
    ]
    truth_of(path).write_text(json.dumps({"points": pieces * A_PIECE, "cylinders": entries}), encoding="utf-8")


def weight(process):
    """Give the proportional share of the memory of a process and all below it, mapped files included, MB."""
    total = 0.0
    try:
        about = Path(f"/proc/{process}/smaps_rollup").read_text(encoding="ascii")
        total = int(about.split("\nPss:")[1].split()[0]) / 1e3
        children = Path(f"/proc/{process}/task/{process}/children").read_text(encoding="ascii").split()
    except (OSError, IndexError):
        return total
    return total + sum(weight(int(child)) for child in children)


def watched(command):
    """Run a command; give its exit code, seconds, seconds of processors, and peak memory."""
    started, before, peak = time.perf_counter(), used(), 0.0
    with subprocess.Popen([str(word) for word in command], stderr=subprocess.DEVNULL) as child:
        while child.poll() is None:
            began = time.perf_counter()
            peak = max(peak, weight(child.pid))
            time.sleep(max(0.1, LOOKS * (time.perf_counter() - began)))
    return child.returncode, time.perf_counter() - started, used() - before, peak


def used():
    """Give the seconds of processors that all processes begun here have taken, once they have ended."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def run_of(scene, folder, extra):
    """Extract a scene; give what was measured as plain data, with the name of the result."""
    output = Path(folder) / f"{scene.stem}-{'tiled' if extra else 'whole'}.json"
    profile = output.with_suffix(".profile.json")
    command = [*CYLX, "extract", scene, "-o", output, "--overwrite", "--quiet", "--no-annotate", "--profile", profile]
    command += extra
    code, seconds, busy, peak = watched(command)
    row = {"code": code, "seconds": seconds, "busy": busy, "peak": peak, "result": str(output)}
    if code == 0:
        result, truth = (json.loads(path.read_text(encoding="utf-8")) for path in (output, truth_of(scene)))
        tiles = result.get("tiles", {"count": 1, "joined": 0})
        row |= {"points": truth["points"], "f1": evaluate(truth, result).f1, "pipes": len(truth["cylinders"])}
        row |= {"tiles": tiles["count"], "joined": tiles["joined"]}
        row["stages"] = json.loads(profile.read_text(encoding="utf-8"))["inputs"][0]["stages"]
    return row


def show(scene, run, row, bars, most):
    """Print the row of a run."""
    if row["code"]:
        print_row(scene.stem, run, *["-"] * 8)
        return
    verdict = bars.at_most(row["peak"], most) if run != WHOLE else ""
    counts = str(row["pipes"]), f"{row['f1']:.4f}", str(row["tiles"]), str(row["joined"])
    per_point = row["busy"] / row["points"] * 1e6
    times = f"{row['seconds']:.0f}", f"{row['busy']:.0f}", f"{per_point:.1f}"
    print_row(scene.stem, run, *counts, *times, f"{row['peak']:.0f}", verdict)
    sys.stdout.flush()


def slope_of(rows):
    """Give the slope of processor seconds over points, both logarithmic."""
    points, seconds = (np.log([row[name] for row in rows]) for name in ("points", "busy"))
    return float(np.polyfit(points, seconds, 1)[0])


def draw(kept, folder):
    """Draw time and memory of the runs in tiles, and of those in one piece, by the number of points."""
    figure, (left, right) = open_picture(panels=2)
    for number, name in enumerate(("in tiles", WHOLE)):
        rows = [row for key, row in kept.items() if not row["code"] and key.endswith(f" {WHOLE}") == (name == WHOLE)]
        rows.sort(key=lambda row: row["points"])
        projected = [row for row in rows if row.get("projected")]
        rows = [row for row in rows if row not in projected]
        if not rows:
            continue
        points = [row["points"] for row in rows]
        told = f"{name}, slope {slope_of(rows):.2f}" if len(rows) > 1 else name
        left.plot(points, [row["busy"] for row in rows], "o-", color=COLORS[number], label=told)
        right.plot(points, [row["peak"] for row in rows], "o-", color=COLORS[number], label=name)
        for row in projected:
            left.plot(row["points"], row["busy"], "o", color=COLORS[number], fillstyle="none", label="projected")
    left.set_ylabel("seconds of processors")
    right.set_ylabel("peak memory of all processes, MB")
    for axis in (left, right):
        axis.set_xscale("log")
        axis.set_yscale("log")
        axis.set_xlabel("points")
        axis.legend(frameon=False, fontsize="small")
    save_picture(figure, folder, "tiles", "seconds of processors and peak memory by the number of points, in tiles")


def main():
    """Print a row a run, the differences that tiles make, and the picture."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "scenes", metavar="SCENE.laz", nargs="*", type=Path, help="made if missing: plant3.laz has 3 M points"
    )
    parser.add_argument("--whole", action="store_true", help="extract each without tiles, too, and compare")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--memory", default="2GB")
    parser.add_argument("--scratch", type=Path, help="folder for the tiles and the results (default: a temporary one)")
    parser.add_argument("--kept", type=Path, metavar="FILE.json", help="what was measured before, and is from now on")
    parser.add_argument("--pictures", type=Path, default=PICTURES, help="where they go (default: docs/pictures)")
    a = parser.parse_args()
    kept = json.loads(a.kept.read_text(encoding="utf-8")) if a.kept is not None and a.kept.is_file() else {}
    bars, most = Bars(), float(a.memory.removesuffix("GB")) * 1000
    tiled = f"tiles, {a.memory}, {a.jobs} process{'es' if a.jobs != 1 else ''}"
    heads = "scene", "run", "pipes", "F1", "tiles", "joined", "seconds", "of processors", "µs a point", "peak MB", "bar"
    print_header(*heads)
    with tempfile.TemporaryDirectory() as temporary:
        folder = a.scratch or Path(temporary)
        extra = ("--tile", "auto", "--memory", a.memory, "--jobs", str(a.jobs), "--scratch", folder, "--resume")
        warm_up(folder)
        for scene in a.scenes:
            if not (scene.is_file() and truth_of(scene).is_file()):
                make(scene, int("".join(filter(str.isdigit, scene.stem))), 0)
            for run in (tiled, *([WHOLE] if a.whole else ())):
                key = f"{scene.stem} {run}"
                if key not in kept or kept[key]["code"]:
                    kept[key] = run_of(scene, folder, extra if run == tiled else ("--threads", "1"))
                    if a.kept is not None:
                        a.kept.write_text(json.dumps(kept, indent=1), encoding="utf-8")
                show(scene, run, kept[key], bars, most)
            results = [kept[f"{scene.stem} {run}"]["result"] for run in (WHOLE, tiled) if f"{scene.stem} {run}" in kept]
            if len(results) == 2 and all(Path(one).is_file() for one in results):
                subprocess.run([*CYLX, "diff", *results], check=False)
    if can_draw() and kept:
        draw(kept, a.pictures)
    return bars.exit_code()


if __name__ == "__main__":
    sys.exit(main())
