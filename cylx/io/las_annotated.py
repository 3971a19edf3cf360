"""The annotated LAS or LAZ: the file as read, with the cylinder of each point in extra bytes."""

from __future__ import annotations

import io
from datetime import date
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from cylx.io.las import las_dimensions, quiet_laspy
from cylx.io.las_mend import mended, restore

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

_OURS = {"cylinder_id": "i4", "residual": "f4"}
_OF_RUNS = {"fitting_id": "i4", "run_id": "i4"}
_NOT_KEPT = ("copc", "cylx_unused")
_COLORS = ("red", "green", "blue")
_FULL = 257  # colours of LAS have 16 bits
_NO_DATE = date(1970, 1, 1)


def write_las(
    file: BinaryIO,
    kept: bytes,
    count: int,
    blocks: Iterable[tuple[NDArray[np.void], dict[str, NDArray[Any]]]],
    *,
    colored: bool,
    compressed: bool,
    runs: bool = False,
    kinds: dict[str, str] | None = None,
) -> None:
    """Write the points of a LAS file again, with the cylinder of each.

    Point format, version, scales, offsets and the small records, such as the coordinate system, are kept. Extra bytes
    with our names, and colours that are not all 0, are kept as `orig_red` and so on.

    Parameters
    ----------
    file : binary file
        A file that can seek.
    kept : bytes
        The rest of the input file, see `kept_header`.
    count : int
        Number of points.
    blocks : iterable of (ndarray, mapping)
        The points as read, and their `cylinder_id`, `residual`, `red`, `green` and `blue`, piece by piece.
    colored : bool
        Whether the points have colours that are not all 0.
    compressed : bool
        Whether to write LAZ.
    runs : bool
        Whether the blocks have `fitting_id` and `run_id` as well.
    kinds : dict of str to str, optional
        Other extra bytes instead of ours, by name, and their types.
    """
    import laspy  # noqa: PLC0415  an extra

    kinds = kinds or (_OURS | _OF_RUNS if runs else _OURS)
    with quiet_laspy():
        header = laspy.LasHeader.read_from(io.BytesIO(mended(kept, count)), read_evlrs=True)
        columns = las_dimensions(header.point_format)
        renamed = _prepare(header, kinds, colored=colored)
        with laspy.open(file, mode="w", header=header, closefd=False, do_compress=compressed) as writer:
            for rows, ours in blocks:
                record = laspy.ScaleAwarePointRecord.zeros(len(rows), header=header)
                for axis, scale, offset in zip("xyz", header.scales, header.offsets, strict=True):
                    record[axis.upper()] = np.rint((rows[axis] - offset) / scale).astype("i4")
                for one in columns:
                    _put(record, renamed.get(one.dimension, one.dimension), one.element, rows[one.name])
                for color in _COLORS if _is_colored(header) else ():
                    if f"{color}+" in renamed:
                        record[renamed[f"{color}+"]] = rows[color]
                    record[color] = ours[color].astype("u2") * _FULL
                for name in kinds:
                    record[name] = ours[name]
                writer.write_points(record)
            if header.evlrs:
                writer.write_evlrs(header.evlrs)
        file.seek(0, io.SEEK_END)
        restore(file, kept)


def _prepare(header: Any, kinds: dict[str, str], *, colored: bool) -> dict[str, str]:  # noqa: ANN401  (of laspy)
    """Add our dimensions to a header, and return the new names of dimensions, those of colours under `red+`."""
    import laspy  # noqa: PLC0415  an extra

    point_format = header.point_format
    taken = [*point_format.dimension_names, *kinds]
    renamed = {}
    for place, one in enumerate(point_format.dimensions):
        if one.name in kinds:
            renamed[one.name] = _new_name(one.name, taken)
            point_format.dimensions[place] = one._replace(name=renamed[one.name])
    params = [laspy.ExtraBytesParams(name, kind) for name, kind in kinds.items()]
    if _is_colored(header) and colored:
        renamed |= {f"{color}+": _new_name(color, taken) for color in _COLORS}
        params += [laspy.ExtraBytesParams(renamed[f"{color}+"], "u2") for color in _COLORS]
    header.add_extra_dims(params)
    header.vlrs = [record for record in header.vlrs if record.user_id not in _NOT_KEPT]
    header._version = _version(header)  # laspy refuses to set it while it does not fit
    header.creation_date = header.creation_date or _NO_DATE  # laspy would write today
    header.start_of_waveform_data_packet_record = 0
    header.global_encoding.waveform_data_packets_internal = False
    return renamed


def has_colors(table: NDArray[np.void]) -> bool:
    """Return whether points have colours that are not all 0."""
    names = table.dtype.names or ()
    return all(color in names for color in _COLORS) and any(bool(table[color].any()) for color in _COLORS)


def _version(header: Any) -> Any:  # noqa: ANN401  (of laspy)
    """Return the version of a header, or the first later one that has its point format."""
    from laspy.header import Version  # noqa: PLC0415  an extra
    from laspy.point.dims import VERSION_TO_POINT_FMT  # noqa: PLC0415  an extra

    for version in sorted(VERSION_TO_POINT_FMT):
        later = Version.from_str(version)
        if (later.major, later.minor) >= (header.version.major, header.version.minor) and (
            header.point_format.id in VERSION_TO_POINT_FMT[version]
        ):
            return later
    return header.version


def _is_colored(header: Any) -> bool:  # noqa: ANN401  (of laspy)
    return "red" in header.point_format.standard_dimension_names


def _new_name(name: str, taken: list[str]) -> str:
    """Return the name to keep a property under, of at most 32 letters, the limit of LAS."""
    new, count = f"orig_{name}", 1
    while new in taken:
        count += 1
        new = f"orig_{name}_{count}"
    taken.append(new)
    return new


def _put(record: Any, name: str, element: int | None, values: NDArray[Any]) -> None:  # noqa: ANN401  (of laspy)
    """Write a column of the table to its dimension of the file."""
    about = record.point_format.dimension_by_name(name)
    if about.is_scaled:
        place = element or 0
        values = np.rint((values - about.offsets[place]) / about.scales[place]).astype(about.dtype.base)
    if element is not None:
        record.array[name][:, element] = values
    elif about.is_scaled:
        record.array[name] = values
    else:
        record[name] = values
