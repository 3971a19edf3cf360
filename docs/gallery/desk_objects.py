# %% [markdown]
# # Objects on a desk
#
# A depth camera looks at a desk from one side: it sees less than half of each object, and most objects are no
# cylinders. What is found, how certain is it, and what becomes of the rest?

# %%
import numpy as np

import cylx
from cylx.geometry.cylinder import Cylinder
from cylx.synthetic.surfaces import Box, Frustum, Mantle, Sphere

rng = np.random.default_rng(4)

# %% [markdown]
# The scene, in millimetres. The camera is where y is negative, so of what stands upright an arc of 160 degrees is seen.

# %%
UP = np.array([0.0, 0.0, 1.0])
SEEN = np.radians(160)


def standing(x, y, radius, height):
    """Give the side of an upright cylinder that the camera sees."""
    shape = Cylinder((x, y, height / 2), UP, radius, height)
    toward_camera = -np.pi / 2 - np.arctan2(*np.flip(np.cross(UP, [1.0, 0.0, 0.0])[:2]))
    return Mantle(shape, toward_camera - SEEN / 2, SEEN)


desk = Box(np.array([0, 0, -10.0]), np.array([1000.0, 600.0, 20.0]), np.eye(3))
cylinders = {
    "soup can": standing(-250, 50, 33.0, 101),
    "mug": standing(-80, -60, 41.0, 95),
    "lamp stand": standing(300, 100, 12.0, 380),
}
others = {
    "ball": Sphere(np.array([100.0, 80.0, 60.0]), 60.0),
    "book": Box(np.array([-380.0, -120.0, 20.0]), np.array([150.0, 210.0, 40.0]), np.eye(3)),
    "lamp shade": Frustum(np.array([300.0, 100.0, 430.0]), -UP, 40.0, 110.0, 110.0),
}
surfaces = [desk, *cylinders.values(), *others.values()]
area = sum(surface.area for surface in surfaces)
clean = [surface.sample(rng, int(80_000 * surface.area / area)) for surface in surfaces]

# The camera sees the near side of the others, too: of a convex body what faces it.
clean[0] = clean[0][clean[0][:, 2] >= 0]
for place, body in enumerate(others.values(), start=1 + len(cylinders)):
    middle = body.middle if isinstance(body, Frustum) else body.center
    facing = (clean[place] - middle) @ np.array([0.0, -0.8, 0.6]) > 0
    clean[place] = clean[place][facing]
points = np.concatenate(clean)
points += 0.5 * rng.standard_normal(points.shape)

# %%
found = cylx.extract(points)
found

# %% [markdown]
# Each cylinder comes with its standard deviation. Compared with what stands in the same place:

# %%
for fit in found.cylinders:
    away = {name: np.hypot(*(one.shape.point - fit.cylinder.point)[:2]) for name, one in cylinders.items()}
    name = min(away, key=away.get)
    true = cylinders[name].shape
    print(
        f"{name:11} diameter {2 * fit.cylinder.radius:6.2f} ± {2 * fit.radius_sd:.2f} mm, "
        f"true {2 * true.radius:5.1f} mm, seen over {np.degrees(fit.coverage):3.0f}°"
    )

# %% [markdown]
# Ball, book and lamp shade are no cylinders. What was taken for one on the way is kept, with the reason against it:

# %%
print(len(found.rejected), "not accepted:", ", ".join(sorted({one.reason for one in found.rejected})))

# %%
cylx.plot_scene(found).savefig("desk_objects.png", dpi=72)
