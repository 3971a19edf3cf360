"""Numbers as values of options."""

from __future__ import annotations

import math

import click


class NumberRange(click.FloatRange):
    """A number in a range; NaN is in none."""

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Parse the number."""
        number = float(super().convert(value, param, ctx))  # type: ignore[arg-type]  # whatever was given
        if math.isnan(number):
            self.fail(f"'{value}' is not a number", param, ctx)
        return number
