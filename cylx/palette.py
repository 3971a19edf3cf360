"""The colour of each cylinder: the same in annotated clouds, reports, pictures and windows."""

from __future__ import annotations

import colorsys
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

_GREY = 128
_GOLDEN = 0.6180339887498949


def cylinder_colors(ids: NDArray[np.integer[Any]]) -> NDArray[np.uint8]:
    """Return the colour of each cylinder, which depends only on its id; grey for -1.

    Parameters
    ----------
    ids : ndarray of shape (N,)
        Ids of cylinders, -1 for none.

    Returns
    -------
    ndarray of shape (N, 3), uint8
        Red, green and blue.
    """
    colors = [_color(number) for number in range(int(ids.max(initial=-1)) + 1)]
    palette = np.array([*colors, (_GREY,) * 3], dtype=np.uint8)
    return palette.take(ids, axis=0)  # -1 is the last


@cache
def _color(number: int) -> tuple[int, ...]:
    """Return a colour: hues in golden steps, so that neighbours differ, in six alternating shades."""
    saturation = (0.85, 0.55, 1.0)[number % 3]
    value = (0.95, 0.7)[number % 2]
    return tuple(round(255 * part) for part in colorsys.hsv_to_rgb(number * _GOLDEN % 1.0, saturation, value))
