"""`cylx doctor`: check the installation, one small check for each thing it needs."""

from __future__ import annotations

import json
import math
import os
import platform
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import asdict, dataclass
from importlib import import_module
from importlib.metadata import PackageNotFoundError, metadata, version
from typing import TYPE_CHECKING, Literal

import click

from cylx.cli.batch.memory import cores, free_memory
from cylx.cli.options.configuration import debug_option, json_option
from cylx.cli.terminal.failures import answer
from cylx.cli.terminal.group import ExampleCommand
from cylx.optional.extras import LIBRARIES
from cylx.version import __version__

if TYPE_CHECKING:
    from cylx.records import Observer

State = Literal["ok", "missing", "broken"]

OLDEST = 10
"""Minor version of Python 3."""
NEEDED = ("click", "numba", "numpy", "plyfile", "pydantic", "PyYAML", "rich", "scipy")
"""The required packages, by their names on the package index."""
PACKAGES = {"OCP": ("cadquery-ocp-novtk", "cadquery-ocp")}
"""Package names of imports that are named differently."""
TIGHT = 1 << 30
"""Bytes of free memory below which scans of a million points may not fit."""


@click.command(
    cls=ExampleCommand, examples=["cylx doctor", "cylx doctor --json | jq '.checks[] | select(.state != \"ok\")'"]
)
@json_option
@debug_option
def doctor(*, as_json: bool) -> None:
    """Check the installation, and say how to repair it.

    It checks libraries, compiled kernels, memory, and the extraction of a synthetic cylinder. The exit code is 0 if
    cylinders can be found and 1 if not; missing optional libraries are no fault. Nothing is downloaded.
    """
    from cylx.cli.terminal.display import Messages, show_table

    with Messages().progress() as observer:
        checks = diagnose(observer)
    works = all(check.state == "ok" for check in checks if check.needed)
    if as_json:
        content = {"works": works, "checks": [asdict(check) for check in checks]}
        answer(json.dumps(content, indent=2, ensure_ascii=False) + "\n", as_json=True)
    else:
        show_table(["what", "state", "detail", "remedy"], [[c.name, c.state, c.detail, c.remedy] for c in checks])
        answer("cylinders can be found\n" if works else "cylinders cannot be found: see what is missing or broken\n")
    if not works:
        raise click.exceptions.Exit(1)


@dataclass(frozen=True, slots=True)
class Check:
    """The result of one check.

    Parameters
    ----------
    name : str
        What was checked.
    state : {'ok', 'missing', 'broken'}
    detail : str
        What was found, or what is wrong.
    remedy : str
        How to repair it; empty if nothing is needed.
    needed : bool
        Whether cylinders cannot be found without it.
    """

    name: str
    state: State
    detail: str
    remedy: str = ""
    needed: bool = True


def diagnose(observer: Observer | None = None) -> list[Check]:
    """Run all checks, with a small extraction at the end.

    Parameters
    ----------
    observer : Observer, optional
        Receives the progress of the extraction, which compiles the kernels if necessary.
    """
    return [
        check_python(),
        *(check_package(name) for name in NEEDED),
        check_open3d(),
        check_libusb(),
        check_kernels(),
        check_machine(),
        *(check_extra(name) for name in LIBRARIES if LIBRARIES[name].extra in extras_there_are()),
        check_extraction(observer),
    ]


def check_python() -> Check:
    """Check the version of Python."""
    detail = f"{platform.python_version()} ({platform.system()}, {platform.machine()}), cylx {__version__}"
    if platform.python_version_tuple()[0] != "3" or int(platform.python_version_tuple()[1]) < OLDEST:
        return Check("Python", "broken", detail, f"install Python 3.{OLDEST} or newer")
    return Check("Python", "ok", detail)


def check_package(name: str) -> Check:
    """Check a required package.

    Parameters
    ----------
    name : str
        Its name on the package index.
    """
    module = {"PyYAML": "yaml"}.get(name, name)
    return _imported(name, lambda: import_module(module), _version(name), f"pip install {name}")


def check_open3d() -> Check:
    """Check open3d, which reads packed PCD files and computes normals for the methods that need them."""
    from cylx.optional.open3d import import_open3d

    found = _version("open3d-cpu") or _version("open3d")
    return _imported("open3d", import_open3d, found, "pip install --force-reinstall cylx")


def check_libusb() -> Check:
    """Check the libusb that open3d needs on Linux; on other systems open3d brings its own."""
    if sys.platform != "linux":
        return Check("libusb", "ok", "included in open3d on this system", needed=False)
    found = _version("libusb-package")
    remedy = "pip install libusb-package, unless open3d works"
    if found is None:
        return Check("libusb", "missing", "libusb-package is not installed", remedy, needed=False)
    return Check("libusb", "ok", f"libusb-package {found}", needed=False)


