"""`cylx extract`: find the cylinders of scans."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING

import click

from cylx.cli.batch.jobs import check_apart, check_outputs, plan_jobs
from cylx.cli.batch.meshes import check_meshes
from cylx.cli.batch.options import BatchOptions, made_folder
from cylx.cli.options.batch import with_batch_options
from cylx.cli.options.configuration import complete_files, configured, debug_option, overwrite_option, with_messages
from cylx.cli.options.selection import selecting
from cylx.cli.options.tiles import TileOptions, with_tile_options
from cylx.cli.options.units import units_option
from cylx.cli.terminal.group import ExampleCommand

if TYPE_CHECKING:
    from cylx.cli.batch.batch import Batch
    from cylx.cli.batch.jobs import Job
    from cylx.cli.terminal.display import Messages
    from cylx.config import Config
    from cylx.records import Selection


@click.command(
    cls=ExampleCommand, examples=["cylx extract scan.ply", "cylx extract scans/ --jobs auto --resume --out-dir results"]
)
@click.argument("scans", metavar="SCAN...", nargs=-1, required=True, shell_complete=complete_files)
@click.option(
    "-o",
    "--output",
    metavar="FILE",
    shell_complete=complete_files,
    help="Name of the JSON; - for standard output (--json in other commands), or a folder.  [default: beside the scan]",
)
@click.option(
    "--annotate/--no-annotate",
    default=None,
    help="Write the cloud with the cylinder of each point.  [default: yes, unless the JSON goes to standard output]",
)
@click.option(
    "--annotated",
    metavar="FILE",
    shell_complete=complete_files,
    help="Name of the annotated cloud: .ply, .pcd, or for LAS and LAZ scans .las or .laz.  [default: beside the JSON]",
)
@click.option(
    "--rejected",
    metavar="FILE",
    shell_complete=complete_files,
    help="Write the rejected fits and the reasons as JSON; - for standard output, or a folder.",
)
@click.option(
    "--report",
    metavar="FILE",
    shell_complete=complete_files,
    help="Write an HTML page with the cloud and its cylinders in 3-D; - for standard output, or a folder.",
)
@click.option(
    "--png",
    metavar="FILE",
    shell_complete=complete_files,
    help="Write a picture of the cloud and its cylinders; - for standard output, or a folder. Needs matplotlib.",
)
@click.option(
    "--mesh",
    metavar="FILE",
    shell_complete=complete_files,
    help="Write the cylinders as a mesh: .ply, .obj, .glb or .stl, or a folder for an .obj. Needs trimesh.",
)
@units_option("a mesh that is .glb needs")
@click.option("--runs", is_flag=True, help="Join the cylinders to runs of pipe by elbows, tees and other fittings.")
@configured
@selecting
@click.option("--threads", type=click.IntRange(min=1), metavar="N", help="Threads to use.  [default: one per core]")
@click.option(
    "--require", type=click.IntRange(min=1), metavar="N", help="Exit with 5 if fewer cylinders are found; still write."
)
@click.option(
    "--profile",
    metavar="FILE",
    shell_complete=complete_files,
    help="Write seconds per stage and peak memory as JSON.",
)
@with_batch_options
@with_tile_options
@overwrite_option
@with_messages
@debug_option
def extract(
    *,
    scans: tuple[str, ...],
    output: str | None,
    annotate: bool | None,
    annotated: str | None,
    rejected: str | None,
    report: str | None,
    png: str | None,
    mesh: str | None,
    units: str | None,
    runs: bool,
    settings: Config,
    selection: Selection,
    threads: int | None,
    require: int | None,
    profile: str | None,
    options: BatchOptions,
    tiles: TileOptions,
    overwrite: bool,
    messages: Messages,
) -> None:
    """Find the cylinders of one or several scans.

    SCAN is a PLY, PCD, XYZ, LAS, LAZ, E57, PTX or NPY file, a folder of them, a pattern in quotes, or - for standard
    input. For scan.ply this writes scan.cylinders.json, the cylinders, and scan.annotated.ply, the cloud with the
    cylinder of each point; --report FILE adds a page for the browser. No tuning is needed: spacing, noise and radii are
    measured in the cloud, whatever its unit. A table of the cylinders goes to standard error.
    """
    from cylx.cli.batch.batch import Batch
    from cylx.cli.batch.run import Run
    from cylx.cli.batch.scans import find_scans

    output = options.output(output)
    found = find_scans(scans, recursive=options.recursive)
    others: tuple[Job, ...] = ()
    if tiles.one_cloud:
        from cylx.cli.batch.tiled import plan_one_cloud

        first, others = plan_one_cloud(found, output, annotate, mesh, units)
        jobs = [replace(first, annotated=annotated or first.annotated, rejected=rejected, report=report, picture=png)]
    else:
        jobs = plan_jobs(found, output, annotate, annotated, rejected, report, png, mesh, units)
    check_meshes([job.mesh for job in jobs if job.mesh is not None], units, found)
    summaries = options.summaries(output, [job.scan for job in jobs])
    extras = [*(name for name in [profile] if name is not None), *(job.annotated for job in others if job.annotated)]
    check_apart(found, [*(name for job in jobs for name in job.outputs), *extras, *summaries])
    run = Run(settings, threads, require, overwrite or options.resume, messages, selection)
    run = replace(run, runs=runs, tiles=tiles, processes=options.tile_processes(), resume=options.resume, others=others)
    if tiles.certain:
        from cylx.cli.batch.tiled import check_tiles

        check_tiles([*jobs, *others], settings, runs=runs)
    batch = Batch(run, jobs, options, summaries)
    with made_folder(output):
        check_outputs(jobs, [], overwrite=overwrite or options.resume)
        check_outputs([], extras, overwrite=overwrite or (options.resume and profile is None))
        batch.check(overwrite=overwrite)
        if png is not None:
            from cylx.report import check_pictures

            check_pictures()
        try:
            batch.go()
        finally:
            if profile is not None and batch.profiles:
                write_profile(profile, batch, overwrite=overwrite)


def write_profile(path: str, batch: Batch, *, overwrite: bool) -> None:
    """Write the times of all finished scans."""
    from cylx.io import write_text
    from cylx.version import __version__

    profile = {"cylx_version": __version__, "inputs": batch.profiles, "peak_memory_bytes": batch.peak}
    write_text(path, json.dumps(profile, indent=2) + "\n", overwrite=overwrite)
