"""The annotated cloud: the points as read, with the cylinder of each, as PLY, PCD, LAS or LAZ."""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from cylx.io.annotated_checks import check_annotated
from cylx.io.annotated_columns import OF_RUNS, OF_TREES, OURS, kept_columns, rows_of
from cylx.io.formats import LAS_SUFFIXES
from cylx.io.outputs import open_output
from cylx.io.pcd import write_pcd
from cylx.io.ply import ROWS_AT_A_TIME, write_ply
from cylx.palette import cylinder_colors

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from numpy.typing import NDArray

    from cylx.io.streamed_cloud import StreamedCloud
    from cylx.records import Extraction, PointCloud

    Labelled = Iterable[tuple[NDArray[np.int32], NDArray[np.float32]]]


def write_annotated(path: str | Path, extraction: Extraction, *, overwrite: bool = False) -> None:
    """Write all points of the input with all their properties, and the cylinder of each.

    If runs were looked for, each point also has its `fitting_id` and `run_id` (int, -1 for none).

    Every row of the input is written, unchanged and in its order, including points without finite coordinates and
    points that were not used. The properties added are `cylinder_id` (int, -1 for none), `residual` (float, the signed
    distance to that cylinder's surface, + is outside, scene units, NaN for none), and `red`, `green`, `blue` (uchar) by
    cylinder, grey for none. Properties of the input with these names, and the `alpha` of its colours, are kept as
    `orig_red` and so on. Names that PLY cannot hold are changed. Integers of 8 bytes become double, as PLY has none.
    Other elements of a PLY, such as faces, are dropped.

    The file is a binary little endian PLY. A name in .pcd gives a binary PCD. A name in .las or .laz needs LAS or LAZ
    as input: `cylinder_id` and `residual` are then extra bytes, and colours are written if the point format has them.

    Parameters
    ----------
    path : str or Path
        A file, or `-` for standard output.
    extraction : Extraction
        The cylinders, and the cloud that they were found in.
    overwrite : bool
        Whether an existing file may be replaced.

    Raises
    ------
    OutputError
        If the file exists and may not be replaced, cannot be written, or has a format that cannot hold the points.
    """
    cloud = extraction.cloud
    check_annotated(path, cloud)
    with open_output(path, overwrite=overwrite) as file:
        suffix = Path(path).suffix.lower()
        if suffix in LAS_SUFFIXES:
            _write_las(file, extraction, compressed=suffix == ".laz")
            return
        ours = OURS if extraction.piping is None else OURS | OF_RUNS
        kept = kept_columns(None if cloud.table is None else cloud.table.dtype, ours)
        dtype = np.dtype([*((new, kind) for new, kind in kept.values()), *ours.items()])
        if suffix == ".pcd":
            write_pcd(file, np.concatenate([*_blocks(extraction, kept, dtype)]))
        else:
            write_ply(file, dtype, cloud.rows, _blocks(extraction, kept, dtype))


def write_trees(path: str | Path, cloud: PointCloud, labels: NDArray[np.int32], *, overwrite: bool = False) -> None:
    """Write all points of the input with all their properties, and the tree of each: `treeID`, from 1, 0 for none.

    Colours are by tree, and names, formats and rows as `write_annotated` has them.

    Parameters
    ----------
    path : str or Path
        A file, or `-` for standard output.
    cloud : PointCloud
    labels : ndarray of shape (N,)
        Index of the tree of each point, -1 for none.
    overwrite : bool
        Whether an existing file may be replaced.

    Raises
    ------
    OutputError
        If the file exists and may not be replaced, cannot be written, or has a format that cannot hold the points.
    """
    check_annotated(path, cloud)
    suffix, columns, rows = Path(path).suffix.lower(), _columns(cloud), cloud.spread(labels, -1)
    kept = kept_columns(None if cloud.table is None else cloud.table.dtype, OF_TREES)
    dtype = np.dtype([*((new, kind) for new, kind in kept.values()), *OF_TREES.items()])

    def blocks(only: list[str] | None) -> Iterator[tuple[Any, dict[str, NDArray[Any]]]]:
        for start in range(0, len(rows), ROWS_AT_A_TIME):
            part = slice(start, start + ROWS_AT_A_TIME)
            colors = zip(("red", "green", "blue"), cylinder_colors(rows[part]).T, strict=True)
            table = columns[part] if only is None else {name: columns[name][part] for name in only}  # type: ignore[index]
            yield table, {"treeID": rows[part] + np.int32(1), **dict(colors)}

    with open_output(path, overwrite=overwrite) as file:
        if suffix in LAS_SUFFIXES and cloud.table is not None:
            from cylx.io.las_annotated import has_colors  # noqa: PLC0415  needs an extra, or for this alone

            compressed, colored = suffix == ".laz", has_colors(cloud.table)
            pieces, kinds = blocks(None), {"treeID": "i4"}
            _write_las_pieces(
                file, cloud.source.header, len(rows), pieces, colored=colored, compressed=compressed, kinds=kinds
            )
            return
        out = (rows_of(table, ours, kept, dtype, "treeID") for table, ours in blocks(list(kept)))
        if suffix == ".pcd":
            write_pcd(file, np.concatenate([*out]))
        else:
            write_ply(file, dtype, len(rows), out)


