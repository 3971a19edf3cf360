"""What travels between the stages: shapes with their evidence, and the counts of what was dropped on the way.

Many things of one kind travel as a structure of arrays (`Candidates`); the few cylinders that come out travel one by
one. All records are frozen: a stage makes new ones and never changes those it was given.
"""

from cylx.records.candidates import Candidates, Cluster, EllipseFit, Slice
from cylx.records.clouds import Frame, IndexedCloud, Noise, PointCloud, Scene, cell_keys
from cylx.records.cylinders import (
    CylinderFit,
    Extraction,
    Finding,
    NominalRadius,
    RejectedCylinder,
    RejectedSegment,
    Segment,
)
from cylx.records.progress import Observer, SilentObserver, StageReport
from cylx.records.scales import CELL, Explained, Scale
from cylx.records.sources import Crop, Selection, Source

__all__ = [
    "CELL",
    "Candidates",
    "Cluster",
    "Crop",
    "CylinderFit",
    "EllipseFit",
    "Explained",
    "Extraction",
    "Finding",
    "Frame",
    "IndexedCloud",
    "Noise",
    "NominalRadius",
    "Observer",
    "PointCloud",
    "RejectedCylinder",
    "RejectedSegment",
    "Scale",
    "Scene",
    "Segment",
    "Selection",
    "SilentObserver",
    "Slice",
    "Source",
    "StageReport",
    "cell_keys",
]
