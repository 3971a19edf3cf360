"""Read and write point clouds of any supported format."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from cylx.errors import InputError, OutputError, UsageError
from cylx.io.formats import FORMATS, LAS_SUFFIXES, TEXT_SUFFIXES, cloud_name, cloud_suffix, recognise
from cylx.io.inputs import Input, open_input, printable
from cylx.io.names import coordinate_names, mended_names
from cylx.io.outputs import open_output
from cylx.io.packed import unpacked
from cylx.io.pcd import read_pcd, write_pcd
from cylx.io.ply import ROWS_AT_A_TIME, ply_type, read_ply, write_ply
from cylx.io.withheld import withheld_rows
from cylx.io.xyz import read_xyz, write_xyz
from cylx.optional.extras import require
from cylx.records import PointCloud, Selection, Source

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from numpy.typing import NDArray


def read_cloud(
    path: str | Path,
    *,
    format: str | None = None,  # noqa: A002  the natural name
    scan: int | None = None,
    units: str | None = None,
) -> PointCloud:
    """Read a point cloud with all properties of its points.

    Parameters
    ----------
    path : str or Path
        A PLY, PCD, text, LAS, LAZ, E57, PTX, NPY or NPZ file, optionally packed by gzip, or `-` for standard input.
    format : {"ply", "pcd", "xyz", "las", "e57", "npy", "ptx"}, optional
        Its format; by default from the suffix, or else from the content. LAZ is `las`, NPZ is `npy`.
    scan : int, optional
        Number of the scan of an E57 or PTX file to read, from 0; by default all.
    units : {"m", "mm", "cm", "in", "ft", "us-ft"}, optional
        Unit of its coordinates; by default what the file says, if it does.

    Returns
    -------
    PointCloud
        The points in float64. Rows with a coordinate that is not finite are only in its table.

    Raises
    ------
    InputError
        If the file cannot be read, is damaged, has no finite point, lacks the scan, or needs a library that is not
        installed.
    UsageError
        If `format` is unknown.
    """
    if format is not None and format not in FORMATS:
        raise UsageError("format", f"unknown format {format!r}", f"use one of {', '.join(FORMATS)}")
    packed = cloud_name(path) != str(path)
    with open_input(path) as file, unpacked(file, packed=packed) as source:
        kind = format or recognise(source, cloud_suffix(path))
        check_scan(source, kind, scan)
        try:
            table, facts = read_table(source, kind, scan)
        except MemoryError:
            raise InputError(source.place, "does not fit into memory", "thin it out, or use a larger machine") from None
        if units is not None:
            facts["units"] = units
        origin = Source(_file_name(path), kind, source.sha256, Selection(scan=scan), **facts)
        return _cloud(table, source.place, origin)


def check_scan(source: Input, kind: str, scan: int | None) -> None:
    """Refuse the number of a scan for a format that has none.

    Raises
    ------
    InputError
    """
    if scan is not None and kind not in ("e57", "ptx"):
        raise InputError(source.place, "is neither E57 nor PTX, so no scan can be chosen", "leave --scan out")


def recorded_name(path: str | Path) -> str:
    """Return the name of a file in a result: without its folder, in valid UTF-8."""
    return Path(_file_name(path)).name


def cloud_suffixes() -> tuple[str, ...]:
    """Return the suffixes, in lower case, of the files in a folder that count as clouds; NPY may hold anything else."""
    return (".ply", ".pcd", *TEXT_SUFFIXES, *LAS_SUFFIXES, ".e57", ".ptx")


def write_cloud(
    path: str | Path,
    points: NDArray[Any],
    *,
    properties: Mapping[str, NDArray[Any]] | None = None,
    overwrite: bool = False,
    dtype: Literal["f4", "f8"] = "f8",
) -> None:
    """Write points and properties as binary PLY, binary PCD or text, depending on the suffix; `-` is PLY.

    Parameters
    ----------
    path : str or Path
        A name that ends in .ply, .pcd, .xyz, .txt, .csv, .pts or .asc, or `-` for standard output.
    points : ndarray of shape (N, 3)
        Scene units.
    properties : mapping of str to ndarray of shape (N,), optional
        Further properties, in their order, with their types if the format has them.
    overwrite : bool
        Whether an existing file may be replaced.
    dtype : {"f8", "f4"}
        Type of the coordinates.

    Raises
    ------
    OutputError
        If the suffix is unknown, or the file cannot be written.
    """
    suffix = ".ply" if str(path) == "-" else Path(path).suffix.lower()
    if suffix not in (".ply", ".pcd", *TEXT_SUFFIXES):
        known = ", ".join((".ply", ".pcd", *TEXT_SUFFIXES))
        raise OutputError(printable(path), f"unknown suffix {suffix!r}", f"use one of {known}")
    table = _table(points, properties or {}, dtype)
    with open_output(path, overwrite=overwrite) as file:
        if suffix == ".ply":
            packed = np.dtype([(name, ply_type(table.dtype[name])) for name in table.dtype.names or ()])
            write_ply(file, packed, len(table), (part.astype(packed) for part in _blocks(table)))
        elif suffix == ".pcd":
            write_pcd(file, table)
        else:
            write_xyz(file, suffix, table)


def _file_name(path: str | Path) -> str:
    """Return the name of a file in valid UTF-8."""
    return str(path).encode("utf-8", "replace").decode()


def read_table(source: Input, kind: str, scan: int | None) -> tuple[NDArray[np.void], dict[str, Any]]:
    """Read the table of a file, and what else its source says; rarely needed readers are imported late.

    Parameters
    ----------
    source : Input
    kind : str
        Its format, one of `FORMATS`.
    scan : int, optional
        Number of the scan of an E57 or PTX file to read; by default all.

    Raises
    ------
    InputError
        If it cannot be read, is damaged, lacks the scan, or needs a library that is not installed.
    """
    if kind == "las":
        from cylx.io.crs import las_source  # noqa: PLC0415  for this alone
        from cylx.io.isolated import read_isolated  # noqa: PLC0415  starts processes
        from cylx.io.las_header import kept_header, las_header  # noqa: PLC0415  for this alone

        facts = las_header(source)
        libraries = ("laspy", "lazrs") if facts.compressed else ("laspy",)
        require(*libraries, place=source.place, needed_by="", error=InputError, imported=False)
        table = read_isolated(source, "las")
        return table, las_source(kept_header(source, facts), facts)
    if kind == "e57":
        from cylx.io.crs import e57_source  # noqa: PLC0415  for this alone
        from cylx.io.isolated import read_isolated  # noqa: PLC0415  starts processes

        require("pye57", place=source.place, needed_by="", error=InputError, imported=False)
        table = read_isolated(source, "e57", scan=scan)
        return table, e57_source(source)
    if kind == "ptx":
        from cylx.io.ptx import read_ptx  # noqa: PLC0415  for this alone

        return read_ptx(source, scan)
    if kind == "npy":
        from cylx.io.npy import read_npy  # noqa: PLC0415  needs an extra, or for this alone

        return read_npy(source), {}
    if kind == "xyz":
        table, columns = read_xyz(source)
        return table, {"notes": columns.notes, "doubts": columns.doubts}
    return {"ply": read_ply, "pcd": read_pcd}[kind](source), {}


def _cloud(table: NDArray[np.void], place: str, source: Source) -> PointCloud:
    names = table.dtype.names or ()
    points = np.empty((len(table), 3))
    with np.errstate(all="ignore"):  # a signalling NaN is a NaN
        for axis, name in enumerate(coordinate_names(names)):
            points[:, axis] = table[name]
    valid = np.asarray(np.isfinite(points).all(axis=1))
    if not valid.any():
        raise InputError(place, "no point has finite coordinates", "export the file again")
    withheld = withheld_rows(table, source.format)
    if withheld.any():
        valid &= ~withheld
        if not valid.any():
            raise InputError(place, "marks all its points as withheld", "give a scan with points that may be used")
        note = f"{withheld.sum()} of {len(table)} points are marked as withheld, and left out"
        source = replace(source, notes=(*source.notes, note))
    if not valid.all():
        return PointCloud(points[valid], table, valid, source)
    bare = names == ("x", "y", "z") and all(table.dtype[name] == np.float64 for name in names)
    return PointCloud(points, None if bare else table, None, source)


def _table(points: NDArray[Any], properties: Mapping[str, NDArray[Any]], dtype: str) -> NDArray[np.void]:
    columns = {axis: points[:, place] for place, axis in enumerate("xyz")}
    names = mended_names([*columns, *properties])
    values = [*columns.values(), *(np.asarray(value) for value in properties.values())]
    types = [np.dtype(dtype)] * 3 + [_plain_type(value.dtype) for value in values[3:]]
    table = np.empty(len(points), np.dtype(list(zip(names, types, strict=True))))
    for name, value in zip(names, values, strict=True):
        if value.shape != (len(points),):
            raise ValueError(f"{name} must have shape ({len(points)},), not {value.shape}")
        table[name] = value
    return table


def _plain_type(dtype: np.dtype[Any]) -> np.dtype[Any]:
    """Return the number type to write a type in; PLY and PCD share these, except integers of 8 bytes."""
    if dtype.kind not in "biuf":
        raise ValueError(f"a property must be made of numbers, not of {dtype}")
    if dtype.kind == "f":
        return np.dtype("f4" if dtype.itemsize <= 4 else "f8")
    return np.dtype("u1") if dtype.kind == "b" else dtype


def _blocks(table: NDArray[np.void]) -> Iterator[NDArray[np.void]]:
    for start in range(0, len(table), ROWS_AT_A_TIME):
        yield table[start : start + ROWS_AT_A_TIME]