def check_kernels() -> Check:
    """Check that the numerical kernels are compiled, that the compiled code can be saved, and that it is undamaged."""
    told = os.environ.get("NUMBA_CACHE_DIR")
    source = f"NUMBA_CACHE_DIR={told}" if told else "NUMBA_CACHE_DIR is not set"
    remedy = "set NUMBA_CACHE_DIR to a writable folder"
    try:
        from cylx.api.warmup import damaged_kernels, kernel_folder, kernels_are_cold, kernels_are_kept

        folder, damaged = kernel_folder(), damaged_kernels()
        cold = kernels_are_cold()
    except (ImportError, OSError, RuntimeError) as error:
        return Check("kernels", "broken", f"{_first_line(error)}; {source}", remedy)
    if not kernels_are_kept():
        fault = "cannot be saved: " + (f"{folder} is read-only" if folder else "no folder is writable")
        again = "every run compiles them again" if cold else "they are compiled"
        return Check("kernels", "broken", f"{fault}; {source}; {again}", remedy, needed=False)
    if damaged:
        fault = f"{len(damaged)} damaged in {folder}: {', '.join(damaged[:3])}{', …' if damaged[3:] else ''}"
        return Check("kernels", "broken", fault, "nothing to do: they are compiled again", needed=False)
    state = "were not compiled yet" if cold else "are compiled"
    return Check("kernels", "ok", f"{state}, and saved in {folder}; {source}")


def check_machine() -> Check:
    """Check the processor and the free memory."""
    count = f"{cores()} core{'' if cores() == 1 else 's'}"
    free = free_memory()
    if free is None:
        return Check("machine", "ok", f"{count}; free memory unknown", needed=False)
    detail = f"{count}, {free / 2**30:.1f} GB of memory free"
    remedy = "close other programs, or thin large scans" if free < TIGHT else ""
    return Check("machine", "ok", detail, remedy, needed=False)


def check_extra(name: str) -> Check:
    """Check an optional library.

    Parameters
    ----------
    name : str
        A key of `LIBRARIES`.
    """
    extra, purpose = LIBRARIES[name]
    found = next(filter(None, map(_version, PACKAGES.get(name, (name,)))), None)
    remedy = f"pip install 'cylx[{extra}]'"
    return _imported(name, lambda: import_module(name), found, remedy, purpose, needed=False)


def check_extraction(observer: Observer | None = None) -> Check:
    """Check that a synthetic cylinder of radius 1 is found, with its radius within 1 %."""
    remedy = "if all else is well, run 'cylx extract --debug' on a scan, and report what it says"
    try:
        from cylx.api import extract
        from cylx.records import SilentObserver
        from cylx.synthetic import single

        found = extract(single(points=2000, seed=1).points, observer=observer or SilentObserver())
    except Exception as error:  # noqa: BLE001  any failure is the result of this check
        return Check("extraction", "broken", f"{type(error).__name__}: {_first_line(error)}", remedy)
    radii = [fit.cylinder.radius for fit in found.cylinders]
    if len(radii) != 1 or not math.isclose(radii[0], 1.0, rel_tol=0.01):
        wrong = ", ".join(f"{radius:.4g}" for radius in radii) or "none"
        return Check("extraction", "broken", f"for one cylinder of radius 1 it finds: {wrong}", remedy)
    return Check("extraction", "ok", f"finds a cylinder of radius 1 as {radii[0]:.4f}")


def extras_there_are() -> set[str]:
    """Return the extras of the installed cylx."""
    with suppress(PackageNotFoundError):
        return set(metadata("cylx").get_all("Provides-Extra") or ())
    return {extra for extra, _ in LIBRARIES.values()}


def _imported(
    name: str, load: Callable[[], object], found: str | None, remedy: str, purpose: str = "", *, needed: bool = True
) -> Check:
    """Import something and return the result as a check."""
    aim = f", for {purpose}" if purpose else ""
    try:
        load()
    except ModuleNotFoundError as error:
        if found is None:
            return Check(name, "missing", f"is not installed{aim}", remedy, needed)
        return Check(name, "broken", f"{found}, but {_first_line(error)}", remedy, needed)
    except Exception as error:  # noqa: BLE001  a library may fail in any way when it is imported
        return Check(name, "broken", f"{found or 'is there'}, but {_first_line(error)}", remedy, needed)
    return Check(name, "ok", f"{found or 'version unknown'}{aim}", needed=needed)


def _version(package: str) -> str | None:
    """Return the version of an installed package."""
    with suppress(PackageNotFoundError):
        return version(package)
    return None


def _first_line(error: BaseException) -> str:
    """Return the first line of an error's message."""
    return next(iter(_lines(error)), type(error).__name__)


def _lines(error: BaseException) -> Iterator[str]:
    """Yield the lines of an error's message that are not empty."""
    return filter(None, map(str.strip, str(error).splitlines()))
