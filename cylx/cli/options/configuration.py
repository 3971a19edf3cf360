"""Options shared by several commands, one function each.

| function | options | the command receives |
|---|---|---|
| `configured` | `-c/--config --method --preset --set --seed`, and limits: `--radius` … | `settings`, a `Config` |
| `with_messages` | `-q/--quiet -v/--verbose` | `messages`, a `Messages` |
| `overwrite_option` | `--overwrite` | `overwrite`, a bool |
| `json_option` | `--json` | `as_json`, a bool |
| `debug_option` | `--debug` | nothing |
| `selecting` in `selection.py` | `--crop --voxel --every --classes --scan` | `selection`, a `Selection` |

`complete_files` lets the shell complete the file names of an argument or option.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from math import isfinite
from typing import TYPE_CHECKING, Any, TypeVar

import click

from cylx.cli.terminal.failures import DEBUG
from cylx.config.choices import METHODS, PRESETS

Command = TypeVar("Command", bound=Callable[..., Any])
Bounds = tuple[float | None, float | None]
Known = tuple[float, float | None]


if TYPE_CHECKING:
    from click.shell_completion import CompletionItem

    BoundsType = click.ParamType[Bounds]
    KnownType = click.ParamType[Known]
    VectorType = click.ParamType[tuple[float, ...]]
else:
    BoundsType = KnownType = VectorType = click.ParamType  # not generic in older versions


class RadiusRange(BoundsType):
    """`MIN:MAX`; either side may be empty."""

    name = "min:max"

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> Bounds:
        """Parse the two radii."""
        if isinstance(value, tuple):
            return value
        sides = str(value).split(":")
        if len(sides) != 2 or not any(sides):
            self.fail(f"'{value}' is not MIN:MAX, such as 0.01:0.2, 0.01: or :0.2", param, ctx)
        low, high = (self._radius(side, param, ctx) for side in sides)
        if low is not None and high is not None and low > high:
            self.fail(f"'{value}' has its smallest radius above its largest; write {sides[1]}:{sides[0]}", param, ctx)
        return low, high

    def _radius(self, side: str, param: click.Parameter | None, ctx: click.Context | None) -> float | None:
        """Parse one radius; None for an empty side."""
        if not side.strip():
            return None
        try:
            radius = float(side)
        except ValueError:
            self.fail(f"'{side}' is not a number", param, ctx)
        if not 0 < radius < float("inf"):
            self.fail(f"'{side}' is not a radius; it must be > 0 and finite", param, ctx)
        return radius


class KnownRadius(KnownType):
    """`R`, or `R:SD`."""

    name = "r[:sd]"

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> Known:
        """Parse the radius and its standard deviation."""
        if isinstance(value, tuple):
            return value
        try:
            numbers = [float(side) for side in str(value).split(":")]
        except ValueError:
            numbers = []
        if len(numbers) not in {1, 2} or not all(0 < number < float("inf") for number in numbers):
            self.fail(f"'{value}' is not R or R:SD with positive numbers, such as 0.05 or 0.05:0.001", param, ctx)
        return numbers[0], numbers[1] if len(numbers) == 2 else None


class Vector(VectorType):
    """`X,Y,Z`."""

    name = "x,y,z"
    example = "100,200,0"

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> tuple[float, ...]:
        """Parse the three numbers."""
        if isinstance(value, tuple):
            return value
        try:
            numbers = tuple(float(part) for part in str(value).split(","))
        except ValueError:
            numbers = ()
        if len(numbers) != 3:
            self.fail(f"'{value}' is not three numbers such as {self.example}", param, ctx)
        return numbers


class Axis(Vector):
    """`X,Y,Z` as a direction, or the name of a coordinate axis."""

    example = "0,0,1, nor x, y or z"

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> tuple[float, ...]:
        """Parse the three numbers, or the name."""
        if value in ("x", "y", "z"):
            return tuple(float(name == value) for name in "xyz")
        axis = super().convert(value, param, ctx)
        if not (any(axis) and all(map(isfinite, axis))):
            self.fail(f"'{value}' is not a direction; the numbers must be finite and not all 0", param, ctx)
        return axis


def complete_files(_ctx: click.Context, _param: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Return the instruction to the shell to complete a file name."""
    from click.shell_completion import CompletionItem

    return [CompletionItem(incomplete, type="file")]