def _columns(cloud: PointCloud) -> Mapping[str, NDArray[Any]] | NDArray[np.void]:
    """Return the properties of all rows by name; rows of an array without finite coordinates are NaN."""
    if cloud.table is not None:
        return cloud.table
    return {axis: cloud.spread(cloud.points[:, place], np.nan) for place, axis in enumerate("xyz")}


def _blocks(
    extraction: Extraction, kept: dict[str, tuple[str, np.dtype[Any]]], dtype: np.dtype[np.void]
) -> Iterator[NDArray[np.void]]:
    columns = _columns(extraction.cloud)
    for part, ours in _findings(extraction):
        yield rows_of({name: columns[name][part] for name in kept}, ours, kept, dtype)


def _findings(extraction: Extraction) -> Iterator[tuple[slice, dict[str, NDArray[Any]]]]:
    """Yield the results for the rows, piece by piece, by the names of our properties."""
    cloud = extraction.cloud
    labels = cloud.spread(extraction.labels, -1)
    residuals = cloud.spread(extraction.residuals, np.nan)
    piping = extraction.piping
    of_runs = {}
    if piping is not None:
        fittings = piping.labels if len(piping.labels) else np.full(len(extraction.labels), -1, np.int32)
        known = {"fitting_id": fittings, "run_id": piping.run_ids(extraction.labels)}
        of_runs = {name: cloud.spread(values, -1) for name, values in known.items()}
    for start in range(0, cloud.rows, ROWS_AT_A_TIME):
        part = slice(start, start + ROWS_AT_A_TIME)
        yield part, _ours(labels[part], residuals[part]) | {name: ids[part] for name, ids in of_runs.items()}


def _ours(ids: NDArray[np.int32], residuals: NDArray[np.float32]) -> dict[str, NDArray[Any]]:
    """Return our properties of some rows, by name."""
    found = {"cylinder_id": ids, "residual": np.where(ids < 0, np.float32(np.nan), residuals)}
    return found | dict(zip(("red", "green", "blue"), cylinder_colors(ids).T, strict=True))


def write_annotated_stream(
    path: str | Path, cloud: StreamedCloud, labelled: Labelled, *, colored: bool, overwrite: bool = False
) -> None:
    """Write a cloud that need not fit into memory again, as `write_annotated` does.

    Parameters
    ----------
    path : str or Path
        A file whose name ends in .ply, .las or .laz.
    cloud : StreamedCloud
    labelled : iterable of (ndarray, ndarray)
        Cylinder and residual of the rows, in pieces as the cloud has them.
    colored : bool
        Whether the points have colours that are not all 0.
    overwrite : bool
        Whether an existing file may be replaced.

    Raises
    ------
    OutputError
        If the file exists and may not be replaced, cannot be written, or has a format that cannot hold the points.
    """
    suffix = Path(path).suffix.lower()
    pieces = ((table, _ours(*ours)) for table, ours in zip(cloud.parts(), labelled, strict=True))
    with open_output(path, overwrite=overwrite) as file:
        if suffix in LAS_SUFFIXES:
            _write_las_pieces(
                file, cloud.source.header, cloud.rows, pieces, colored=colored, compressed=suffix == ".laz"
            )
            return
        kept = kept_columns(None if cloud.bare else cloud.dtype)
        dtype = np.dtype([*((new, kind) for new, kind in kept.values()), *OURS.items()])
        write_ply(file, dtype, cloud.rows, (rows_of(table, ours, kept, dtype) for table, ours in pieces))


def _write_las(file: BinaryIO, extraction: Extraction, *, compressed: bool) -> None:
    """Write the points of a cloud that is in memory as LAS or LAZ."""
    from cylx.io.las_annotated import has_colors  # noqa: PLC0415  needs an extra, or for this alone

    cloud = extraction.cloud
    table = cloud.table
    if table is None:
        raise ValueError("only clouds from LAS and LAZ can be written as such")
    pieces = ((table[part], ours) for part, ours in _findings(extraction))
    runs = extraction.piping is not None
    _write_las_pieces(
        file, cloud.source.header, len(table), pieces, colored=has_colors(table), compressed=compressed, runs=runs
    )


def _write_las_pieces(
    file: BinaryIO,
    header: bytes | None,
    count: int,
    pieces: Iterator[tuple[NDArray[np.void], dict[str, NDArray[Any]]]],
    *,
    colored: bool,
    compressed: bool,
    runs: bool = False,
    kinds: dict[str, str] | None = None,
) -> None:
    """Write LAS or LAZ, through an unnamed temporary file if the output cannot seek, or has to be read again."""
    from cylx.io.las_annotated import write_las  # noqa: PLC0415  needs an extra, or for this alone
    from cylx.io.las_mend import has_letters  # noqa: PLC0415  for this alone

    if header is None:
        raise ValueError("only clouds from LAS and LAZ can be written as such")
    if file.seekable() and not has_letters(header):
        write_las(file, header, count, pieces, colored=colored, compressed=compressed, runs=runs, kinds=kinds)
        return
    with tempfile.TemporaryFile() as copy:
        write_las(copy, header, count, pieces, colored=colored, compressed=compressed, runs=runs, kinds=kinds)
        copy.seek(0)
        shutil.copyfileobj(copy, file)
