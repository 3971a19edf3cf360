"""The table of random streams: who draws with which number, so that no two draw the same."""

from __future__ import annotations

from typing import Literal

import numpy as np

Stream = Literal["scene", "planes", "ellipses", "msac", "ball places", "centre lines", "ball samples", "tran", "trials"]

STREAMS: dict[Stream, int] = {
    "scene": 1,  # the neighbourhoods that noise and spacing are measured in
    "planes": 2,  # of the slices
    "ellipses": 3,  # the samples of a slice, one stream a slice
    "msac": 11,
    "ball places": 12,  # of the method `jin`
    "centre lines": 13,
    "ball samples": 14,  # one stream a ball
    "tran": 15,
    "trials": 21,  # of an experiment, where the seed is the number of the trial
}
"""Every number that is drawn comes from one of these; windows draw by the place they are at (`local_slices`)."""


def stream(seed: int, name: Stream, *index: int) -> np.random.Generator:
    """Return the generator of a stream, or of one item of it, that belongs to a seed."""
    return np.random.default_rng([seed, STREAMS[name], *index])
