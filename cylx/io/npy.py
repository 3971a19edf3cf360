"""NPY and NPZ: an array of numpy whose first three columns, or fields x, y and z, are the coordinates."""

from __future__ import annotations

import io
import struct
import tempfile
import tokenize
import warnings
import zipfile
import zlib
from typing import TYPE_CHECKING, Any

import numpy as np

from cylx.errors import InputError
from cylx.io.inputs import Input, excerpt
from cylx.io.names import mended_names, missing_coordinates
from cylx.io.packed import copy_unpacked
from cylx.io.row_format import short_of_points

if TYPE_CHECKING:
    from numpy.typing import NDArray

try:
    from lzma import LZMAError
except ImportError:  # Python without lzma: zipfile refuses such members
    _OF_LZMA: tuple[type[Exception], ...] = ()
else:
    _OF_LZMA = (LZMAError,)

_NPY, _ZIP = b"\x93NUMPY", (b"PK\x03\x04", b"PK\x05\x06")  # the second: of an archive of nothing
_MOST_COLUMNS = 1000
_LYING = 9  # an array of three rows and more columns than this is probably transposed
_ENOUGH = 1 << 20  # longer than any header
_REMEDY = "save it again by numpy.save"
_BROKEN = (
    ValueError, TypeError, SyntaxError, tokenize.TokenError, RecursionError, LookupError, OverflowError, AttributeError,
)  # fmt: skip
"""What numpy raises on a damaged header."""
_DAMAGED: tuple[type[Exception], ...] = (
    zipfile.BadZipFile, NotImplementedError, RuntimeError, EOFError, zlib.error, ValueError, OverflowError,
    struct.error, *_OF_LZMA,
)  # fmt: skip
"""What zipfile raises; RuntimeError is a password, ValueError a name that is not UTF-8."""
_IMAGE_WIDTH, _NARROW = 33, 16
_SQUARE = 16
"""Numbers in this many times as many rows as columns, or fewer, are an image if there are enough columns."""
_LONGEST = 120
_MOST_ROWS = 1 << 48


def read_npy(source: Input) -> NDArray[np.void]:
    """Read an array of numbers from NPY, or from NPZ its only array or the one called `points`.

    Parameters
    ----------
    source : Input

    Returns
    -------
    ndarray of shape (N,), structured
        The columns `x`, `y`, `z`, `column_4` and so on of an (N, 3) or wider array, or the fields of a structured
        array, with a field `f` of several values as `f_0`, `f_1` and so on; mapped from the file if numpy allows it.

    Raises
    ------
    InputError
        If there is no such array, or it holds Python objects or is damaged.
    """
    head = source.head(6)
    if head == _NPY:
        return columns_of(map_npy(source), source.place)
    if head.startswith(_ZIP):
        return _read_packed(source)
    raise InputError(source.place, "is neither NPY nor NPZ", "give it its right suffix")


def _read_packed(source: Input) -> NDArray[np.void]:
    try:
        with zipfile.ZipFile(source.file) as archive, tempfile.TemporaryFile() as copy:
            with archive.open(_member(archive.namelist(), source.place)) as stream:
                size = copy_unpacked(stream, copy, source)
            part = Input(source.place, copy, size, source.sha256)
            if part.head(6) != _NPY:
                raise InputError(source.place, "holds a member that is not NPY", "save it again by numpy.savez")
            return columns_of(map_npy(part), source.place)
    except _DAMAGED as error:
        fault = f"is not a complete NPZ: {_shortened(error)}"
        raise InputError(source.place, fault, "get a complete copy of the file") from None


def _member(names: list[str], place: str) -> str:
    arrays = [name for name in names if name.endswith(".npy")]
    if "points.npy" in arrays:
        return "points.npy"
    if len(arrays) != 1:
        held = ", ".join(excerpt(name.removesuffix(".npy")) for name in arrays[:5]) or "none"
        fault = f"holds {len(arrays)} arrays, none of them called points: {held}" if arrays else "holds no array"
        raise InputError(place, fault, "save the points alone, or as points=…")
    return arrays[0]


