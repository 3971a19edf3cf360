"""Results as JSON objects and tables: the result, the rejected cylinders, and their common parts.

Names are imported on first use, so that using one file does not import the others.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from cylx.results.cylinders import CatalogueMatch as CatalogueMatch
    from cylx.results.cylinders import Measured as Measured
    from cylx.results.cylinders import Numbered as Numbered
    from cylx.results.cylinders import ResultBlend as ResultBlend
    from cylx.results.cylinders import ResultCylinder as ResultCylinder
    from cylx.results.cylinders import Uncertainty as Uncertainty
    from cylx.results.fittings import ResultFitting as ResultFitting
    from cylx.results.fittings import ResultRun as ResultRun
    from cylx.results.rejected import RejectedCylinder as RejectedCylinder
    from cylx.results.rejected import Rejections as Rejections
    from cylx.results.rejected import rejections_schema as rejections_schema
    from cylx.results.result import Result as Result
    from cylx.results.result import SceneScale as SceneScale
    from cylx.results.result import Stage as Stage
    from cylx.results.result import result_schema as result_schema

_HOMES = {
    "CatalogueMatch": "cylx.results.cylinders",
    "Measured": "cylx.results.cylinders",
    "Numbered": "cylx.results.cylinders",
    "RejectedCylinder": "cylx.results.rejected",
    "Rejections": "cylx.results.rejected",
    "Result": "cylx.results.result",
    "ResultBlend": "cylx.results.cylinders",
    "ResultCylinder": "cylx.results.cylinders",
    "ResultFitting": "cylx.results.fittings",
    "ResultRun": "cylx.results.fittings",
    "SceneScale": "cylx.results.result",
    "Stage": "cylx.results.result",
    "Uncertainty": "cylx.results.cylinders",
    "rejections_schema": "cylx.results.rejected",
    "result_schema": "cylx.results.result",
}

__all__ = sorted(_HOMES)  # noqa: PLE0605  (the names are those above)


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module 'cylx.results' has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return __all__
