"""`cylx view`: show a result in a window."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from cylx.cli.batch.jobs import ANNOTATED, RESULT
from cylx.cli.options.configuration import complete_files, debug_option
from cylx.cli.terminal.group import ExampleCommand
from cylx.errors import InputError, UsageError
from cylx.io.existing import has_anything
from cylx.io.outputs import STREAM

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from cylx.records import PointCloud

_REMEDY = "write a page instead, by cylx extract --report"


@click.command(
    cls=ExampleCommand,
    examples=["cylx view scan.cylinders.json", "cylx view scan.cylinders.json --cloud scan.ply"],
)
@click.argument("result", shell_complete=complete_files)
@click.option(
    "--cloud",
    metavar="FILE",
    shell_complete=complete_files,
    help="The annotated cloud, or another cloud.  [default: the annotated cloud beside the result]",
)
@debug_option
def view(*, result: str, cloud: str | None) -> None:
    """Show the cylinders of RESULT and the cloud, coloured by cylinder, in a window.

    RESULT is a JSON file of 'cylx extract'. Drag to turn, wheel to zoom, Q to close. The window needs a display;
    without one, 'cylx extract --report' writes a page for any browser.
    """
    from cylx.io import read_cloud, read_json
    from cylx.optional.open3d import NoDisplayError, show_scene
    from cylx.palette import cylinder_colors
    from cylx.results import Result

    document = Result.parse(read_json(result), result)
    annotated = read_cloud(cloud or beside(result))
    import numpy as np

    shapes = [(np.array(one.start), np.array(one.end), one.radius) for one in document.cylinders]
    tints = cylinder_colors(np.arange(len(shapes)))
    title = f"cylx: {document.input.file}, {len(shapes)} cylinders"
    try:
        show_scene(annotated.points, point_colors(annotated, len(shapes)), shapes, tints, title)
    except (NoDisplayError, ImportError) as error:
        fault = "there is no display" if isinstance(error, NoDisplayError) else "open3d does not run here"
        raise UsageError("the window", fault, _REMEDY) from error


def beside(result: str) -> str:
    """Return the name of the annotated cloud that was written with a result.

    Raises
    ------
    InputError
        If there is none.
    """
    from cylx.io import LAS_SUFFIXES

    stem = result.removesuffix(RESULT) if result.endswith(RESULT) else str(Path(result).with_suffix(""))
    names = [stem + ANNOTATED + suffix for suffix in (".ply", *LAS_SUFFIXES, ".pcd")]
    found = next((name for name in names if result != STREAM and has_anything(name)), None)
    if found is None:
        raise InputError(result, "has no annotated cloud beside it", "name the cloud by --cloud FILE")
    return found


def point_colors(cloud: PointCloud, cylinders: int) -> NDArray[np.uint8]:
    """Return the colours of the points of an annotated cloud by cylinder; points of any other cloud are grey.

    Parameters
    ----------
    cloud : PointCloud
    cylinders : int
        Number of cylinders; other ids count as no cylinder.

    Returns
    -------
    ndarray of shape (N, 3), uint8
    """
    import numpy as np

    from cylx.palette import cylinder_colors

    ids: NDArray[Any] = np.full(len(cloud.points), -1)
    if cloud.table is not None and "cylinder_id" in (cloud.table.dtype.names or ()):
        ids = np.asarray(cloud.table["cylinder_id"][slice(None) if cloud.valid is None else cloud.valid])
        ids = np.where((ids >= 0) & (ids < cylinders), ids, -1).astype(np.int64)
    return cylinder_colors(ids)