def map_npy(source: Input) -> NDArray[Any]:
    """Map an array from its file, after its header has been checked against the file size.

    Parameters
    ----------
    source : Input

    Raises
    ------
    InputError
        If it is damaged, or holds no points.
    """
    head = io.BytesIO(source.head(_ENOUGH))
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # about headers from Python 2
            version = np.lib.format.read_magic(head)
            read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
            shape, fortran, dtype = read(head)
    except (*_BROKEN, MemoryError) as error:  # MemoryError: brackets nested too deeply
        raise InputError(source.place, f"broken NPY header: {_shortened(error)}", _REMEDY) from None
    if not all(type(size) is int and 0 <= size < _MOST_ROWS for size in shape):
        raise InputError(source.place, f"broken NPY header: the shape is {excerpt(str(shape))}", _REMEDY)
    if dtype.hasobject:
        raise InputError(source.place, "holds Python objects, which are not supported", "save an array of numbers")
    _check_kind(dtype, shape, source.place)
    held = (source.size - head.tell()) // max(dtype.itemsize * (shape[1] if len(shape) == 2 else 1), 1)
    if held < shape[0]:
        raise short_of_points(source.place, shape[0], held)
    return np.memmap(source.file, dtype, "c", head.tell(), shape, "F" if fortran else "C")


def _check_kind(dtype: np.dtype[Any], shape: tuple[int, ...], place: str) -> None:
    said = f"({', '.join(map(str, shape))}{',' * (len(shape) == 1)})"
    if dtype.names is not None:
        if len(shape) != 1:
            raise InputError(place, f"is a structured array of shape {said}, not (N,)", "flatten it")
        missing = missing_coordinates(dtype.names)
        if missing:
            raise InputError(place, f"the structured array has no field {missing}", "give one with x, y and z")
    elif len(shape) != 2 or not 3 <= shape[1] <= _MOST_COLUMNS or (shape[0] == 3 and shape[1] > _LYING):
        remedy = "transpose it" if len(shape) == 2 and shape[0] == 3 else "give an array of shape (N, 3) or wider"
        raise InputError(place, f"has the shape {said}, not (N, 3)", remedy)
    elif _is_image(dtype, shape):
        fault = f"has the shape {said}, as an image of depths has"
        raise InputError(place, fault, "compute its points from the focal length first")
    elif dtype.kind not in "iuf":
        raise InputError(place, f"is made of {dtype}, not of numbers", "give an array of floats")
    if shape[0] == 0:
        raise InputError(place, "holds no points", "give a file with points")


def _is_image(dtype: np.dtype[Any], shape: tuple[int, ...]) -> bool:
    """Return whether an array of numbers has the shape of an image rather than of points and their properties."""
    least = _NARROW if dtype.kind in "iu" else _IMAGE_WIDTH
    return dtype.kind in "iuf" and shape[1] >= least and _LYING < shape[0] < _SQUARE * shape[1]


def _shortened(error: BaseException) -> str:
    """Return what an exception says, on one line that is not too long."""
    text = " ".join(str(error).partition("\n")[0].split()) or type(error).__name__
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}…"


def columns_of(array: NDArray[Any], place: str) -> NDArray[np.void]:
    """Return an array as a structured array of plain columns, without copying if possible.

    Parameters
    ----------
    array : ndarray
        Of numbers in columns, or structured.
    place : str
        Its name in errors.
    """
    if array.dtype.names is None:
        names = ["x", "y", "z", *(f"column_{column}" for column in range(4, array.shape[1] + 1))]
        kind = _plain(array.dtype)
        if kind == array.dtype and array.flags.c_contiguous:
            return np.asarray(array.view(np.dtype([(name, kind) for name in names]))[:, 0])
        values = [array[:, column] for column in range(array.shape[1])]
    else:
        parts = [_field(array, name, place) for name in array.dtype.names]
        names = [name for part in parts for name, _ in part]
        values = [column for part in parts for _, column in part]
        if names == list(array.dtype.names) and all(_plain(column.dtype) == column.dtype for column in values):
            return array
    table = np.empty(len(array), [(n, _plain(v.dtype)) for n, v in zip(mended_names(names), values, strict=True)])
    for name, column in zip(table.dtype.names or (), values, strict=True):
        with np.errstate(over="ignore"):
            table[name] = column
    return table


def _field(array: NDArray[np.void], name: str, place: str) -> list[tuple[str, NDArray[Any]]]:
    """Return the columns of a field."""
    values = array[name]
    if values.dtype.kind not in "biuf":
        fault = f"the field {excerpt(name)} is made of {values.dtype}, not of numbers"
        raise InputError(place, fault, "leave it out")
    if values.ndim == 1:
        return [(name, values)]
    if name.lower() in ("x", "y", "z"):
        raise InputError(place, f"the field {name} has several values per point", "give one x, y and z per point")
    flat = values.reshape(len(values), -1)
    return [(f"{name}_{column}", flat[:, column]) for column in range(flat.shape[1])]


def _plain(dtype: np.dtype[Any]) -> np.dtype[Any]:
    """Return the type in our tables for a numpy type."""
    if dtype.kind == "b":
        return np.dtype("u1")
    if dtype.kind == "f" and dtype.itemsize not in (4, 8):
        return np.dtype("f4" if dtype.itemsize < 4 else "f8")
    return dtype
