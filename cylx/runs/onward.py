"""Along a run: what goes on from an end of a pipe, a bend into a pipe that was too short to be found alone."""

from __future__ import annotations

from cylx.runs.pipes import Surroundings
from cylx.runs.tracing import Trace


def follow_ends(trace: Trace, near: Surroundings) -> int:
    """Follow the free ends of pipes into bends and further pipes; return how many pipes were added."""
    return 0
