"""Seconds per stage and peak memory of a run, for `--profile`."""

from __future__ import annotations

import sys
from time import perf_counter


class Stopwatch:
    """An observer that adds up the seconds of each stage of one scan.

    Parameters
    ----------
    scan : str
        The input.
    """

    def __init__(self, scan: str) -> None:
        self.scan = scan
        self.stages: dict[str, float] = {}
        self._started = perf_counter()

    def stage_started(self, name: str, total: int | None) -> None:
        """Add the stage to the list."""
        self.stages.setdefault(name, 0.0)

    def stage_advanced(self, steps: int) -> None:
        """Ignore; only whole stages are timed."""

    def stage_finished(self, name: str, seconds: float) -> None:
        """Add the time of a stage."""
        self.stages[name] = self.stages.get(name, 0.0) + seconds

    def report(self, points: int, cylinders: int) -> dict[str, object]:
        """Return the times of the scan as a JSON object; `seconds` counts from the start until now."""
        return {
            "file": self.scan,
            "points": points,
            "cylinders": cylinders,
            "stages": {name: round(seconds, 6) for name, seconds in self.stages.items()},
            "seconds": round(perf_counter() - self._started, 6),
        }


def peak_memory() -> int | None:
    """Return the largest resident memory of this process so far, bytes; None if the system does not report it."""
    try:
        import resource
    except ModuleNotFoundError:
        return None
    largest = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return largest if sys.platform == "darwin" else largest * 1024
