# %% [markdown]
# # A regression check
#
# A scan and its checked result are kept. Whenever something changes, be it the plant, a program that prepares scans, or
# cylx, the new result is compared with what was checked. This is what `cylx diff` does, in Python and with a picture.

# %%
import json
from pathlib import Path

import numpy as np

import cylx
from cylx.evaluation import Tolerances

SCAN, CHECKED = Path("sample_data/pipes.ply"), Path("sample_data/golden/pipes.cylinders.json")

# %% [markdown]
# Nothing has changed but the seed, which draws other planes and other samples: the same cylinders.

# %%
checked = json.loads(CHECKED.read_text(encoding="utf-8"))
again = cylx.extract(SCAN, seed=1)
outcome = cylx.compare(checked, cylx.to_dict(again))
print("same" if outcome.same else "different", "of", outcome.cylinders_a, "cylinders")

# %% [markdown]
# Now the plant changes: the pipe with id 2 is exchanged for one that is 3 % thicker, and that with id 5 is taken away.


# %%
def nearest(point, cylinders):
    """Give the place in a list of the checked cylinder whose middle is nearest to a point."""
    return min(range(len(cylinders)), key=lambda i: np.linalg.norm(point - cylinders[i]["axis_point"]))


points, keep = again.cloud.points.copy(), np.ones(len(again.labels), bool)
for number, fit in enumerate(again.cylinders):
    shape, own = fit.cylinder, again.labels == number
    which = nearest(shape.point, checked["cylinders"])
    if which == 2:
        heights = (points[own] - shape.point) @ shape.direction
        axis = shape.point + np.outer(heights, shape.direction)
        points[own] = axis + 1.03 * (points[own] - axis)
    elif which == 5:
        keep &= ~own

# %%
changed = cylx.extract(points[keep])
outcome = cylx.compare(checked, cylx.to_dict(changed), tolerances=Tolerances(radius=0.01))
for one in outcome.differences:
    change = "" if one.b is None else f", {one.what} {one.a:.4f} -> {one.b:.4f}"
    print(f"{one.kind}: cylinder {one.id_a}{change}")

# %% [markdown]
# In CI a difference ends the job: `assert outcome.same`, or the command `cylx diff`, whose exit code is then 1.
#
# The picture shows each radius against the checked one, with bars of two standard deviations: the change of 3 % is many
# of them, and so is no noise.

# %%
checked_radii = [one["radius"] for one in checked["cylinders"]]
reference = [checked_radii[nearest(fit.cylinder.point, checked["cylinders"])] for fit in changed.cylinders]
cylx.plot_radii(changed, reference).savefig("ci_regression.png", dpi=75)
