"""One cloud in tiles: read piece by piece, searched by several processes or a cluster, written piece by piece."""

from __future__ import annotations

import os
from collections.abc import Sequence
from contextlib import AbstractContextManager, ExitStack
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from cylx.cli.batch.found import report
from cylx.cli.batch.jobs import MESH, RESULT, Job, is_folder, plan_jobs
from cylx.cli.batch.memory import cores, free_memory, memory_needed
from cylx.cli.batch.outcomes import Finished
from cylx.cli.batch.tile_workers import runner_of
from cylx.cli.batch.writing import mesh_bytes
from cylx.cli.options.tiles import AUTO, TileOptions
from cylx.cli.terminal.signals import Listener, check_heard
from cylx.cli.terminal.stopwatch import Stopwatch
from cylx.errors import UsageError
from cylx.io.outputs import STANDARD_OUTPUT, STREAM

if TYPE_CHECKING:
    from cylx.cli.terminal.display import Messages
    from cylx.config import Config
    from cylx.io import Scratch, StreamedCloud
    from cylx.records import Selection
    from cylx.tiles.run import Options, Outcome

OF_TILE, SHARE_OF_TILE = 1_000_000_000, 0.4
"""Memory for the search of one tile, bytes, or this share of what there is if that is less: two have room then."""


class TiledRun(NamedTuple):
    """How a cloud in tiles is processed: what `Run` knows of it."""

    settings: Config
    threads: int | None
    overwrite: bool
    messages: Messages
    selection: Selection
    tiles: TileOptions
    processes: int | None
    resume: bool


def needs_tiles(scan: str, tiles: TileOptions) -> bool:
    """Return whether a scan is to be cut: on request, or because it would not fit into memory."""
    if tiles.certain:
        return True
    available = tiles.memory if tiles.memory is not None else free_memory()
    return available is not None and memory_needed(scan) > available


def why_tiles(scan: str, tiles: TileOptions) -> str:
    """Return the line that says why a scan is cut that nobody asked to cut."""
    needed, available = memory_needed(scan) / 1e9, (tiles.memory or free_memory() or 0.0) / 1e9
    return f"{needed:.2g} GB would be needed and {available:.2g} GB are there: the scan is cut into tiles"


def check_tiles(jobs: Sequence[Job], settings: Config, *, runs: bool = False) -> None:
    """Refuse what cannot be had from tiles, before anything is computed.

    Raises
    ------
    UsageError
        If an output needs all points at once.
    ConfigError
        If the configuration gives nothing that could be joined.
    """
    from cylx.tiles.run import check_method

    if runs:
        remedy = "leave it out, and join what was found by: cylx runs RESULT SCAN, or without SCAN by the axes alone"
        raise UsageError("--runs", "does not work with tiles", remedy)
    for job in jobs:
        if job.annotated is not None and not job.annotated.lower().endswith((".ply", ".las", ".laz")):
            raise UsageError(f"--annotated {job.annotated}", "does not work with tiles", "choose a name in .ply")
    check_method(settings)


def plan_one_cloud(
    scans: Sequence[str], output: str | None, annotate: bool | None, mesh: str | None, units: str | None
) -> tuple[Job, tuple[Job, ...]]:
    """Name the outputs of several files that are one cloud: one result, and an annotated cloud for each.

    Parameters
    ----------
    scans : sequence of str
    output, annotate, mesh, units
        As for `plan_jobs`. Without a name the result has that of the folder of the first file.

    Returns
    -------
    first : Job
        The first file with the result of all.
    others : tuple of Job
        The other files; they have no result of their own.
    """
    stream = output in STANDARD_OUTPUT
    named = output is not None and not stream and not is_folder(output)
    folder = str(Path(output).parent) + os.sep if named and output is not None else output
    wanted = annotate if annotate is not None else not stream
    jobs = plan_jobs(scans, None if stream else folder, wanted, None)
    beside = Path(jobs[0].result).parent
    name = f"{Path(scans[0]).resolve().parent.name or 'cloud'}{RESULT}"
    result = output if (named or stream) and output is not None else str(beside / name)
    if mesh is not None and is_folder(mesh):
        mesh = str(Path(mesh) / (Path(name).name.removesuffix(RESULT) + MESH))
    first = replace(jobs[0], result=STREAM if stream else result, mesh=mesh, units=units)
    return first, tuple(replace(job, units=units) for job in jobs[1:])


def extract_tiled(run: TiledRun, jobs: Sequence[Job]) -> Finished:
    """Extract the cylinders of one cloud in tiles, write them, and report them.

    Parameters
    ----------
    run : TiledRun
    jobs : sequence of Job
        The files of the cloud; the first has the name of the result.

    Raises
    ------
    InputError
        If the cloud cannot be read or used.
    OutputError
        If the outputs or the scratch folder cannot be written.
    """
    from cylx.cli.terminal.display import Observers, observed
    from cylx.cli.terminal.startup import collect_rarely, import_numba_without_blas

    collect_rarely()
    import_numba_without_blas()
    from cylx.api.warmup import ask_between_kernels, compile_kernels
    from cylx.tiles.run import extract_in_tiles

    ask_between_kernels(check_heard)
    stopwatch, job = Stopwatch(jobs[0].scan), jobs[0]
    with ExitStack() as stack:
        observer = Observers(Listener(), stack.enter_context(run.messages.progress()), stopwatch)
        compile_kernels(observer)
        wanted = job.rejected is not None or job.report is not None
        options = options_of(run.tiles, run.processes, run.threads, rejected=wanted)
        runner = stack.enter_context(runner_of(run.tiles, run.processes, options.memory))
        scratch = stack.enter_context(_scratch_of(run, jobs, options))
        clouds = [_streamed(one, scratch.path(f"spool-{i}"), run) for i, one in enumerate(jobs)]
        outcome = extract_in_tiles(clouds, run.selection, run.settings, options, scratch, runner, observer)
        with observed(observer, "writing"):
            remarks = _write(jobs, clouds, outcome, overwrite=run.overwrite)
    extraction = outcome.extraction
    found = len(extraction.cylinders)
    report(run.messages, job, extraction)
    for remark in remarks:
        run.messages.say(f"warning: {remark}")
    rows = sum(extraction.rows)
    blends = len(extraction.blends or ())
    return Finished(rows, found, extraction.warnings, stopwatch.report(rows, found), blends)


