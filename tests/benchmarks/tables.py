"""Print results as markdown tables, and hold them to their bars."""

import math


def print_row(*cells):
    """Print one row of a table at once."""
    print(f"| {' | '.join(cell if isinstance(cell, str) else number(cell) for cell in cells)} |", flush=True)


def print_header(*names):
    """Print the head of a table."""
    print_row(*names)
    print(f"|{'---|' * len(names)}")


def number(value, digits=3):
    """Write a number with so many significant digits and no exponent; a dash for None and NaN."""
    if value is None or math.isnan(value):
        return "-"
    if isinstance(value, int) or value == 0 or not math.isfinite(value):
        return f"{value:.0f}" if math.isfinite(value) else str(value)
    if abs(value) < 1e-5:
        return "< 0.00001"
    decimals = digits - 1 - math.floor(math.log10(abs(value)))
    return f"{value:.{max(decimals, 0)}f}"


class Bars:
    """The bars a result has to meet, and how many of them were missed."""

    def __init__(self):
        self.missed = 0

    def at_most(self, value, bar):
        """Say of a value whether it keeps below a bar; nothing if there is no bar. NaN and None miss every bar."""
        return self._judge(value is not None and bar is not None and value <= bar, "≤", bar)

    def at_least(self, value, bar):
        """Say of a value whether it reaches a bar."""
        return self._judge(value is not None and bar is not None and value >= bar, "≥", bar)

    def exit_code(self):
        """Give 1 if a bar was missed, 0 otherwise."""
        return int(self.missed > 0)

    def _judge(self, held, sign, bar):
        if bar is None:
            return ""
        self.missed += not held
        return f"{sign} {bar:g}: {'met' if held else '**missed**'}"
