"""Clouds larger than memory from Python: files, or pieces from any store."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Sequence
from contextlib import ExitStack, closing
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from cylx.api.warmup import compile_kernels
from cylx.config import Config, load_config, named_options
from cylx.io import Scratch, StreamedCloud, open_scratch, stream_arrays, stream_cloud
from cylx.io.outputs import open_output
from cylx.io.streamed_cloud import ROWS
from cylx.records import Crop, Observer, Selection, SilentObserver, TiledExtraction
from cylx.tiles.run import Options, Outcome, extract_in_tiles
from cylx.tiles.schedule import Cluster, Here, Runner

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

LABEL = np.dtype([("cylinder_id", "<i4"), ("residual", "<f4")])
"""Of the file of labels: one row for each row of the source."""


def extract_tiled(
    source: str | PathLike[str] | Sequence[str | PathLike[str]] | Iterable[ArrayLike],
    *,
    tile: float | None = None,
    buffer: float | None = None,
    memory: float = 4e9,
    scratch: str | PathLike[str] | None = None,
    scheduler: str | None = None,
    labels: str | PathLike[str] | None = None,
    rejected: bool = False,
    preset: str | None = None,
    config: Config | str | PathLike[str] | None = None,
    overrides: Sequence[str] = (),
    seed: int | None = None,
    radius: tuple[float | None, float | None] | None = None,
    max_cylinders: int | None = None,
    crop: Crop | None = None,
    voxel: float | None = None,
    every: int | None = None,
    classes: Sequence[int] | None = None,
    threads: int = 1,
    observer: Observer | None = None,
) -> TiledExtraction:
    """Find the cylinders of a cloud larger than memory; the same as `cylx extract --tile`.

    Parameters
    ----------
    source : str, Path, sequence of them, or iterable of array_like of shape (n, 3)
        A file, several files that are one cloud, or its points piece by piece, from any store. Pieces are taken once,
        and kept in the scratch folder.
    tile : float, optional
        Greatest side of a tile, in the unit of the points; by default as many points as memory allows.
    buffer : float, optional
        Margin in which a tile sees the points of its neighbours; by default a tenth of a tile.
    memory : float
        Memory of each process that searches tiles, bytes.
    scratch : str or Path, optional
        Folder for the tiles, about 100 bytes a point; by default that of the system for temporary files.
    scheduler : str, optional
        Address of a scheduler of Dask, whose workers search the tiles; by default this process does.
    labels : str or Path, optional
        A new NPY file, for the `cylinder_id` and the `residual` of each row of the source.
    rejected : bool
        Whether to give what was not accepted, too.
    preset, config, overrides, seed, radius, max_cylinders, crop, voxel, every, classes, observer
        As for `extract`.
    threads : int
        Number of threads of each process; the result does not depend on it.

    Returns
    -------
    TiledExtraction

    Raises
    ------
    ConfigError
        If the settings are wrong, or give nothing that could be joined over tiles.
    InputError
        If a file cannot be read, or the cloud is unusable.
    OutputError
        If the labels or the tiles cannot be written.
    ValueError
        If the shape of a piece is not (n, 3).

    Examples
    --------
    >>> import cylx, cylx.synthetic
    >>> pipe = cylx.synthetic.single(points=4000, seed=1)
    >>> found = cylx.extract_tiled(pipe.points[i : i + 1000] for i in range(0, 4000, 1000))
    >>> found
    1 cylinder in 4000 points in 1 tile
    """
    settings = load_config(
        path=None if config is None or isinstance(config, Config) else Path(config),
        start=config if isinstance(config, Config) else None,
        preset=preset,
        overrides=overrides,
        options=named_options(seed=seed, radius=radius, max_cylinders=max_cylinders),
    )
    chosen = None if classes is None else tuple(classes)
    selection = Selection(crop=crop, voxel=voxel, every=every, classes=chosen)
    observer = observer or SilentObserver()
    compile_kernels(observer)
    with ExitStack() as stack:
        parent = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="cylx-", dir=scratch)))
        runner: Runner = Here() if scheduler is None else stack.enter_context(closing(Cluster(scheduler)))
        folder = stack.enter_context(open_scratch(parent, "result", {}, resume=False))
        clouds = _clouds_of(source, folder)
        options = Options(tile, buffer, memory, threads, rejected)
        outcome = extract_in_tiles(clouds, selection, settings, options, folder, runner, observer)
        if labels is not None:
            _write_labels(Path(labels), outcome)
    return outcome.extraction


def _clouds_of(
    source: str | PathLike[str] | Sequence[str | PathLike[str]] | Iterable[ArrayLike], scratch: Scratch
) -> list[StreamedCloud]:
    """Open what was given."""
    if isinstance(source, str | PathLike):
        return [stream_cloud(Path(source), scratch.path("spool-0"))]
    if isinstance(source, Sequence) and source and all(isinstance(one, str | PathLike) for one in source):
        return [stream_cloud(Path(str(one)), scratch.path(f"spool-{i}")) for i, one in enumerate(source)]
    pieces = [source] if isinstance(source, np.ndarray) else source
    return [stream_arrays(pieces, scratch.path("spool-0"))]  # type: ignore[arg-type]  # no path is among them


def _write_labels(path: Path, outcome: Outcome) -> None:
    """Write the label of each row."""
    rows = sum(outcome.extraction.rows)
    with open_output(path, overwrite=False) as file:
        about = {"descr": np.lib.format.dtype_to_descr(LABEL), "fortran_order": False, "shape": (rows,)}
        np.lib.format.write_array_header_1_0(file, about)
        for ids, residuals in outcome.labels.pieces(0, rows, ROWS):
            block = np.empty(len(ids), LABEL)
            block["cylinder_id"], block["residual"] = ids, residuals
            file.write(block.tobytes())
