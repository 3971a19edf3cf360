"""The decorator of all kernels: Numba's `njit`, with a cache of compiled code that survives damage and missing folders.

Numba keeps an index and data files, and trusts both: a damaged file makes every later run fail, and two processes that
compile one kernel at once may mix up their files. Here each compiled kernel is one file with a digest, written
under a temporary name. A file that is damaged, old or of another kernel counts as missing. Where no folder can be
written to, the kernels are compiled in each run.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import os
import pickle
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, TypeVar

_disabled = os.environ.pop("NUMBA_DISABLE_JIT", None)  # read when Numba is imported, and of no use here
import numba  # noqa: E402
from numba.core.caching import CompileResultCacheImpl, FunctionCache  # noqa: E402
from numba.core.serialize import dumps  # noqa: E402

if _disabled is not None:
    os.environ["NUMBA_DISABLE_JIT"] = _disabled

SUFFIX = ".nbc"
_MAGIC = b"cylx kernel 1\n"
_STALE = 3600.0
"""Seconds after which nobody writes to a temporary file any more."""
_DIGEST = hashlib.sha256().digest_size

_checkpoints: list[Callable[[], None]] = []
"""Called before each kernel is loaded or compiled."""

_known: list[_Files] = []
"""The files of all kernels."""

_kernels: list[Any] = []
"""All kernels, as dispatchers of Numba."""

Kernel = TypeVar("Kernel", bound=Callable[..., Any])


def njit(**options: Any) -> Callable[[Kernel], Kernel]:  # noqa: ANN401  Numba has no types
    """Return Numba's decorator, with the cache of this module in place of Numba's.

    `NUMBA_DISABLE_JIT` does not count: without compiling, a scan would take days. What nobody uses is not compiled: an
    entry for C, and an exception for each division. A division by zero gives what it gives in NumPy.

    Parameters
    ----------
    **options
        The options of `numba.njit`; `cache` is required, as a reminder for the reader.
    """
    if not options.pop("cache"):
        raise ValueError("every kernel is kept")
    options = {"error_model": "numpy", "no_cfunc_wrapper": True, **options}

    def compiled(function: Callable[..., Any]) -> Any:  # noqa: ANN401  Numba has no types
        dispatcher = numba.njit(**options)(function)
        if dispatcher is function:
            raise RuntimeError("Numba was imported with NUMBA_DISABLE_JIT set, and cylx needs it to compile: unset it")
        with contextlib.suppress(RuntimeError):  # no source file: nothing is kept
            dispatcher._cache = KernelCache(function, options)
        _kernels.append(dispatcher)
        return dispatcher

    return compiled


def at_each_kernel(call: Callable[[], None]) -> None:
    """Call a function before each kernel is loaded or compiled, for example to notice Ctrl-C."""
    _checkpoints[:] = [call]


def folder_of(kernel: Any) -> str | None:  # noqa: ANN401  a dispatcher of Numba
    """Return the folder where the compiled code of a kernel is kept; None if there is none."""
    folder = kernel.stats.cache_path
    return None if folder is None else str(folder)


def is_kept(kernel: Any) -> bool:  # noqa: ANN401  a dispatcher of Numba
    """Return whether compiled code of a kernel can be saved; found out by trying, as root may write everywhere."""
    folder = folder_of(kernel)
    try:
        with tempfile.TemporaryFile(dir=folder):
            return folder is not None
    except OSError:
        return False


def times_compiled(kernel: Any) -> int:  # noqa: ANN401  a dispatcher of Numba
    """Return how often a kernel has been compiled in this process."""
    return sum(kernel.stats.cache_misses.values())


def all_times_compiled() -> int:
    """Return how many kernels have been compiled in this process; one for two kinds of arguments counts twice."""
    return sum(map(times_compiled, _kernels))


def kept_files() -> dict[Path, int]:
    """Return the files of all kernels imported so far, and when each was written, nanoseconds."""
    found: dict[Path, int] = {}
    for files in _known:
        for path in files.all():
            with contextlib.suppress(OSError):  # another process may replace it
                found[path] = path.stat().st_mtime_ns
    return found


_LOCATORS: list[Any] = CompileResultCacheImpl._locator_classes
_InTree: Any = next(
    one for one in _LOCATORS if one.__name__.lstrip("_") == "InTreeCacheLocator"
)  # numba 0.60 has the _


_UserWide: Any = next(one for one in _LOCATORS if one.__name__.lstrip("_") == "UserWideCacheLocator")


class _AnyTree(_InTree):  # type: ignore[misc]  # Numba has no types
    """The folder of the source, even if it cannot be written to: an administrator may have filled it."""

    def ensure_cache_path(self) -> None:
        """Accept the folder; saving fails later, and is given up."""


class _Locations(CompileResultCacheImpl):  # type: ignore[misc]  # Numba has no types
    _locator_classes = (*_LOCATORS, _AnyTree)


class KernelCache(FunctionCache):  # type: ignore[misc]  # Numba has no types
    """The compiled code of one kernel on disk, one file for each signature.

    Parameters
    ----------
    function : function
        The Python code.
    options : dict
        The options of `njit`.
    """

    _impl_class = _Locations

    def __init__(self, function: Callable[..., Any], options: dict[str, Any]) -> None:
        super().__init__(function)
        # what was compiled with the installation serves also those who may write in their own folder only
        beside = Path(function.__code__.co_filename).parent / "__pycache__"
        shared = beside if isinstance(self._impl.locator, _UserWide) else None
        name, stamp = self._impl.filename_base, _stamp(function, options, self)
        self._cache_file = _Files(Path(self.cache_path), name, stamp, shared)

    @property
    def stamp(self) -> bytes:
        """The digest of all that the compiled code depends on, other than the signature and the processor."""
        return self._cache_file.stamp

    def load_overload(self, sig: Any, target_context: Any) -> Any:  # noqa: ANN401  Numba has no types
        """Return the compiled code for a signature; None if it is not there or cannot be used."""
        _check()
        try:
            return super().load_overload(sig, target_context)
        except Exception:  # noqa: BLE001  whatever is wrong with the file, compiling again is right
            return None

    def save_overload(self, sig: Any, data: Any) -> None:  # noqa: ANN401  Numba has no types
        """Keep compiled code, unless the disk is full or the folder cannot be written to."""
        try:
            super().save_overload(sig, data)
        except Exception:  # noqa: BLE001  the code is there for this run
            self.disable()
        _check()


class _Files:
    """The files of one kernel; what `numba.core.caching.Cache` asks of its files.

    Parameters
    ----------
    folder : Path
        Where they are, and new ones are written.
    name : str
        Beginning of their names.
    stamp : bytes
        The digest of what they depend on.
    shared : Path, optional
        Another folder in which they may be, and which is only read.
    """

    def __init__(self, folder: Path, name: str, stamp: bytes, shared: Path | None = None) -> None:
        self.folder = folder
        self.name = name
        self.stamp = stamp
        self.shared = shared
        _known.append(self)

    def load(self, key: Any) -> Any:  # noqa: ANN401  Numba has no types
        """Return what was kept under a key, or None."""
        path, expected = self._path(key), (self.stamp, repr(key))
        found = _content(path, expected)
        return _content(self.shared / path.name, expected) if found is None and self.shared is not None else found

    def save(self, key: Any, data: Any) -> None:  # noqa: ANN401  Numba has no types
        """Keep data under a key: completely or not at all."""
        body = dumps((self.stamp, repr(key), dumps(data)))
        path = self._path(key)
        temporary = path.with_name(f"{path.name}.tmp.{os.getpid()}")
        self._remove_leftovers()
        try:
            temporary.write_bytes(_MAGIC + hashlib.sha256(body).digest() + body)
            temporary.replace(path)
        finally:
            temporary.unlink(missing_ok=True)

    def flush(self) -> None:
        """Forget what was kept."""
        for path in self._all_in(self.folder):
            path.unlink(missing_ok=True)

    def all(self) -> Iterator[Path]:
        """Yield the files of this kernel; those of Numba have a number instead of twelve digits."""
        yield from self._all_in(self.folder)
        if self.shared is not None:
            yield from self._all_in(self.shared)

    def _all_in(self, folder: Path) -> Iterator[Path]:
        return folder.glob(f"{self.name}.{'?' * 12}{SUFFIX}")

    def _remove_leftovers(self) -> None:
        """Remove what a killed process has left while it saved."""
        for left in self.folder.glob(f"{self.name}.*.tmp.*"):
            with contextlib.suppress(OSError):
                if time.time() - left.stat().st_mtime > _STALE:
                    left.unlink()

    def _path(self, key: Any) -> Path:  # noqa: ANN401  Numba has no types
        return self.folder / f"{self.name}.{hashlib.sha256(repr(key).encode()).hexdigest()[:12]}{SUFFIX}"


def damaged_files() -> list[str]:
    """Return the names of damaged files of the kernels imported so far; they count as missing, and are replaced."""
    return sorted({path.name for files in _known for path in files.all() if _body(path) is None})


def _content(path: Path, expected: tuple[bytes, str]) -> Any:  # noqa: ANN401  Numba has no types
    body = _body(path)
    if body is None:
        return None
    stamp, key, data = pickle.loads(body)
    return pickle.loads(data) if (stamp, key) == expected else None


def _body(path: Path) -> bytes | None:
    """Return the content of a file whose digest is right."""
    try:
        data = path.read_bytes()
    except OSError:
        return None
    start = len(_MAGIC) + _DIGEST
    body = data[start:]
    return body if data[:start] == _MAGIC + hashlib.sha256(body).digest() else None


def _stamp(function: Callable[..., Any], options: dict[str, Any], cache: KernelCache) -> bytes:
    """Compute the digest of the source file, of the options, and of the kernels and constants from other files."""
    digest = hashlib.sha256(repr((numba.__version__, _sorted(options), _source_stamp(function, cache))).encode())
    for name, value in sorted(_used(function)):
        digest.update(f"{name}={value}\n".encode())
    return digest.digest()


def _source_stamp(function: Callable[..., Any], cache: KernelCache) -> object:
    """Return a digest of the source file; its time, which Numba takes, changes when an image or a cache is unpacked."""
    name = function.__code__.co_filename
    try:
        status = Path(name).stat()
        return _digest_of(name, status.st_mtime_ns, status.st_size)
    except OSError:  # inside an archive
        return cache._impl.locator.get_source_stamp()


@functools.lru_cache(maxsize=256)
def _digest_of(name: str, _written: int, _size: int) -> str:
    """Return the digest of a file, once for all its kernels."""
    return hashlib.sha256(Path(name).read_bytes()).hexdigest()


def _used(function: Callable[..., Any]) -> Iterator[tuple[str, str]]:
    """Yield the names and values of what a kernel may use of its module: other kernels, and constants."""
    for name, value in function.__globals__.items():
        if name.startswith("__"):
            continue
        kept = getattr(value, "_cache", None)
        if isinstance(kept, KernelCache):
            yield name, kept.stamp.hex()
        elif isinstance(value, bool | int | float | str | tuple | slice):
            yield name, repr(value)


def _sorted(options: dict[str, Any]) -> list[tuple[str, Any]]:
    return [(name, sorted(value) if isinstance(value, set) else value) for name, value in sorted(options.items())]


def _check() -> None:
    for call in _checkpoints:
        call()
