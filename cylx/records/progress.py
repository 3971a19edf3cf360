"""Who watches a run, and what each stage counts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol


@dataclass(frozen=True, slots=True)
class StageReport:
    """What a stage looked at, what it kept, and why it dropped the rest.

    Parameters
    ----------
    name : str
        The stage.
    considered, kept : int
        Things that came in, things that went on.
    rejected : mapping of str to int
        Reason to count, no zero counts.
    """

    name: str
    considered: int
    kept: int
    rejected: Mapping[str, int] = field(default_factory=dict)


class Observer(Protocol):
    """Somebody who watches the pipeline: a progress display, a profile."""

    def stage_started(self, name: str, total: int | None) -> None:
        """Begin a stage of `total` steps, None if their number is not known; it may come in several parts."""

    def stage_advanced(self, steps: int) -> None:
        """Count `steps` further steps of the present stage."""

    def stage_finished(self, name: str, seconds: float) -> None:
        """End a stage, or a part of it, that took `seconds`."""


class SilentObserver:
    """The observer nobody listens to."""

    def stage_started(self, name: str, total: int | None) -> None:
        """Ignore."""

    def stage_advanced(self, steps: int) -> None:
        """Ignore."""

    def stage_finished(self, name: str, seconds: float) -> None:
        """Ignore."""
