"""Spacing, noise and frame of a cloud.

The frame has the spacing as its unit, the corner of the cloud as its origin, and the points in Morton order. All
stages work in it, so unit, origin and order of the points do not change a result.
"""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from cylx.config import Config
from cylx.errors import InputError
from cylx.geometry.arrays import FloatArray, IndexArray
from cylx.geometry.bounding_box import box_of, extent_of, fill_scatter, widest_deviation
from cylx.geometry.morton import BITS, morton_codes
from cylx.records import Frame, Noise, Scene, cell_keys, stream
from cylx.scene.noise import measure_surface
from cylx.scene.noise_variation import noise_by_place, noise_by_size
from cylx.scene.scan_lines import points_on_surfaces

STRAY = 40.0
"""A cloud may have strays (a few points far away) if its width is this many times the deviation from its mean."""
FAR = 1024.0
"""Points further from the others than this, in widths of 98 % of them, are strays."""


def check_usable(points: FloatArray, place: str) -> None:
    """Refuse a cloud in which no cylinder can be found.

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
    # the covariance of exactly flat points has rounding errors of its own size and of the size of the coordinates
    rounding = 1e-7 + 4.0 * float(np.spacing(np.abs([low, high]).max())) / extent
    if widths[1] < rounding:
        raise InputError(place, "all points lie on one line", remedy)
    if widths[0] < rounding:
        raise InputError(place, "all points lie on one plane", remedy)


def cell_cube(points: FloatArray, enough: float = 0.0) -> tuple[FloatArray, float]:
    """Return corner and side of the cube for the cells: the bounding cube of all points except a few far strays.

    With a single point at zero in a scan with coordinates of millions, the rest of the scan would be one cell. Strays
    stay in the cloud, in the cells at the border.

    Parameters
    ----------
    points : ndarray of shape (N, 3)
    enough : float
        Up to this side the bounding cube is used as it is, as its cells are fine enough.
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
    """Sort points along the Morton curve of their bounding cube; the result does not depend on the input order.

    Returns
    -------
    points : ndarray of shape (N, 3)
        Sorted, relative to the corner of `cell_cube`.
    order : ndarray of shape (N,)
        Original index of each sorted point.
    codes : ndarray of shape (N,)
        Morton codes of the sorted points.
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
    """Measure spacing and noise of a cloud.

    Quadrics are fitted to small neighbourhoods: their residuals give the noise, their density the spacing. The noise is
    the mode over the neighbourhoods: edges and contacts of surfaces are thicker than a surface, and only the values on
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
    surface = points_on_surfaces(ordered, codes, unit)
    spacing, _, noise, _ = measure_surface(ordered[surface], codes[surface], unit, stream(seed, "scene"))
    return Scene(spacing, noise, extent_of(points))


def make_frame(points: FloatArray, config: Config, threads: int = 1) -> tuple[Frame, Scene]:
    """Measure a cloud and transform it to its own frame.

    Parameters
    ----------
    points : ndarray of shape (N, 3)
        Scene units, usable (see `check_usable`).
    config : Config
        Spacing and noise, if given here, are not measured.
    threads : int
        Number of threads; does not change the result.

    Returns
    -------
    frame : Frame
        The points in units of the spacing, in Morton order.
    scene : Scene
        Measured or given values, scene units.
    """
    ordered, order, codes, unit = canonical_order(points)
    rng = stream(config.seed, "scene")
    surface = points_on_surfaces(ordered, codes, unit, threads)
    on, their_codes = ordered[surface], codes[surface]
    spacing, dense, measured, patches = measure_surface(on, their_codes, unit, rng, threads)
    noise = config.scene.noise or measured
    with ThreadPoolExecutor(1) as pool:  # measures the noise over larger pieces while the points are sorted
        measuring = pool.submit(noise_by_size, on, their_codes, unit, spacing, measured, rng, threads)
        dense *= (config.scene.spacing or spacing) / spacing
        spacing = config.scene.spacing or spacing
        scene = Scene(spacing, noise, extent_of(points))
        window = max(config.candidates.window_spacings * dense, config.candidates.window_noises * noise) / spacing
        # cells are powers of two of a voxel that puts 6 x 6 points of a plane into the radius of the smallest window
        voxel = window / 6.0
        corner, side = cell_cube(points, 2.0**BITS * voxel * spacing)
        ordered, side = (points[order] - corner) / spacing, side / spacing
        level = max(0, min(BITS - 1, math.floor(math.log2(2.0**BITS * voxel / (side + voxel)))))
        unit = max(voxel / 2.0**level, side / (2.0**BITS - 2))  # coarser for a cloud wider than 2^21 voxels
        codes = morton_codes(ordered, unit, side)
        again = np.argsort(codes, kind="stable")
        places, ratios = ordered[surface[patches.middles]], patches.deviations / measured
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
