"""Write the outputs of a run together: the result, and what was asked for beside it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from cylx.cli.batch.jobs import Job
    from cylx.records import Extraction
    from cylx.results import Result


@dataclass(frozen=True)
class Written:
    """What was written for one scan.

    Parameters
    ----------
    job : Job
        With the outputs that exist now.
    remarks : list of str
        Remarks for the reader of the mesh.
    failed : dict of str to Exception
        What went wrong with the other outputs, by name.
    """

    job: Job
    remarks: list[str]
    failed: dict[str, Exception]


def mesh_bytes(job: Job, content: Result) -> tuple[bytes | None, list[str]]:
    """Make the requested mesh, with remarks for its reader."""
    if job.mesh is None:
        return None, []
    from cylx.cli.batch.meshes import mesh_of

    return mesh_of(job.mesh, content)


def write_job(job: Job, extraction: Extraction, *, overwrite: bool) -> Written:
    """Write the JSON of one scan, and the other requested outputs; the JSON is kept if one of them fails.

    Raises
    ------
    OutputError
        If the JSON cannot be written, or another program has written one of the outputs meanwhile. Then there is none.
    """
    from cylx.io import write_text
    from cylx.io.outputs import write_beside
    from cylx.results import Result

    content = Result.of(extraction)
    remarks: list[str] = []
    others = _writers(job, extraction, content, remarks, overwrite=overwrite)
    main = (job.result, lambda path: write_text(path, content.to_json(), overwrite=overwrite))
    failed = write_beside(main, others, overwrite=overwrite)
    if job.mesh is not None and job.mesh not in others:
        remarks.append(f"{job.mesh}: not written, as there are no cylinders")
        Path(job.mesh).unlink(missing_ok=True)  # an old mesh does not belong to this result
    return Written(job.without(failed), remarks, failed)


def _writers(
    job: Job, extraction: Extraction, content: Result, remarks: list[str], *, overwrite: bool
) -> dict[str, Callable[[str | Path], None]]:
    """Return what writes each requested output but the JSON; writing the mesh adds remarks for its reader."""
    from cylx.io import write_annotated, write_bytes, write_text

    def reject(path: str | Path) -> None:
        from cylx.results import Rejections

        write_text(path, Rejections.of(extraction).to_json(), overwrite=overwrite)

    def show(path: str | Path) -> None:
        from cylx.report import html_of

        write_text(path, html_of(extraction), overwrite=overwrite)

    def draw(path: str | Path) -> None:
        from cylx.report import png_of

        write_bytes(path, png_of(extraction), overwrite=overwrite)

    def mesh(path: str | Path) -> None:
        from cylx.cli.batch.meshes import mesh_of

        data, said = mesh_of(str(job.mesh), content)
        remarks.extend(said)
        write_bytes(path, data or b"", overwrite=overwrite)

    writers = (
        (job.annotated, lambda path: write_annotated(path, extraction, overwrite=overwrite)),
        (job.rejected, reject),
        (job.report, show),
        (job.picture, draw),
        (job.mesh if content.cylinders else None, mesh),
    )
    return {name: write for name, write in writers if name is not None}
