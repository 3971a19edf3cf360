"""What a cloud says about itself: its spacing, its noise, its own frame.

The frame has the spacing as its unit, the corner of the cloud as its zero and the Morton curve as the order of the
points. All stages work in it, which is why unit, origin and order of the points do not change a result.
"""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from cylx.config import Config
from cylx.errors import InputError
from cylx.geometry.bounding_box import box_of, extent_of, fill_scatter, widest_deviation
from cylx.geometry.morton import BITS, morton_codes
from cylx.records import Frame, Noise, Scene, cell_keys
from cylx.scene.noise import measure_surface
from cylx.scene.noise_variation import noise_by_place, noise_by_size

FloatArray = NDArray[np.float64]
IndexArray = NDArray[np.int64]


STRAY = 40.0
"""A cloud this many times as wide as its points deviate from their mean may have strays: a few points far away."""
FAR = 1024.0
"""Points further from the others than this, in widths of 98 % of them, are strays."""


def check_usable(points: FloatArray, place: str) -> None:
    """Refuse a cloud in which no cylinder could be told from anything else.

    Raises
    ------
    InputError
        If there are fewer than 5 points, or all are equal, on a line or on a plane.
    """
    remedy = "a cylinder needs at least 5 points that do not lie on one plane"
    if len(points) < 5:
        raise InputError(place, f"only {len(points)} usable point{'s' if len(points) != 1 else ''}", remedy)
    corner, side = cell_cube(points)
    if side < float(np.ptp(box_of(points), axis=0).max()):
        points = points[((points >= corner) & (points <= corner + side)).all(axis=1)]
    low, high = box_of(points)
    extent = float(np.linalg.norm(high - low))
    if extent == 0:
        raise InputError(place, "all points are equal", remedy)
    scatter = np.zeros((3, 3))
    fill_scatter(points, low, 1.0 / extent, scatter)
    widths = np.sqrt(np.maximum(np.linalg.eigvalsh(scatter), 0.0))
    # the covariance of exactly flat points keeps rounding of its own size, and coordinates far away keep theirs
    rounding = 1e-7 + 4.0 * float(np.spacing(np.abs([low, high]).max())) / extent
    if widths[1] < rounding:
        raise InputError(place, "all points lie on one line", remedy)
    if widths[0] < rounding:
        raise InputError(place, "all points lie on one plane", remedy)


def cell_cube(points: FloatArray, enough: float = 0.0) -> tuple[FloatArray, float]:
    """Return corner and side of the cube that the cells fill: that of all points, but for a few that stray far away.

    A single point at zero in a scan with coordinates of millions would leave the scan one cell. Strays stay in the
    cloud, in the cells at the border.

    Parameters
    ----------
    points : ndarray of shape (N, 3)
    enough : float
        A cube of this side can be resolved in any case.
    """
    low, high = box_of(points)
    side = float((high - low).max())
    if side <= enough or side <= STRAY * widest_deviation(points, low):
        return low, side
    bounds = np.quantile(points, [0.01, 0.99], axis=0)
    limit = max(enough, FAR * float(np.ptp(bounds, axis=0).max()))
    if side <= limit or limit == 0:
        return low, side
    return bounds.mean(axis=0) - 0.5 * limit, limit


def canonical_order(points: FloatArray) -> tuple[FloatArray, IndexArray, IndexArray, float]:
    """Sort points along the Morton curve of their own bounding cube: an order that does not depend on the given one.

    Returns
    -------
    points : ndarray of shape (N, 3)
        Sorted, from the corner of `cell_cube`.
    order : ndarray of shape (N,)
        Where each sorted point stood.
    codes : ndarray of shape (N,)
        Sorted codes.
    unit : float
        Side of the smallest cell.
    """
    corner, side = cell_cube(points)
    offsets = points - corner
    unit = side / (2**BITS - 2)
    codes = morton_codes(offsets, unit, side)
    order = np.argsort(codes)
    return offsets[order], order, codes[order], unit


def measure_scene(points: FloatArray, seed: int = 0) -> Scene:
    """Read spacing and noise off a cloud.

    Quadrics are fitted to small neighbourhoods: the residuals show the noise, the density shows the spacing. The noise
    is the mode over the neighbourhoods, because edges and contacts of surfaces are thicker than a surface and only the
    surfaces agree.

    Parameters
    ----------
    points : ndarray of shape (N, 3)
        N >= 5, scene units.
    seed : int
        Seed of the choice of neighbourhoods.

    Returns
    -------
    Scene
    """
    ordered, _, codes, unit = canonical_order(points)
    spacing, _, noise, _ = measure_surface(ordered, codes, unit, np.random.default_rng([seed, 1]))
    return Scene(spacing, noise, extent_of(points))


def make_frame(points: FloatArray, config: Config, threads: int = 1) -> tuple[Frame, Scene]:
    """Measure a cloud and put it into its own frame.

    Parameters
    ----------
    points : ndarray of shape (N, 3)
        Scene units, usable (see `check_usable`).
    config : Config
        Spacing and noise given here are taken as known.
    threads : int
        Do not change the result.

    Returns
    -------
    frame : Frame
        The points in units of the spacing, in Morton order.
    scene : Scene
        What was measured or given, scene units.
    """
    ordered, order, codes, unit = canonical_order(points)
    rng = np.random.default_rng([config.seed, 1])
    spacing, dense, measured, patches = measure_surface(ordered, codes, unit, rng, threads)
    noise = config.scene.noise or measured
    with ThreadPoolExecutor(1) as pool:  # the noise over larger pieces is measured while the points are put in order
        measuring = pool.submit(noise_by_size, ordered, codes, unit, spacing, measured, rng, threads)
        dense *= (config.scene.spacing or spacing) / spacing
        spacing = config.scene.spacing or spacing
        scene = Scene(spacing, noise, extent_of(points))
        window = max(config.candidates.window_spacings * dense, config.candidates.window_noises * noise) / spacing
        # cells are powers of two of a voxel that puts 6 x 6 points of a plane into the radius of the smallest window
        voxel = window / 6.0
        corner, side = cell_cube(points, 2.0**BITS * voxel * spacing)
        ordered, side = (points[order] - corner) / spacing, side / spacing
        level = max(0, min(BITS - 1, math.floor(math.log2(2.0**BITS * voxel / (side + voxel)))))
        unit = max(voxel / 2.0**level, side / (2.0**BITS - 2))  # of a cloud wider than 2^21 voxels they are coarser
        codes = morton_codes(ordered, unit, side)
        again = np.argsort(codes, kind="stable")
        places, ratios = ordered[patches.middles], patches.deviations / measured
        cell, cells, factors = noise_by_place(places, ratios, side)
        keys = cell_keys(cells)
        by_key = np.argsort(keys)
        inside = np.ascontiguousarray(ordered[again])
        sizes, deviations = measuring.result()
    frame = Frame(
        points=inside,
        order=order[again],
        codes=codes[again],
        unit=unit,
        voxel_level=level,
        window=window,
        noise=Noise(
            sizes / spacing,
            deviations * (noise / measured) / spacing,
            cell,
            keys[by_key],
            factors[by_key],
            np.column_stack([places, patches.radii / spacing, ratios]),
        ),
        origin=corner,
        spacing=spacing,
    )
    return frame, scene
