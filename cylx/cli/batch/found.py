"""The report on a finished scan: the cylinders found and the files written."""

from __future__ import annotations

from typing import TYPE_CHECKING

from cylx.cli.terminal.display import Messages, show_table
from cylx.cli.terminal.failures import tell
from cylx.wording import counted, number, piping_counted

if TYPE_CHECKING:
    from cylx.cli.batch.jobs import Job
    from cylx.records import CylinderFit, Extraction, TiledExtraction

_MOST_ROWS = 20
_CYLINDER_HEADER = ["id", "radius", "height", "coverage", "inliers", "rmse", "confidence", "direction"]


def report(messages: Messages, job: Job, extraction: Extraction | TiledExtraction) -> None:
    """Report the cylinders found in a scan and the files written."""
    if messages.quiet:
        return
    fits = extraction.cylinders
    tell(found_line(job, len(fits), len(extraction.blends or ())))
    piping = getattr(extraction, "piping", None)
    if piping is not None:
        tell(piping_counted(len(piping.runs), [one.kind for one in piping.fittings]))
    for warning in extraction.warnings:
        tell(f"warning: {warning}")
    if messages.verbose:
        scene = extraction.scene
        tell(", ".join(f"{name} {number(getattr(scene, name), 4)}" for name in ("spacing", "noise", "extent")))
        show_table(["stage", "considered", "kept", "rejected"], _stage_rows(extraction), err=True)
    if fits:
        shown = fits if messages.verbose else fits[:_MOST_ROWS]
        header, rows = _CYLINDER_HEADER, [_cylinder_row(i, fit) for i, fit in enumerate(shown)]
        if extraction.config.scene.catalogue:
            header, rows = [*header, "nominal"], [[*row, _nominal(f)] for row, f in zip(rows, shown, strict=True)]
        show_table(header, rows, err=True)
        if len(shown) < len(fits):
            tell(f"… and {len(fits) - len(shown)} more; -v shows them all")


def found_line(job: Job, found: int, blends: int = 0) -> str:
    """Format the numbers of cylinders and blends in a scan and the names of the files written."""
    from cylx.io import printable

    written = [printable(name) for name in job.written(found) if name != "-"]
    scan = "standard input" if job.scan == "-" else printable(job.scan)
    names = " and ".join(filter(None, [", ".join(written[:-1]), *written[-1:]]))
    return f"{scan}: {counted(found, blends)}" + (f", written to {names}" if written else "")


def _cylinder_row(index: int, fit: CylinderFit) -> list[str]:
    """Format one row of the table of cylinders."""
    shape = fit.cylinder
    direction = " ".join(f"{x:.3f}".replace("-0.000", "0.000") for x in shape.direction)
    numbers = [number(shape.radius, 5), number(shape.height, 4), f"{fit.coverage * 57.29577951308232:.0f}°"]
    return [
        str(index),
        *numbers,
        str(fit.inliers),
        number(fit.rmse, 3),
        "-" if fit.confidence is None else f"{fit.confidence:.2f}",
        direction,
    ]


def _nominal(fit: CylinderFit) -> str:
    """Return the catalogue entry assigned to a cylinder, with a question mark if it is ambiguous."""
    nominal = fit.nominal
    if nominal is None or nominal.decision == "none":
        return "-"
    return (nominal.name or number(nominal.nominal_radius, 5)) + ("?" if nominal.decision == "ambiguous" else "")


def _stage_rows(extraction: Extraction | TiledExtraction) -> list[list[str]]:
    """Format the rows of the table of stages."""
    return [
        [
            stage.name,
            str(stage.considered),
            str(stage.kept),
            ", ".join(f"{reason} {count}" for reason, count in stage.rejected.items()),
        ]
        for stage in extraction.stages
    ]
