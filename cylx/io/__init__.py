"""Reading and writing files: the only package that knows paths, formats, and the libraries for them.

Names are imported on first use, so that writing a text does not import numpy.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from cylx.io.annotated import write_annotated as write_annotated
    from cylx.io.annotated import write_annotated_stream as write_annotated_stream
    from cylx.io.annotated import write_trees as write_trees
    from cylx.io.annotated_checks import check_annotated as check_annotated
    from cylx.io.annotated_checks import las_obstacle as las_obstacle
    from cylx.io.clouds import cloud_suffixes as cloud_suffixes
    from cylx.io.clouds import read_cloud as read_cloud
    from cylx.io.clouds import recorded_name as recorded_name
    from cylx.io.clouds import write_cloud as write_cloud
    from cylx.io.formats import LAS_SUFFIXES as LAS_SUFFIXES
    from cylx.io.formats import cloud_name as cloud_name
    from cylx.io.formats import cloud_suffix as cloud_suffix
    from cylx.io.glance import Glance as Glance
    from cylx.io.glance import glance_at as glance_at
    from cylx.io.inputs import printable as printable
    from cylx.io.inputs import read_json as read_json
    from cylx.io.inputs import sha256_of as sha256_of
    from cylx.io.meshes import read_object as read_object
    from cylx.io.outputs import check_writable as check_writable
    from cylx.io.outputs import write_bytes as write_bytes
    from cylx.io.outputs import write_text as write_text
    from cylx.io.scratch import Scratch as Scratch
    from cylx.io.scratch import open_scratch as open_scratch
    from cylx.io.sizes import expected_points as expected_points
    from cylx.io.staging import remove_leftovers as remove_leftovers
    from cylx.io.staging import temporary_beside as temporary_beside
    from cylx.io.streamed import stream_arrays as stream_arrays
    from cylx.io.streamed import stream_cloud as stream_cloud
    from cylx.io.streamed_cloud import StreamedCloud as StreamedCloud

_HOMES = {
    "Glance": "cylx.io.glance",
    "LAS_SUFFIXES": "cylx.io.formats",
    "Scratch": "cylx.io.scratch",
    "StreamedCloud": "cylx.io.streamed_cloud",
    "check_annotated": "cylx.io.annotated_checks",
    "check_writable": "cylx.io.outputs",
    "cloud_name": "cylx.io.formats",
    "cloud_suffix": "cylx.io.formats",
    "cloud_suffixes": "cylx.io.clouds",
    "expected_points": "cylx.io.sizes",
    "glance_at": "cylx.io.glance",
    "las_obstacle": "cylx.io.annotated_checks",
    "open_scratch": "cylx.io.scratch",
    "printable": "cylx.io.inputs",
    "read_cloud": "cylx.io.clouds",
    "read_json": "cylx.io.inputs",
    "read_object": "cylx.io.meshes",
    "recorded_name": "cylx.io.clouds",
    "remove_leftovers": "cylx.io.staging",
    "sha256_of": "cylx.io.inputs",
    "stream_arrays": "cylx.io.streamed",
    "stream_cloud": "cylx.io.streamed",
    "temporary_beside": "cylx.io.staging",
    "write_annotated": "cylx.io.annotated",
    "write_annotated_stream": "cylx.io.annotated",
    "write_bytes": "cylx.io.outputs",
    "write_cloud": "cylx.io.clouds",
    "write_trees": "cylx.io.annotated",
    "write_text": "cylx.io.outputs",
}

__all__ = sorted(_HOMES)  # noqa: PLE0605  (the names are those above)


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module 'cylx.io' has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return __all__
