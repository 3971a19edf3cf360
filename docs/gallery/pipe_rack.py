# %% [markdown]
# # A pipe rack
#
# Eight pipes of standard diameters on a rack, scanned from below. Which standard pipe is each, and is any of them
# damaged?

# %%
import numpy as np

import cylx
from cylx.geometry.cylinder import Cylinder, cylinder_coordinates
from cylx.synthetic.surfaces import Box, Mantle

rng = np.random.default_rng(8)

# %% [markdown]
# The scene, in millimetres: two layers of four pipes on posts with crossbars. Real pipes scatter by some tenths of a
# millimetre about their nominal diameter.

# %%
NOMINAL = {"DN50": 60.3, "DN65": 76.1, "DN80": 88.9, "DN100": 114.3, "DN150": 168.3}
LAYERS = [["DN50", "DN150", "DN80", "DN100"], ["DN100", "DN50", "DN65", "DN150"]]
LENGTH = 3000.0

names, pipes, bars = [], [], []
for layer, row in enumerate(LAYERS):
    level = 2500.0 + 700.0 * layer
    for column, name in enumerate(row):
        diameter = NOMINAL[name] + 0.1 * rng.standard_normal()
        middle = (0.0, 350.0 * column, level + diameter / 2)
        names.append(name)
        pipes.append(Mantle(Cylinder(middle, (1, 0, 0), diameter / 2, LENGTH), 0.0, 2 * np.pi))
    for x in (-1000.0, 1000.0):
        bars.append(Box(np.array([x, 525.0, level - 50]), np.array([100.0, 1700.0, 100.0]), np.eye(3)))
surfaces = [*pipes, *bars]
area = sum(surface.area for surface in surfaces)
clean = [surface.sample(rng, int(120_000 * surface.area / area)) for surface in surfaces]

# The scanner stands below: the upper side of each pipe is not seen. Something hit the second pipe from below.
for place, pipe in enumerate(pipes):
    heights, distances, _ = cylinder_coordinates(clean[place], pipe.shape.point, pipe.shape.direction)
    outward = (clean[place] - pipe.shape.point - np.outer(heights, pipe.shape.direction)) / distances[:, None]
    if place == 1:
        depth = 3.0 * np.exp(-0.5 * ((heights - 600) / 60) ** 2) * np.clip(-outward[:, 2], 0, None) ** 4
        clean[place] -= depth[:, None] * outward
    clean[place] = clean[place][outward[:, 2] < 0.35]
points = np.concatenate(clean)
points += rng.standard_normal(points.shape)

# %% [markdown]
# With a catalogue, each radius is drawn to the nominal one that its points bear out, and to none where they do not.

# %%
catalogue = [{"name": name, "radius": diameter / 2, "tolerance": 0.1} for name, diameter in NOMINAL.items()]
found = cylx.extract(points, catalogue=catalogue)
found

# %%
for number, fit in enumerate(found.cylinders):
    match = fit.nominal
    layer, column = round((fit.cylinder.point[2] - 2550) / 700), round(fit.cylinder.point[1] / 350)
    print(
        f"{number}: layer {layer}, place {column}: {match.decision} {match.name:5} "
        f"measured {2 * match.free_radius:6.2f} ± {2 * match.free_radius_sd:.2f} mm"
    )

# %% [markdown]
# A pipe that was hit is still a pipe. The residuals of its points tell: here the mean of each piece of 50 mm.

# %%
dents = []
for number, fit in enumerate(found.cylinders):
    own = found.labels == number
    heights = (found.cloud.points[own] - fit.cylinder.start) @ fit.cylinder.direction
    pieces = (heights / 50).astype(int)
    counts = np.bincount(pieces)
    means = np.bincount(pieces, found.residuals[own]) / np.maximum(counts, 1)
    dents.append((means[counts > 20].min(), number))
(deepest, dented), (usual, _) = sorted(dents)[:2]
print(f"cylinder {dented} lies {-deepest:.2f} mm inside in one piece, all others {-usual:.2f} mm at most")

# %%
cylx.plot_residuals(found, dented).savefig("pipe_rack.png", dpi=75)
