"""`cylx synth`: make clouds whose cylinders are known."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeVar

import click

from cylx.cli.batch.jobs import TRUTH, check_apart
from cylx.cli.batch.summary import legible
from cylx.cli.options.configuration import (
    Bounds,
    RadiusRange,
    Vector,
    complete_files,
    debug_option,
    json_option,
    overwrite_option,
)
from cylx.cli.terminal.failures import answer
from cylx.cli.terminal.group import ExampleGroup
from cylx.errors import UsageError

if TYPE_CHECKING:
    from cylx.synthetic import Plot, SyntheticScene

Command = TypeVar("Command", bound=Callable[..., Any])


def output_options(command: Command) -> Command:
    """Add the options of both scenes: position, scale and file format."""
    command = debug_option(json_option(overwrite_option(command)))
    for option in _OUTPUT:
        command = option(command)
    return command


_OUTPUT: tuple[Callable[[Any], Any], ...] = (
    click.option(
        "--precision",
        type=click.Choice(["double", "single"]),
        default="double",
        show_default=True,
        help="Precision of the coordinates in the file.",
    ),
    click.option("--offset", type=Vector(), default="0,0,0", help="Move the scene, in its unit after --scale."),
    click.option("--scale", type=float, default=1.0, show_default=True, help="Scale the scene by this factor."),
    click.option("--seed", type=click.IntRange(min=0), metavar="N", default=0, show_default=True, help="Random seed."),
)


@click.group(cls=ExampleGroup, examples=["cylx synth single can.ply --theta 90", "cylx synth multi room.pcd --seed 7"])
def synth() -> None:
    """Make a cloud whose cylinders are known.

    NAME.truth.json, beside the cloud, lists its cylinders; 'cylx evaluate' compares a result with it.
    """


@synth.command(examples=["cylx synth single can.ply", "cylx synth single can.xyz --theta 90 --sigma 0.005 --p 0.1"])
@click.argument("out", shell_complete=complete_files)
@click.option("--points", type=int, default=10000, show_default=True, help="Number of points.")
@click.option("--height", type=float, default=4.0, show_default=True, help="Height of the cylinder, in radii.")
@click.option("--sigma", type=float, default=0.01, show_default=True, help="Noise of a point, in radii.")
@click.option("--p", type=float, default=0.0, show_default=True, help="Probability that a point is an outlier.")
@click.option("--sigma-o", type=float, default=0.04, show_default=True, help="Noise of an outlier, in radii.")
@click.option("--theta", "theta_deg", type=float, default=360.0, show_default=True, help="Visible angle, degrees.")
@output_options
def single(
    *,
    out: str,
    scale: float,
    offset: tuple[float, ...],
    precision: str,
    overwrite: bool,
    as_json: bool,
    **parameters: Any,  # noqa: ANN401  the options of the scene, of many types
) -> None:
    """Make one cylinder of radius 1, as in the paper.

    OUT ends in .ply, .pcd or .xyz.
    """
    from cylx import synthetic

    prepare(out, overwrite=overwrite)
    scene = synthetic.single(**parameters).moved(scale, offset)
    write_scene(out, scene, precision=precision, overwrite=overwrite, as_json=as_json)


@synth.command(examples=["cylx synth multi room.ply --cylinders 10", "cylx synth multi room.ply --scale 1000"])
@click.argument("out", shell_complete=complete_files)
@click.option("--points", type=int, default=100000, show_default=True, help="Number of points.")
@click.option("--cylinders", type=int, default=5, show_default=True, help="Number of cylinders.")
@click.option("--planes", type=int, default=1, show_default=True, help="Number of floor, walls, ceiling: 0 to 6.")
@click.option("--boxes", type=int, default=2, show_default=True, help="Number of boxes.")
@click.option("--spheres", type=int, default=2, show_default=True, help="Number of spheres.")
@click.option("--cones", type=int, default=1, show_default=True, help="Number of cones.")
@click.option("--noise", type=float, default=0.05, show_default=True, help="Share of points anywhere in the room.")
@click.option("--sigma", type=float, default=0.002, show_default=True, help="Noise of points on surfaces.")
@click.option("--radius", type=RadiusRange(), default="0.04:0.16", show_default=True, help="Radii of the cylinders.")
@click.option(
    "--coverage", "coverage_min_deg", type=float, default=150.0, show_default=True, help="Least visible angle, degrees."
)
@click.option("--room", type=float, help="Width of the room.  [default: as wide as the objects need]")
@output_options
def multi(
    *,
    out: str,
    scale: float,
    offset: tuple[float, ...],
    precision: str,
    overwrite: bool,
    as_json: bool,
    radius: Bounds,
    **parameters: Any,  # noqa: ANN401  the options of the scene, of many types
) -> None:
    """Make a room with cylinders, planes, boxes, spheres, cones and noise.

    OUT ends in .ply, .pcd or .xyz. Take the unit as metres; --scale 1000 turns them into millimetres.
    """
    from cylx import synthetic

    prepare(out, overwrite=overwrite)
    radius_min, radius_max = radius
    if radius_min is None or radius_max is None:
        raise UsageError("--radius", "one side is empty", "give both, such as 0.04:0.16")
    scene = synthetic.multi(radius_min=radius_min, radius_max=radius_max, **parameters).moved(scale, offset)
    write_scene(out, scene, precision=precision, overwrite=overwrite, as_json=as_json)


@synth.command(examples=["cylx synth piping plant.ply", "cylx synth piping plant.ply --runs 20 --scanners 3 --seed 7"])
@click.argument("out", shell_complete=complete_files)
@click.option("--points", type=int, help="Number of points.  [default: 50000 a run]")
@click.option("--runs", type=int, default=5, show_default=True, help="Number of connected runs of pipes.")
@click.option("--scanners", type=int, default=4, show_default=True, help="Number of places it is seen from: 1 to 8.")
@click.option("--planes", type=int, default=2, show_default=True, help="Number of floor, walls, ceiling: 0 to 6.")
@click.option("--noise", type=float, default=0.01, show_default=True, help="Share of points anywhere in the room.")
@click.option("--sigma", type=float, default=0.002, show_default=True, help="Noise of points on surfaces.")
@output_options
def piping(
    *,
    out: str,
    scale: float,
    offset: tuple[float, ...],
    precision: str,
    overwrite: bool,
    as_json: bool,
    **parameters: Any,  # noqa: ANN401  the options of the scene, of many types
) -> None:
    """Make a room with runs of pipes: elbows, tees, reducers, flanges, valves, caps, insulation, supports.

    OUT ends in .ply, .pcd or .xyz. The unit is metres; --scale 1000 turns them into millimetres. A point is there if at
    least one scanner sees it. The truth also lists fittings and runs.
    """
    from cylx import synthetic

    prepare(out, overwrite=overwrite)
    scene = synthetic.piping(**parameters).moved(scale, offset)
    write_scene(out, scene, precision=precision, overwrite=overwrite, as_json=as_json)


@synth.command(
    examples=["cylx synth forest plot.ply", "cylx synth forest plot.ply --side 30 --scanner mobile --slope 0.3"]
)
@click.argument("out", shell_complete=complete_files)
@click.option("--side", type=float, default=20.0, show_default=True, help="Side of the square plot, metres.")
@click.option("--stems-per-hectare", type=float, default=700.0, show_default=True, help="Density of the stems.")
@click.option("--shrubs-per-hectare", type=float, default=400.0, show_default=True, help="Density of the shrubs.")
@click.option(
    "--scanner", type=click.Choice(["terrestrial", "mobile"]), default="terrestrial", show_default=True,
    help="From a few places, or from a path with a noise of centimetres.",
)  # fmt: skip
@click.option("--stations", type=int, default=4, show_default=True, help="Number of places of a terrestrial scanner.")
@click.option("--slope", type=float, default=0.2, show_default=True, help="Slope of the ground, height per length.")
@click.option(
    "--spacing", type=float, default=0.006, show_default=True, help="Spacing of points 10 m from a scanner, metres."
)
@output_options
def forest(
    *,
    out: str,
    scale: float,
    offset: tuple[float, ...],
    precision: str,
    overwrite: bool,
    as_json: bool,
    **parameters: Any,  # noqa: ANN401  the options of the plot, of many types
) -> None:
    """Make a plot of a forest: stems with taper, lean and bark, branches, shrubs, and ground that slopes.

    OUT ends in .ply, .pcd or .xyz. The unit is metres; --scale 1000 turns places into millimetres. The truth lists the
    stems with their diameters at breast height, metres.
    """
    from cylx import synthetic

    prepare(out, overwrite=overwrite)
    plot = synthetic.forest(**parameters).moved(scale, offset)
    write_scene(out, plot, precision=precision, overwrite=overwrite, as_json=as_json)


def truth_path(out: str) -> str:
    """Return the name of the truth file of a cloud."""
    return str(Path(out).with_name(Path(out).stem + TRUTH))


def prepare(out: str, *, overwrite: bool) -> None:
    """Refuse outputs that cannot be written, before anything is computed."""
    from cylx.io import check_writable

    check_apart([], [out, truth_path(out)])
    for path in (out, truth_path(out)):
        check_writable(path, overwrite=overwrite)


def write_scene(out: str, scene: SyntheticScene | Plot, *, precision: str, overwrite: bool, as_json: bool) -> None:
    """Write a scene and its truth, and print a JSON report if requested."""
    from cylx.io import write_cloud, write_text
    from cylx.synthetic import SyntheticScene

    dtype: Literal["f4", "f8"] = "f4" if precision == "single" else "f8"
    write_cloud(out, scene.points, properties=None, overwrite=overwrite, dtype=dtype)
    write_text(truth_path(out), json.dumps(scene.truth(), indent=2) + "\n", overwrite=overwrite)
    if as_json:
        files = {"file": legible(out), "truth": legible(truth_path(out))}
        true = {"cylinders": scene.cylinders} if isinstance(scene, SyntheticScene) else {"stems": scene.stems}
        counts = {name: len(some) for name, some in true.items()}
        told = {**files, "points": len(scene.points), **counts}
        answer(json.dumps(told, indent=2, ensure_ascii=False) + "\n", as_json=True)
