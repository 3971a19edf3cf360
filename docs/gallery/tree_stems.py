# %% [markdown]
# # Tree stems
#
# Foresters measure the diameter of a stem at breast height, 1.3 m above the ground. A stem is no cylinder: it tapers,
# and its bark is rough. A piece of it is nearly one.

# %%
import numpy as np

import cylx

rng = np.random.default_rng(12)

# %% [markdown]
# Twelve stems about a scanner, in metres, each seen from one side only. They taper by a centimetre of diameter a metre,
# lean a little, and stand on uneven ground. Bark and the edges of the beam give 4 mm of noise; there is undergrowth.

# %%
BREAST = 1.3
STEMS = 12


def ground(x, y):
    """Give the height of the ground, metres."""
    return 0.1 * np.sin(0.4 * x) + 0.05 * y


bearings = np.linspace(0, 2 * np.pi, STEMS, endpoint=False) + 0.15 * rng.standard_normal(STEMS)
ranges = rng.uniform(4, 9, STEMS)
diameters = rng.uniform(0.15, 0.45, STEMS)
feet = np.column_stack([ranges * np.cos(bearings), ranges * np.sin(bearings)])

parts, truth = [], []
for (x, y), bearing, diameter in zip(feet, bearings, diameters, strict=True):
    lean = 0.03 * rng.standard_normal(2)
    heights = rng.uniform(0, 4, 5000)
    angles = bearing + np.pi + rng.uniform(-1.4, 1.4, 5000)  # the side that the scanner sees
    radii = diameter / 2 - 0.005 * (heights - BREAST)
    middles = np.array([x, y]) + np.outer(heights, lean)
    around = middles + radii[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
    parts.append(np.column_stack([around, ground(x, y) + heights]))
    truth.append([x + BREAST * lean[0], y + BREAST * lean[1], diameter])
truth = np.array(truth)
floor = rng.uniform(-10, 10, (30_000, 2))
parts.append(np.column_stack([floor, ground(*floor.T)]))
bushes = rng.uniform(-10, 10, (3000, 2))
parts.append(np.column_stack([bushes, ground(*bushes.T) + rng.exponential(0.4, 3000)]))
points = np.concatenate(parts)
points += 0.004 * rng.standard_normal(points.shape)

# %% [markdown]
# Only the piece about breast height takes part, at each place as high above its ground: the ground is the lowest point
# of each square metre. Stems are upright, so cylinders that tilt by more than ten degrees are not asked for.

# %%
cells = np.floor(points[:, :2]).astype(int) + 20
keys = cells[:, 0] * 100 + cells[:, 1]
lowest = np.full(keys.max() + 1, np.inf)
np.minimum.at(lowest, keys, points[:, 2])
above = points[:, 2] - lowest[keys]
piece = points[(above > BREAST - 0.5) & (above < BREAST + 0.5)]
found = cylx.extract(piece, axis="z", axis_tolerance_deg=10, radius=(0.05, 0.4))
found

# %% [markdown]
# Cylinders and stems that stand in the same place, and the diameters of both:

# %%
reference = np.full(len(found.cylinders), np.nan)
for number, fit in enumerate(found.cylinders):
    away = np.hypot(*(truth[:, :2] - fit.cylinder.point[:2]).T)
    if away.min() < 0.1:
        reference[number] = truth[away.argmin(), 2] / 2
errors = np.array([fit.cylinder.radius for fit in found.cylinders]) - reference
matched = ~np.isnan(reference)
print(f"{matched.sum()} of {STEMS} stems, {(~matched).sum()} cylinders that are none")
mean, largest = 2000 * errors[matched].mean(), 2000 * np.abs(errors[matched]).max()
print(f"diameter at breast height: mean error {mean:.1f} mm, largest {largest:.1f} mm")

# %%
cylx.plot_radii(found, reference).savefig("tree_stems.png", dpi=75)
