"""The option `--units`."""

from __future__ import annotations

from collections.abc import Callable

import click

from cylx.cli.options.configuration import Command

UNITS = ("m", "mm", "cm", "in", "ft", "us-ft")


def units_option(which: str) -> Callable[[Command], Command]:
    """Return the option `--units`; `which` says which outputs need it."""
    return click.option(
        "--units", type=click.Choice(UNITS), help=f"Unit of the scan, if it does not say it; {which} one."
    )
