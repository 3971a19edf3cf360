"""Libraries for input formats that only some users need."""

from __future__ import annotations

from importlib.util import find_spec

from cylx.errors import InputError

_NEEDS = {"las": ("las", ("laspy",)), "laz": ("las", ("laspy", "lazrs")), "e57": ("e57", ("pye57",))}


def require_extra(kind: str, place: str) -> None:
    """Refuse an input whose format needs libraries that are not installed.

    Parameters
    ----------
    kind : {"las", "laz", "e57"}
    place : str
        The input.

    Raises
    ------
    InputError
        If one of them is not installed.
    """
    extra, modules = _NEEDS[kind]
    missing = [name for name in modules if find_spec(name) is None]
    if missing:
        fault = f"needs {' and '.join(missing)}, which {'is' if len(missing) == 1 else 'are'} not installed"
        raise InputError(place, fault, f"pip install 'cylx[{extra}]'")