def options_of(tiles: TileOptions, processes: int | None, threads: int | None, *, rejected: bool = False) -> Options:
    """Return how to cut: the size of the tiles must not depend on what is free, nor on the number of processes.

    Raises
    ------
    UsageError
        If the memory is too little for any tile.
    """
    from cylx.tiles.run import LEAST_MEMORY, Options

    share = 1.0 if tiles.scheduler is not None else SHARE_OF_TILE
    if tiles.memory is not None and share * tiles.memory < LEAST_MEMORY:
        least = LEAST_MEMORY / share / 1e9
        raise UsageError("--memory", f"{tiles.memory / 1e9:.2g} GB are too little", f"give at least {least:.2g} GB")
    each = float(OF_TILE)
    if tiles.memory is not None:
        each = float(tiles.memory) if tiles.scheduler is not None else min(each, share * tiles.memory)
    size = None if tiles.size in (None, AUTO) else tiles.size
    return Options(size, tiles.buffer, each, threads or max(1, cores() // (processes or 1)), rejected)


def _streamed(job: Job, spool: Path, run: TiledRun) -> StreamedCloud:
    """Open a file of the cloud, and check that its annotated cloud can be written."""
    from cylx.io import check_annotated, stream_cloud

    cloud = stream_cloud(job.scan, spool, scan=run.selection.scan, units=job.units)
    if job.annotated is not None:
        check_annotated(job.annotated, cloud.few(3))
    return cloud


def _scratch_of(run: TiledRun, jobs: Sequence[Job], options: Options) -> AbstractContextManager[Scratch]:
    """Open the scratch folder of a cloud."""
    from cylx.io import open_scratch, sha256_of
    from cylx.results.parts import Input
    from cylx.version import __version__

    result = Path(jobs[0].result)
    given = run.tiles.scratch
    parent = Path(given) if given is not None else result.parent
    if given is None and str(result) == STREAM:
        raise UsageError("--scratch", "is needed if the result goes to standard output", "give a folder")
    keys = {key: value for key, value in Input.keys_of(run.selection).items() if value is not None}
    manifest = {
        "version": __version__,
        "inputs": [sha256_of(job.scan) if job.scan != STREAM else STREAM for job in jobs],
        "selection": {key: value if key != "crop" else value.model_dump() for key, value in keys.items()},
        "config": run.settings.model_dump(mode="json"),
        "options": [options.size, options.buffer, options.memory, options.rejected],
    }
    return open_scratch(parent, str(result), manifest, resume=run.resume)


def _write(jobs: Sequence[Job], clouds: Sequence[StreamedCloud], outcome: Outcome, *, overwrite: bool) -> list[str]:
    """Write the JSON, the annotated clouds and all other outputs, all or nothing."""
    from cylx.io import write_annotated_stream, write_bytes, write_text
    from cylx.io.outputs import all_or_none
    from cylx.io.streamed_cloud import ROWS
    from cylx.report import html_of, png_of
    from cylx.results import Rejections, Result
    from cylx.tiles.sample import sampled

    extraction, labels, job = outcome.extraction, outcome.labels, jobs[0]
    content = Result.of(extraction)
    mesh, remarks = mesh_bytes(job, content)
    with all_or_none(overwrite=overwrite) as staged:
        result, start = staged(job.result), 0  # renamed last: if the result exists, the other outputs do too
        for one, cloud, colored in zip(jobs, clouds, outcome.colored, strict=True):
            if one.annotated is not None:
                pieces = labels.pieces(start, cloud.rows, ROWS)
                write_annotated_stream(staged(one.annotated), cloud, pieces, colored=colored, overwrite=overwrite)
            start += cloud.rows
        if job.mesh is not None and mesh is not None:
            write_bytes(staged(job.mesh), mesh, overwrite=overwrite)
        if job.rejected is not None:
            write_text(staged(job.rejected), Rejections.of(extraction).to_json(), overwrite=overwrite)
        if job.report is not None or job.picture is not None:
            some = sampled(extraction, labels)
            if job.report is not None:
                page = html_of(some, result=content, points=labels.points)
                write_text(staged(job.report), page, overwrite=overwrite)
            if job.picture is not None:
                write_bytes(staged(job.picture), png_of(some), overwrite=overwrite)
        write_text(result, content.to_json(), overwrite=overwrite)
    if job.mesh is not None and mesh is None:  # an old mesh does not belong to this result
        Path(job.mesh).unlink(missing_ok=True)
    return remarks
