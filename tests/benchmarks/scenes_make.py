"""Make the scenes of the benchmarks, with the scene generators and the real scans of `../shared`.

They are determined by their names: the same name gives the same file anywhere. Files that are there already are kept.
Those of three million points and more are only made with --large, or where --only names them.
"""

import argparse
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

from runs import SHARED, give_up

YCB, SYNTHETIC = "ycb_scenes.py", "scenes.py"
SEEDS = range(3)


def clutter(size, points, *options):
    """Name the scenes of a room, one a seed."""
    options = ("--points", str(points), *options)
    return {f"clutter{size}_{seed}": (SYNTHETIC, "clutter", seed, options) for seed in SEEDS}


def rack(size, points, seeds=SEEDS):
    """Name the scenes of a plant, one a seed."""
    return {f"rack{size}_{seed}": (SYNTHETIC, "rack", seed, ("--points", str(points))) for seed in seeds}


QUICK = {
    **{f"{name}{seed}": (YCB, name, seed, ()) for name in ("five", "pair", "table", "view") for seed in SEEDS},
    **{f"half{seed}": (YCB, "pair", seed, ("--fraction", "0.5")) for seed in SEEDS},
    **clutter("100k", 100_000, "--cylinders", "10"),
    **clutter("300k", 300_000),
    **clutter("1M", 1_000_000, "--cylinders", "40", "--noise", "0.1"),
    **rack("300k", 300_000, seeds=(0,)),
    **rack("1M", 1_000_000),
}
LARGE = {
    **clutter("5M", 5_000_000, "--cylinders", "40"),
    **rack("3M", 3_000_000),
    **rack("10M", 10_000_000, seeds=(0,)),
}
SCENES = {**QUICK, **LARGE}
MODULES = {YCB: ("numpy", "trimesh", "open3d"), SYNTHETIC: ("numpy",)}


def lacking(shared, programs):
    """Name what is needed to make scenes with these programs, and is not there."""
    files = [shared / "bench" / program for program in sorted(programs)]
    if YCB in programs:
        files += [shared / "data" / "ycb", shared / "data" / "references.json"]
    modules = sorted({module for program in programs for module in MODULES[program]})
    return [str(path) for path in files if not path.exists()] + [
        f"the Python package {module}" for module in modules if find_spec(module) is None
    ]


def main():
    """Make what is asked for and not there yet."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="where the scenes go")
    parser.add_argument("--only", nargs="+", choices=SCENES, metavar="NAME", help=f"some of: {' '.join(SCENES)}")
    parser.add_argument("--large", action="store_true", help=f"also make {' '.join(LARGE)}")
    parser.add_argument("--shared", type=Path, default=SHARED, help="folder with bench/ and data/ (default: ../shared)")
    a = parser.parse_args()
    asked = a.only or (SCENES if a.large else QUICK)
    wanted = {name: SCENES[name] for name in asked if not (a.folder / f"{name}.truth.json").exists()}
    missing = lacking(a.shared, {program for program, *_ in wanted.values()})
    if missing:
        give_up(f"cannot make {' '.join(wanted)}; missing: {', '.join(missing)}")
    a.folder.mkdir(parents=True, exist_ok=True)
    for name, (program, kind, seed, options) in wanted.items():
        output = a.folder / f"{name}.ply"
        command = [a.shared / "bench" / program, kind, output, "--seed", str(seed), *options]
        subprocess.run([sys.executable, *command], check=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
