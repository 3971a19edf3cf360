"""Progress observers, and the counts of each stage."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol


@dataclass(frozen=True, slots=True)
class StageReport:
    """What came into a stage, what it kept, and why it rejected the rest.

    Parameters
    ----------
    name : str
        The stage.
    considered, kept : int
        Number of inputs, number of outputs.
    rejected : mapping of str to int
        Count by reason, without zero counts.
    """

    name: str
    considered: int
    kept: int
    rejected: Mapping[str, int] = field(default_factory=dict)


class Observer(Protocol):
    """An observer of the pipeline, such as a progress display or a profile."""

    def stage_started(self, name: str, total: int | None) -> None:
        """Begin a stage of `total` steps; None if the number is unknown. A stage may come in several parts."""

    def stage_advanced(self, steps: int) -> None:
        """Count `steps` further steps of the current stage."""

    def stage_finished(self, name: str, seconds: float) -> None:
        """End a stage, or a part of it, that took `seconds`."""


class SilentObserver:
    """An observer that does nothing."""

    def stage_started(self, name: str, total: int | None) -> None:
        """Ignore."""

    def stage_advanced(self, steps: int) -> None:
        """Ignore."""

    def stage_finished(self, name: str, seconds: float) -> None:
        """Ignore."""
