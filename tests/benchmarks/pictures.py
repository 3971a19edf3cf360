"""Draw the pictures of docs/benchmarks.md; matplotlib does, which `pip install 'cylx[bench]'` brings."""

import os
import sys
from importlib.util import find_spec
from pathlib import Path

from runs import ROOT

PICTURES = ROOT / "docs" / "pictures"
COLORS = ("#1f77b4", "#d62728", "#2ca02c", "#9467bd")


def can_draw():
    """Say whether there is something to draw with; complain if not."""
    if find_spec("matplotlib") is None:
        print("no pictures: matplotlib is missing; pip install 'cylx[bench]'", file=sys.stderr)
        return False
    return True


def open_picture(panels=1):
    """Open a picture with so many panels beside each other; return it and its panels."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(1, panels, figsize=(5.2 * panels, 3.4), layout="constrained", squeeze=False)
    for axis in axes[0]:
        axis.grid(visible=True, which="major", color="#dddddd", linewidth=0.6)
        axis.set_axisbelow(True)
    return figure, list(axes[0])


def mark_values(axis, values):
    """Put the ticks of the horizontal axis where the values are."""
    axis.set_xticks(values, [f"{value:g}" for value in values])
    axis.minorticks_off()


def save_picture(figure, folder, name, caption):
    """Write a picture, and print the line that shows it on the page."""
    from matplotlib import pyplot

    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{name}.png"
    figure.savefig(path, dpi=110, metadata={"Software": None})
    pyplot.close(figure)
    print(f"\n![{caption}]({Path(os.path.relpath(path, ROOT / 'docs')).as_posix()})\n", flush=True)
