"""Scenes for tiles, and runs of them: pipes where they are wanted, of points anywhere."""

from contextlib import contextmanager

import numpy as np

from cylx.config import Config
from cylx.io import open_scratch, stream_arrays
from cylx.records import Selection, SilentObserver
from cylx.results import Result
from cylx.tiles import run as tiled
from cylx.tiles.schedule import Here

NOISE = 0.002


def pipe(rng, start, end, radius, points, arc=2 * np.pi):
    """Give points on a cylinder between two ends, seen over an arc."""
    start, end = np.array(start, float), np.array(end, float)
    length = np.linalg.norm(end - start)
    along = (end - start) / length
    across = np.cross(along, [0.3, 0.5, 0.9])
    across /= np.linalg.norm(across)
    other = np.cross(along, across)
    turn, height = rng.uniform(0, arc, points), rng.uniform(0, length, points)
    ring = np.cos(turn)[:, None] * across + np.sin(turn)[:, None] * other
    return start + height[:, None] * along + radius * ring


def plane(rng, low, high, points):
    """Give points on a box that is flat along one axis."""
    return rng.uniform(low, high, (points, 3))


def scene(rng, *pieces):
    """Join pieces to a cloud with noise, in any order."""
    points = np.concatenate(pieces)
    points = points + NOISE * rng.standard_normal(points.shape)
    return points[rng.permutation(len(points))]


def truth(*cylinders):
    """Give the truth of (start, end, radius) as `cylx evaluate` and `cylx diff` take it."""
    entries = []
    for i, (first, last, radius) in enumerate(cylinders):
        start, end = np.array(first, float), np.array(last, float)
        length = float(np.linalg.norm(end - start))
        entries.append(
            {
                "id": i,
                "axis_point": (0.5 * (start + end)).tolist(),
                "axis_direction": ((end - start) / length).tolist(),
                "radius": radius,
                "height": length,
                "ignore": False,
            }
        )
    return {"cylinders": entries}


@contextmanager
def outcome_of(points, folder, *, size=None, buffer=None, config=None, runner=None, rejected=False, selection=None):
    """Extract a cloud in tiles of a size, and yield the outcome, while the scratch folder is there."""
    options = tiled.Options(size, buffer, 2e9, 1, rejected)
    with open_scratch(folder, "result", {}, resume=False) as scratch:
        clouds = [stream_arrays([points], scratch.path("spool"))]
        config, runner = config or Config(), runner or Here()
        yield tiled.extract_in_tiles(
            clouds, selection or Selection(), config, options, scratch, runner, SilentObserver()
        )


def in_tiles(points, folder, *, most=None, monkeypatch=None, **how):
    """Extract a cloud in tiles, of a size or of so many points; give the extraction and the labels of all rows."""
    if most is not None:
        monkeypatch.setattr(tiled, "points_for", lambda memory: most)
    with outcome_of(points, folder, **how) as outcome:
        pieces = list(outcome.labels.pieces(0, len(points), 1 << 16))
    labels, residuals = (np.concatenate(one) for one in zip(*pieces, strict=True))
    return outcome.extraction, labels, residuals


def document(extraction):
    """Give the JSON object of an extraction."""
    return Result.of(extraction).to_object()
