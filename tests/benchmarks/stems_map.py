"""Draw a GeoPackage of stems over the cloud it is from: docs/pictures/stems-map.png.

    python stems_map.py

A made plot is moved to UTM zone 32 and written as LAS with that CRS, `cylx stems` writes the GeoPackage, and another
reader, pyogrio, reads it. Matplotlib draws both in the coordinates that each file says.
"""

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

import laspy
import numpy as np
import pyogrio
import shapely
from pictures import PICTURES, can_draw, open_picture, save_picture
from pyproj import CRS
from runs import CYLX

from cylx.synthetic import forest

EPSG, CORNER = 25832, np.array([691600.0, 5334700.0, 515.0])


def write_las(path, points):
    """Write points as LAS with the CRS."""
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.offsets, header.scales = CORNER, [0.0001] * 3
    header.add_crs(CRS.from_epsg(EPSG))
    las = laspy.LasData(header)
    las.x, las.y, las.z = points.T
    las.write(path)


def layers_of(path):
    """Give the (columns, geometries, code of the CRS) of each layer of a GeoPackage, by its name."""
    found = {}
    for name, _ in pyogrio.list_layers(path):
        about, _, shapes, columns = pyogrio.raw.read(path, layer=name)
        found[name] = (
            dict(zip(about["fields"], columns, strict=True)),
            shapely.from_wkb(shapes),
            CRS(about["crs"]).to_epsg(),
        )
    return found


def draw(axis, cloud, layers):
    """Draw what is about breast height of the cloud, and each stem as a circle of its diameter, with its axis."""
    (columns, feet, code), (_, lines, same) = layers["stems"], layers["axes"]
    assert code == same == EPSG
    x, y, z = cloud.T
    nearest, level = np.full(len(z), np.inf), np.zeros(len(z))
    for foot, ground in zip(feet, columns["ground"], strict=True):  # the ground is that of the nearest stem
        away = np.hypot(x - foot.x, y - foot.y)
        level[away < nearest] = ground
        nearest = np.minimum(nearest, away)
    near = np.abs(z - level - 1.3) < 0.2
    axis.scatter(x[near], y[near], s=0.3, c="#555555", linewidths=0, rasterized=True)
    turn = np.linspace(0.0, 2.0 * np.pi, 73)
    for line, dbh, ground in zip(lines, columns["dbh"], columns["ground"], strict=True):
        places = shapely.get_coordinates(line, include_z=True)
        middle = [np.interp(ground + 1.3, places[:, 2], places[:, d]) for d in (0, 1)]
        axis.plot(*places[:, :2].T, color="#1f77b4", linewidth=1.2)
        axis.plot(
            middle[0] + 0.5 * dbh * np.cos(turn), middle[1] + 0.5 * dbh * np.sin(turn), c="#d62728", linewidth=0.9
        )
        place = (middle[0] + 0.5 * dbh, middle[1])
        axis.annotate(f"{100 * dbh:.1f} cm", place, xytext=(3, 3), textcoords="offset points", fontsize=7)
    axis.set_aspect("equal")
    axis.ticklabel_format(useOffset=False, style="plain")
    axis.tick_params(labelsize=7)
    axis.set_xlabel("easting, m")
    axis.set_ylabel("northing, m")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pictures", type=Path, default=PICTURES, metavar="FOLDER", help="default: docs/pictures")
    a = parser.parse_args()
    if not can_draw():
        return 2
    plot = forest(11, side=10.0, spacing=0.015, slope=0.2)
    with tempfile.TemporaryDirectory() as folder:
        scan, base = Path(folder) / "plot.las", Path(folder) / "plot.gpkg"
        write_las(scan, plot.points + CORNER)
        subprocess.run([*CYLX, "stems", scan, "--ground", "lowest", "-o", base], check=True)
        figure, (axis,) = open_picture()
        figure.set_size_inches(5.2, 5.2)
        draw(axis, np.asarray(laspy.read(scan).xyz), layers_of(base))
    save_picture(figure, a.pictures, "stems-map", "A GeoPackage of stems, drawn over the points at breast height")
    return 0


if __name__ == "__main__":
    sys.exit(main())
