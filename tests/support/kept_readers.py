"""Readers of LAS and E57 that stay for many files: quick tests, and fuzzing under the limits of the real process."""

from __future__ import annotations

import os
from contextlib import ExitStack
from typing import IO, TYPE_CHECKING, Any, TypeVar

from cylx.errors import InputError
from cylx.io.inputs import Input
from cylx.io.isolated import Reader

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np

_Answer = TypeVar("_Answer")


class KeptReaders:
    """A process for each format, started when it is first needed and again when it has died."""

    def __init__(self) -> None:
        self.deaths = 0
        self._kept: dict[str, tuple[Reader, IO[bytes], ExitStack]] = {}

    def read_isolated(self, source: Input, kind: str, **wanted: int | None) -> np.ndarray:
        """Stand in for `cylx.io.isolated.read_isolated`."""
        source.file.seek(0)
        return self.read_bytes(source.file.read(), kind, source.place, **wanted)

    def read_bytes(self, data: bytes, kind: str, place: str = "scan", **wanted: int | None) -> np.ndarray:
        """Read the points in the content of a file."""
        return self._ask(data, kind, place, lambda reader, source: reader.read(source, **wanted).copy())

    def ask_isolated(self, source: Input, kind: str) -> dict[str, Any]:
        """Stand in for `cylx.io.isolated.ask_isolated`."""
        source.file.seek(0)
        return self._ask(source.file.read(), kind, source.place, lambda reader, source: reader.ask(source))

    def _ask(self, data: bytes, kind: str, place: str, ask: Callable[[Reader, Input], _Answer]) -> _Answer:
        reader, inbox, _ = self._kept.get(kind) or self._start(kind)
        inbox.seek(0)
        inbox.truncate(0)
        inbox.write(data)
        inbox.flush()
        try:
            return ask(reader, Input(place, inbox, len(data), ""))
        except InputError as error:
            if not reader.alive or "too long" in error.fault or "crashed" in error.fault or "killed" in error.fault:
                self.deaths += 1
                self._stop(kind)
            raise

    def close(self) -> None:
        """End all processes."""
        for kind in list(self._kept):
            self._stop(kind)

    def _start(self, kind: str) -> tuple[Reader, IO[bytes], ExitStack]:
        stack = ExitStack()
        inbox = stack.enter_context(os.fdopen(os.memfd_create("inbox"), "w+b"))
        reader = stack.enter_context(Reader(kind, inbox))
        self._kept[kind] = (reader, inbox, stack)
        return self._kept[kind]

    def _stop(self, kind: str) -> None:
        self._kept.pop(kind)[2].close()
