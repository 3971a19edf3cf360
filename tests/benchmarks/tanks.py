"""`cylx deviation` on made tanks against their truth, by the command: place, radius, ovality, taper and a dent.

    python tanks.py

Each tank has 60 000 points with a noise of 2 mm, a radius of 3 m and a height of 8 m, and stands 4 mm beside its
design. Values are given with one standard deviation.
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from runs import CYLX, ROOT
from tables import print_header, print_row

sys.path.insert(0, str(ROOT))
from tests.support.tanks import tank

SHIFT = 0.004
CASES = {
    "dent of 20 mm": {},
    "dent of 10 mm": {"dent": 0.01},
    "no dent": {"dent": 0.0},
    "oval by 30 mm, dent of 20 mm": {"oval": 0.03},
    "taper of 2 mm/m, dent of 20 mm": {"taper": 0.002},
    "half seen, dent of 20 mm": {"arc": np.pi},
    "lying, dent of 20 mm": {"direction": (0.6, 0.8, 0.0)},
    "noise of 6 mm, dent of 20 mm": {"noise": 0.006},
}


def measured(folder, seed, case):
    """Run the command on a tank; give the design with its truth, and the entry of the JSON."""
    points, shape, _ = tank(seed=seed, **case)
    aside = np.cross(shape.direction, [0.36, 0.48, 0.8])
    points = points + SHIFT * aside / np.linalg.norm(aside)
    scan, design, out = (Path(folder) / name for name in ("tank.npy", "design.csv", "tank.deviation.json"))
    np.save(scan, points)
    numbers = ",".join(repr(float(x)) for x in (*shape.start, *shape.end, shape.radius))
    design.write_text(f"name,start_x,start_y,start_z,end_x,end_y,end_z,radius\ntank,{numbers}\n", encoding="utf-8")
    subprocess.run([*CYLX, "deviation", scan, design, "-o", out, "--overwrite"], check=True, capture_output=True)
    (entry,) = json.loads(out.read_text(encoding="utf-8"))["cylinders"]
    return entry


def told(value, sd, unit=1000.0):
    """Write a value with its standard deviation, in thousandths."""
    return "-" if value is None else f"{unit * value:.2f} ± {unit * sd:.2f}"


def main():
    print_header("tank", "seen", "offset, mm", "radius, mm", "ovality, mm", "taper, mm/m", "dents, mm", "others, mm")
    with tempfile.TemporaryDirectory() as folder:
        for seed, (name, case) in enumerate(CASES.items()):
            entry = measured(folder, seed, case)
            off, form, patches = entry["difference"], entry["form"], entry["patches"]
            dents = [told(one["depth"], one["depth_sd"]) for one in patches if one["kind"] == "dent"]
            bulges = [told(one["depth"], one["depth_sd"]) for one in patches if one["kind"] == "bulge"]
            print_row(
                name,
                f"{entry['built']['coverage_deg']:.0f}°",
                told(off["offset"], off["offset_sd"]),
                told(off["radius"], off["radius_sd"]),
                told(form.get("ovality"), form.get("ovality_sd", 0.0)),
                told(form["taper"], form["taper_sd"]),
                ", ".join(dents) or "none",
                ", ".join(bulges) or "none",
            )


if __name__ == "__main__":
    main()
