"""The options that select the points to use."""

from __future__ import annotations

import functools
import re
from math import isfinite
from typing import TYPE_CHECKING, Any

import click

from cylx.cli.options.configuration import Command
from cylx.cli.options.numbers import NumberRange

if TYPE_CHECKING:
    from collections.abc import Callable

    Side = float | None
    Corner = tuple[Side, Side, Side]
    Box = tuple[Corner, Corner]
    BoxType = click.ParamType[Box]
    ClassesType = click.ParamType[tuple[int, ...]]
else:
    BoxType = ClassesType = click.ParamType  # not generic in older versions


_CLASS = re.compile(r"[0-9]{1,9}")


class CropBox(BoxType):
    """`X0,Y0,Z0:X1,Y1,Z1`; any number, and either corner, may be empty."""

    name = "x0,y0,z0:x1,y1,z1"
    example = "0,0,0:5,5,3, or ,,0:,,3 for z alone"

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> Box:
        """Parse the two corners."""
        if isinstance(value, tuple):
            return value
        text = str(value)
        try:
            corners = [self._corner(corner) for corner in text.split(":")]
        except ValueError:
            corners = []
        if len(corners) != 2:
            self.fail(f"'{text}' is not two corners such as {self.example}", param, ctx)
        low, high = corners
        for axis, least, most in zip("xyz", low, high, strict=True):
            if least is not None and most is not None and least > most:
                self.fail(f"'{text}' has its smallest {axis} above its largest", param, ctx)
        if all(side is None for corner in corners for side in corner):
            self.fail(f"'{text}' sets no bound", param, ctx)
        return low, high

    def _corner(self, text: str) -> Corner:
        """Parse three coordinates; None for an empty one."""
        sides = text.split(",") if text.strip() else ["", "", ""]
        x, y, z = (float(side) if side.strip() else None for side in sides)
        if not all(side is None or isfinite(side) for side in (x, y, z)):
            raise ValueError(text)
        return x, y, z


class Classes(ClassesType):
    """`N,N,…`."""

    name = "n,..."

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> tuple[int, ...]:
        """Parse the numbers."""
        if isinstance(value, tuple):
            return value
        parts = [part.strip() for part in str(value).split(",")]  # of more kinds of blanks than `int` takes
        if not all(_CLASS.fullmatch(part) for part in parts):
            self.fail(f"'{value}' is not a list of class numbers such as 2,6", param, ctx)
        return tuple(int(part) for part in parts)


def selecting(command: Command) -> Command:
    """Add the options that select points; the command receives `selection`."""

    @functools.wraps(command)
    def with_selection(
        *args: object,
        crop: Box | None,
        voxel: float | None,
        every: int | None,
        classes: tuple[int, ...] | None,
        scan_number: int | None,
        **others: object,
    ) -> object:
        from cylx.records import Selection

        selection = Selection(crop=crop, voxel=voxel, every=every, classes=classes, scan=scan_number)
        return command(*args, selection=selection, **others)

    for option in reversed(_SELECTION):
        with_selection = option(with_selection)
    return with_selection  # type: ignore[return-value]  # click keeps the signature


_SELECTION: tuple[Callable[[Any], Any], ...] = (
    click.option(
        "--crop",
        type=CropBox(),
        help="Use only points in this box, sides included; an empty number sets no bound, as in ,,0:,,3.",
    ),
    click.option(
        "--voxel",
        type=NumberRange(0, float("inf"), min_open=True, max_open=True),
        metavar="SIZE",
        help="Use only one point in each cell of this side length: the one nearest to the middle.",
    ),
    click.option(
        "--every",
        type=click.IntRange(min=1),
        metavar="N",
        help="Use only the first of every N rows of the scan.",
    ),
    click.option(
        "--classes",
        type=Classes(),
        help="Use only points of these classes, such as 2,6; for scans with a classification, as LAS has it.",
    ),
    click.option(
        "--scan",
        "scan_number",
        type=click.IntRange(min=0),
        metavar="N",
        help="Read one scan of an E57 or PTX file; the first is 0.  [default: all]",
    ),
)
