"""cylx finds every cylinder in a point cloud that has no normals.

The public names are imported on first use, so that `import cylx` and `cylx --help` are fast.
"""

from __future__ import annotations

import warnings
from importlib import import_module
from typing import TYPE_CHECKING

from cylx.moved import follow_old_names
from cylx.version import __version__

if TYPE_CHECKING:
    from cylx.api import evaluate as evaluate
    from cylx.api import extract as extract
    from cylx.api import read_result as read_result
    from cylx.api import to_dataframe as to_dataframe
    from cylx.api import to_dict as to_dict
    from cylx.api.deviations import measure_deviations as measure_deviations
    from cylx.api.piping import find_runs as find_runs
    from cylx.api.stems import find_stems as find_stems
    from cylx.api.tiled import extract_tiled as extract_tiled
    from cylx.config import Config as Config
    from cylx.config import load_config as load_config
    from cylx.deviation import Comparison as Comparison
    from cylx.errors import CylxError as CylxError
    from cylx.evaluation import compare as compare
    from cylx.geometry.cylinder import Cylinder as Cylinder
    from cylx.io import read_cloud as read_cloud
    from cylx.io import write_annotated as write_annotated
    from cylx.pipeline.segmented import fit_cylinder as fit_cylinder
    from cylx.records import CylinderFit as CylinderFit
    from cylx.records import Extraction as Extraction
    from cylx.records import PointCloud as PointCloud
    from cylx.records import RejectedFit as RejectedFit
    from cylx.records import TiledExtraction as TiledExtraction
    from cylx.records.stems import Stem as Stem
    from cylx.records.stems import StemPlot as StemPlot
    from cylx.report import plot_radii as plot_radii
    from cylx.report import plot_residuals as plot_residuals
    from cylx.report import plot_scene as plot_scene
    from cylx.report import show as show
    from cylx.results import Result as Result

_HOMES = {
    "Comparison": "cylx.deviation",
    "Config": "cylx.config",
    "Cylinder": "cylx.geometry.cylinder",
    "CylinderFit": "cylx.records",
    "CylxError": "cylx.errors",
    "Extraction": "cylx.records",
    "PointCloud": "cylx.records",
    "RejectedFit": "cylx.records",
    "Result": "cylx.results",
    "Stem": "cylx.records.stems",
    "StemPlot": "cylx.records.stems",
    "TiledExtraction": "cylx.records",
    "compare": "cylx.evaluation",
    "evaluate": "cylx.api",
    "extract": "cylx.api",
    "extract_tiled": "cylx.api.tiled",
    "find_runs": "cylx.api.piping",
    "find_stems": "cylx.api.stems",
    "fit_cylinder": "cylx.pipeline.segmented",
    "load_config": "cylx.config",
    "measure_deviations": "cylx.api.deviations",
    "plot_radii": "cylx.report",
    "plot_residuals": "cylx.report",
    "plot_scene": "cylx.report",
    "read_cloud": "cylx.io",
    "read_result": "cylx.api",
    "show": "cylx.report",
    "to_dataframe": "cylx.api",
    "to_dict": "cylx.api",
    "write_annotated": "cylx.io",
}

__all__ = [  # noqa: PLE0604  the names of a table are strings
    "__version__",
    *sorted(_HOMES),
]


follow_old_names()


def __getattr__(name: str) -> object:
    if name == "Rejection":
        warnings.warn(
            "cylx.Rejection is RejectedFit now; it goes with the next release", DeprecationWarning, stacklevel=2
        )
        name = "RejectedFit"
    if name not in _HOMES:
        raise AttributeError(f"module 'cylx' has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return __all__
