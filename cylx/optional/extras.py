"""Libraries that only some users need: the extra that installs each, and the error if it is missing."""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from typing import NamedTuple

from cylx.errors import CylxError, UsageError


class Library(NamedTuple):
    """A library that does not come with cylx.

    Parameters
    ----------
    extra : str
        The extra that brings it.
    purpose : str
        What it is for.
    """

    extra: str
    purpose: str


LIBRARIES = {
    "matplotlib": Library("plots", "pictures of the experiments"),
    "laspy": Library("las", "LAS files"),
    "lazrs": Library("las", "LAZ files"),
    "pye57": Library("e57", "E57 files"),
    "trimesh": Library("mesh", "export of PLY, OBJ, GLB and STL"),
    "OCP": Library("step", "export of STEP"),
    "ifcopenshell": Library("ifc", "export of IFC"),
    "ezdxf": Library("dxf", "export of DXF"),
    "distributed": Library("dask", "clusters"),
    "CSF": Library("forest", "the ground of a plot by a cloth"),
    "pyproj": Library("crs", "coordinate reference systems"),
    "pandas": Library("dataframe", "data frames"),
}
"""Optional libraries by import name."""


def require(
    *libraries: str,
    place: str,
    needed_by: str | None = None,
    error: type[CylxError] = UsageError,
    imported: bool = True,
) -> None:
    """Refuse what needs libraries that are not installed, and name the command that installs them.

    Parameters
    ----------
    *libraries : str
        Keys of `LIBRARIES`, all of one extra.
    place : str
        What the error is about: an input, an output.
    needed_by : str, optional
        What needs them, if the error shall say so; it may be empty where the place says it.
    error : type
        An error of an input, or of usage.
    imported : bool
        Whether they are imported; otherwise only looked for, as another process will import them.

    Raises
    ------
    CylxError
        If one of them cannot be imported.
    """
    missing = [name for name in libraries if not (_is_there(name) if imported else is_found(name))]
    if not missing:
        return
    fault = f"{'is' if len(missing) == 1 else 'are'} not installed"
    names = " and ".join(missing)
    fault = f"{names} {fault}" if needed_by is None else f"{needed_by} needs {names}, which {fault}".strip()
    raise error(place, fault, f"pip install 'cylx[{LIBRARIES[missing[0]].extra}]'")


def _is_there(library: str) -> bool:
    try:
        import_module("matplotlib.figure" if library == "matplotlib" else library)
    except ImportError:
        return False
    return True


def is_found(library: str) -> bool:
    """Return whether a library is installed, without importing it."""
    try:
        return find_spec(library) is not None
    except (ImportError, ValueError):
        return False
