"""Sums over the points of a window, in the processor's vector instructions.

A kernel that adds up over points reads them as `xyz`, shape (3, N), a coordinate a row, and lets the compiler add in
another order than written. Then several points go through one instruction: fits take a fifth of the time. It rounds
differently from one kind of processor to another, as the linear algebra of NumPy does; nothing else depends on it, not
even on where the points lie in memory.
"""

from __future__ import annotations

from typing import Final

REORDERED: Final = {"reassoc", "nsz", "arcp", "contract"}
"""What the compiler may do to sums; NaN and infinity keep their meaning."""
FINITE: Final = REORDERED | {"nnan"}
"""The same, for the least and the greatest of numbers that are all finite."""
