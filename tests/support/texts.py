"""Texts that are held against each other."""

import math
import re

NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?:e-?\d+)?")


def same(shown, found):
    """Tell whether two texts have the same words and nearly the same numbers."""
    numbers = [[float(number) for number in NUMBER.findall(text)] for text in (shown, found)]
    words = [re.sub("─+", "─", NUMBER.sub("#", text)).split() for text in (shown, found)]
    return words[0] == words[1] and all(
        math.isclose(a, b, rel_tol=0.05, abs_tol=2e-3) for a, b in zip(*numbers, strict=True)
    )
