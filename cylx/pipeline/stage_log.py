"""Times and counts of the stages."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from cylx.records import Observer, StageReport


class StageLog:
    """Times the stages for an observer and keeps their reports.

    Parameters
    ----------
    observer : Observer
    """

    def __init__(self, observer: Observer) -> None:
        self._observer = observer
        self.reports: list[StageReport] = []

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Time one stage."""
        self._observer.stage_started(name, None)
        start = time.perf_counter()
        yield
        self._observer.stage_finished(name, time.perf_counter() - start)

    def advance(self, steps: int = 1) -> None:
        """Tell the observer that the present stage goes on."""
        self._observer.stage_advanced(steps)

    def report(self, name: str, considered: int, kept: int, rejected: Mapping[str, int]) -> None:
        """Note what a stage considered, kept and rejected."""
        counts = {reason: count for reason, count in sorted(rejected.items()) if count}
        self.reports.append(StageReport(name, considered, kept, counts))
