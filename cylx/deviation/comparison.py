"""A scan compared with a design: what was measured of each cylinder, and its verdicts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cylx.deviation.document import DesignFile, Deviations
from cylx.deviation.entries import DeviationEntry
from cylx.deviation.measure import Deviation, measure_deviations, shapes_of
from cylx.deviation.verdict import Check, Tolerances, Verdict, check_deviation, overall
from cylx.geometry.arrays import FloatArray
from cylx.records import PointCloud
from cylx.records.designs import Design
from cylx.results.parts import Input
from cylx.wording import counted


@dataclass(frozen=True, slots=True, eq=False)
class Comparison:
    """A scan compared with the cylinders of a design.

    Parameters
    ----------
    cloud : PointCloud
        The scan.
    design : Design
    file : str
        Name of the file of the design, without its folder; empty if it was none.
    scale : float
        What the lengths of the design were multiplied by, to be in the unit of the scan.
    tolerances : Tolerances
    deviations : tuple of Deviation
        One for each cylinder of the design, in its order.
    labels : ndarray of shape (N,), int32
        Number of the design cylinder of each point; -1 for none.
    residuals : ndarray of shape (N,)
        Distance of each point from the cylinder that was found, + is outside, scene units; NaN for none.
    """

    cloud: PointCloud
    design: Design
    file: str
    scale: float
    tolerances: Tolerances
    deviations: tuple[Deviation, ...]
    labels: NDArray[np.int32]
    residuals: FloatArray

    def __repr__(self) -> str:
        return f"Comparison({counted(len(self.deviations))}, {self.verdict})"

    @property
    def checks(self) -> tuple[tuple[Check, ...], ...]:
        """The checks of each cylinder: whether it is there, and a value for each tolerance."""
        return tuple(tuple(check_deviation(one, self.tolerances)) for one in self.deviations)

    @property
    def verdict(self) -> Verdict:
        """The worst verdict of all checks: `fail`, `undecided` or `pass`."""
        return overall([check for checks in self.checks for check in checks])

    def to_document(self) -> Deviations:
        """Return the content of the JSON that `cylx deviation` writes; its `to_object()` is the JSON object."""
        entries = [
            DeviationEntry.of(k, self.design.cylinders[k].name, one, checks)
            for k, (one, checks) in enumerate(zip(self.deviations, self.checks, strict=True))
        ]
        about = DesignFile.model_validate({"file": self.file, "format": self.design.format, "scale": self.scale})
        return Deviations.of(Input.of_cloud(self.cloud), about, self.tolerances, entries)


def compare_with_design(
    cloud: PointCloud,
    design: Design,
    tolerances: Tolerances,
    *,
    file: str = "",
    scale: float = 1.0,
    within: float | None = None,
    cell: float | None = None,
) -> Comparison:
    """Measure the cylinders of a design in a scan that is in its coordinates.

    Parameters
    ----------
    cloud : PointCloud
    design : Design
    tolerances : Tolerances
        Dents and bulges of less than half of what is allowed are left out.
    file : str
        Name of the file of the design.
    scale : float
        What the lengths of the design are multiplied by, to be in the unit of the scan.
    within, cell : float, optional
        As for `measure_deviations`.

    Returns
    -------
    Comparison
    """
    least = 0.0 if tolerances.dent is None else 0.5 * tolerances.dent
    found, labels, residuals = measure_deviations(
        cloud.points, shapes_of(design, scale), within=within, cell=cell, least_depth=least
    )
    return Comparison(cloud, design, file, scale, tolerances, tuple(found), labels, residuals)
