"""The data passed between the stages: shapes with their evidence, and counts of rejections.

Large numbers of one kind are a structure of arrays (`Candidates`); the few resulting cylinders are single objects. All
records are frozen: a stage makes new ones and never changes its inputs.
"""

from cylx.records.candidates import Candidates, Cluster, EllipseFit, Slice
from cylx.records.clouds import Frame, Ground, Noise, PointCloud, Scene, cell_keys
from cylx.records.cylinders import CylinderFit, Extraction, Finding, NominalRadius, Refusal, Rejection, Segment
from cylx.records.progress import Observer, SilentObserver, StageReport
from cylx.records.scales import CELL, Explained, Octave
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
    "Ground",
    "Noise",
    "NominalRadius",
    "Observer",
    "Octave",
    "PointCloud",
    "Refusal",
    "Rejection",
    "Scene",
    "Segment",
    "Selection",
    "SilentObserver",
    "Slice",
    "Source",
    "StageReport",
    "cell_keys",
]
