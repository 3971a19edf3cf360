"""The options of `cylx extract` for clouds larger than memory."""

from __future__ import annotations

import functools
import re
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from cylx.cli.options.configuration import Command, complete_files
from cylx.cli.options.numbers import NumberRange

if TYPE_CHECKING:
    SizeType = click.ParamType[float]
    MemoryType = click.ParamType[int]
else:
    SizeType = MemoryType = click.ParamType  # not generic in older versions

AUTO = 0.0
_MEMORY = re.compile(r"(\d+(?:\.\d*)?)\s*([kMGT]?)i?B?", re.IGNORECASE)
_FACTORS = {"": 1, "k": 10**3, "m": 10**6, "g": 10**9, "t": 10**12}


class TileOptions(NamedTuple):
    """The options for clouds larger than memory.

    Parameters
    ----------
    size : float or None
        `--tile`; 0 for tiles of as many points as memory allows, None for no tiles.
    buffer : float or None
        `--buffer`.
    memory : int or None
        `--memory`, bytes.
    scratch : str or None
        `--scratch`.
    one_cloud : bool
        `--one-cloud`.
    scheduler : str or None
        `--scheduler`.
    """

    size: float | None = None
    buffer: float | None = None
    memory: int | None = None
    scratch: str | None = None
    one_cloud: bool = False
    scheduler: str | None = None

    @property
    def certain(self) -> bool:
        """Whether a cloud is cut in any case, however small it is."""
        return bool(self.size) or self.one_cloud or self.scheduler is not None


NO_TILES = TileOptions()


class TileSize(SizeType):
    """A length, or `auto`."""

    name = "size"

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Parse the length."""
        if value == "auto":
            return AUTO
        try:
            size = float(str(value))
        except ValueError:
            size = -1.0
        if not 0.0 < size < float("inf"):
            self.fail(f"'{value}' is neither a length nor auto", param, ctx)
        return size


class Memory(MemoryType):
    """A number of bytes such as 4GB."""

    name = "size"

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> int:
        """Parse the number and its unit."""
        if isinstance(value, int):
            return value
        found = _MEMORY.fullmatch(str(value).strip())
        if found is None or not float(found[1]):
            self.fail(f"'{value}' is no memory such as 4GB", param, ctx)
        return int(float(found[1]) * _FACTORS[found[2].lower()])


def with_tile_options(command: Command) -> Command:
    """Add the options for clouds larger than memory; the command receives `tiles`."""

    @functools.wraps(command)
    def with_options(
        *args: object,
        tile: float | None,
        buffer: float | None,
        memory: int | None,
        scratch: str | None,
        one_cloud: bool,
        scheduler: str | None,
        **others: object,
    ) -> object:
        return command(*args, tiles=TileOptions(tile, buffer, memory, scratch, one_cloud, scheduler), **others)

    for option in reversed(_OPTIONS):
        with_options = option(with_options)
    return with_options  # type: ignore[return-value]  # click keeps the signature


_OPTIONS: tuple[Callable[[Any], Any], ...] = (
    click.option(
        "--tile",
        type=TileSize(),
        help="Cut the cloud into tiles of at most this side, and join what is found in them; auto: into as few as"
        " --memory allows.  [default: auto if the cloud does not fit]",
    ),
    click.option(
        "--buffer",
        type=NumberRange(0, float("inf"), min_open=True, max_open=True),
        metavar="SIZE",
        help="Margin about each tile in which it sees its neighbours' points.  [default: a tenth of a tile]",
    ),
    click.option(
        "--memory",
        type=Memory(),
        metavar="SIZE",
        help="Memory for all processes together, such as 4GB; with --scheduler for each.  [default: 1 GB each]",
    ),
    click.option(
        "--scratch",
        metavar="FOLDER",
        shell_complete=complete_files,
        help="Folder for the tiles, about 100 bytes a point.  [default: that of the result]",
    ),
    click.option("--one-cloud", is_flag=True, help="Take all files for parts of one cloud, and cut it into tiles."),
    click.option(
        "--scheduler",
        metavar="ADDRESS",
        help="Search the tiles on the workers of this Dask scheduler, such as tcp://host:8786. Needs Dask.",
    ),
)
