"""The data passed between the stages: shapes with their evidence, and counts of rejections.

Large numbers of one kind are a structure of arrays (`Candidates`); the few resulting cylinders are single objects. All
records are frozen: a stage makes new ones and never changes its inputs.
"""

from __future__ import annotations

import warnings

from cylx.records.candidates import Candidates, Cluster, EllipseFit, Slice
from cylx.records.clouds import PointCloud, Scene
from cylx.records.cylinders import CylinderFit, Extraction, NominalRadius, RejectedFit
from cylx.records.fittings import (
    Cap,
    Cross,
    Elbow,
    Fitting,
    Flange,
    Inline,
    Joint,
    Junction,
    Reducer,
)
from cylx.records.frames import Frame, IndexedCloud, Noise, cell_keys
from cylx.records.piping import Adjustment, OpenEnd, PipeRun, PipeSize, Piping
from cylx.records.progress import Observer, SilentObserver, StageReport
from cylx.records.scales import CELL, Explained, Nearby, Scale
from cylx.records.segments import Finding, RejectedSegment, Segment
from cylx.records.sources import Crop, Selection, Source
from cylx.records.streams import stream
from cylx.records.tiled import TiledExtraction, Tiling

__all__ = [
    "CELL",
    "Adjustment",
    "Candidates",
    "Cap",
    "Cluster",
    "Crop",
    "Cross",
    "CylinderFit",
    "Elbow",
    "EllipseFit",
    "Explained",
    "Extraction",
    "Finding",
    "Fitting",
    "Flange",
    "Frame",
    "IndexedCloud",
    "Inline",
    "Joint",
    "Junction",
    "Nearby",
    "Noise",
    "NominalRadius",
    "Observer",
    "OpenEnd",
    "PipeRun",
    "PipeSize",
    "Piping",
    "PointCloud",
    "Reducer",
    "RejectedFit",
    "RejectedSegment",
    "Scale",
    "Scene",
    "Segment",
    "Selection",
    "SilentObserver",
    "Slice",
    "Source",
    "StageReport",
    "TiledExtraction",
    "Tiling",
    "cell_keys",
    "stream",
]


def __getattr__(name: str) -> object:
    if name != "Rejection":
        raise AttributeError(f"module 'cylx.records' has no attribute {name!r}")
    warnings.warn(
        "cylx.records.Rejection is RejectedFit now; it goes with the next release", DeprecationWarning, stacklevel=2
    )
    return RejectedFit