def configured(command: Command) -> Command:
    """Add the options of the configuration; the command receives `settings`."""

    @functools.wraps(command)
    def with_settings(
        *args: object,
        config: str | None,
        preset: str | None,
        overrides: tuple[str, ...],
        **others: Any,  # noqa: ANN401  of several kinds
    ) -> object:
        from cylx.config import NAMED_OPTIONS, check_tolerance, load_config, named_options

        options = named_options(**{name: others.pop(name) for name in NAMED_OPTIONS})
        settings = load_config(path=config, preset=preset, overrides=overrides, options=options)
        check_tolerance(settings, options)
        return command(*args, settings=settings, **others)

    for option in reversed(_CONFIGURATION):
        with_settings = option(with_settings)
    return with_settings  # type: ignore[return-value]  # click keeps the signature


_CONFIGURATION: tuple[Callable[[Any], Any], ...] = (
    click.option(
        "-c",
        "--config",
        metavar="FILE",
        shell_complete=complete_files,
        help="YAML file; 'cylx config init' writes one.",
    ),
    click.option(
        "--method",
        type=click.Choice(METHODS),
        help="Method that finds the cylinders: the clustering game, or one that the paper compares it with."
        "  [default: gt]",
    ),
    click.option(
        "--preset",
        type=click.Choice(PRESETS),
        help="Default settings: the best there are, or those of the paper to the letter. The values in the --config"
        " file override them.  [default: auto]",
    ),
    click.option(
        "--set", "overrides", metavar="KEY=VALUE", multiple=True, help="Set one key, as in slicing.planes=80."
    ),
    click.option("--seed", type=click.IntRange(min=0), metavar="N", help="Random seed.  [default: 0]"),
    click.option("--radius", type=RadiusRange(), help="Smallest and largest radius, in the unit of the scan."),
    click.option(
        "--axis", type=Axis(), help="Direction of the cylinders, up to sign, or just x, y or z.  [default: any]"
    ),
    click.option(
        "--axis-tolerance",
        "axis_tolerance_deg",
        type=click.FloatRange(0, 90, min_open=True),
        metavar="DEG",
        help="Largest angle between a cylinder and --axis, degrees.  [default: 10]",
    ),
    click.option(
        "--axis-sd",
        "axis_sd_deg",
        type=click.FloatRange(0, 90, min_open=True),
        metavar="DEG",
        help="Standard deviation of the cylinders' tilts from --axis, degrees: a prior for each fit.",
    ),
    click.option(
        "--known-radius",
        type=KnownRadius(),
        help="Known radius and its standard deviation: a prior for each fit.  [default: SD a thousandth]",
    ),
    click.option(
        "--catalogue",
        metavar="FILE",
        shell_complete=complete_files,
        help="CSV or YAML file of nominal radii; the one that the points support becomes the prior of a fit.",
    ),
    click.option(
        "--min-coverage",
        "min_coverage_deg",
        type=click.FloatRange(0, 360),
        metavar="DEG",
        help="Smallest angle of the surface that must be seen, about the axis, degrees.  [default: 20]",
    ),
    click.option(
        "--blends/--no-blends",
        default=None,
        help="Look for arcs that go on tangentially, such as rounds and fillets; they are listed by themselves."
        "  [default: yes]",
    ),
    click.option("--max-cylinders", type=click.IntRange(min=1), metavar="N", help="Maximum number of cylinders."),
    click.option("--planes", type=click.IntRange(min=0), metavar="N", help="Number of planes through the whole cloud."),
)


def with_messages(command: Command) -> Command:
    """Add `-q` and `-v`; the command receives `messages`."""

    @functools.wraps(command)
    def with_talk(*args: object, quiet: bool, verbose: bool, **others: object) -> object:
        from cylx.cli.terminal.display import Messages
        from cylx.cli.terminal.streams import keep_libraries_apart

        keep_libraries_apart(quiet=quiet)
        return command(*args, messages=Messages(quiet=quiet, verbose=verbose and not quiet), **others)

    verbose = click.option("-v", "--verbose", is_flag=True, help="Show what each stage kept and rejected, and why.")
    quiet = click.option("-q", "--quiet", is_flag=True, help="Show errors only.")
    return quiet(verbose(with_talk))  # type: ignore[return-value]  # click keeps the signature


def overwrite_option(command: Command) -> Command:
    """Add `--overwrite`."""
    return click.option("--overwrite", is_flag=True, help="Replace existing output files.")(command)


def json_option(command: Command) -> Command:
    """Add `--json`; the command receives `as_json`."""
    return click.option("--json", "as_json", is_flag=True, help="Print the answer as JSON.")(command)


def debug_option(command: Command) -> Command:
    """Add `--debug`, which shows the traceback of every failure."""

    def remember(ctx: click.Context, _: click.Parameter, debug: bool) -> None:
        ctx.meta[DEBUG] = debug or ctx.meta.get(DEBUG, False)

    return click.option(
        "--debug", is_flag=True, expose_value=False, callback=remember, help="Show the traceback of a failure."
    )(command)
