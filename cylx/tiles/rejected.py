"""What the tiles have not accepted, if somebody wants to see it: each is told by the tile that its middle lies in."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from cylx.geometry.arrays import FloatArray
from cylx.geometry.cylinder import Cylinder
from cylx.io.scratch import Scratch
from cylx.pipeline import Search
from cylx.pipeline.assembly import by_trust, rejected_fits
from cylx.records import CylinderFit, RejectedFit
from cylx.scene import Prepared


def rejected_name(tile: int) -> str:
    """Return the name of what a tile has not accepted in the scratch folder."""
    return f"rejected-{tile}.json"


def keep_rejected(scratch: Scratch, tile: int, box: FloatArray, prepared: Prepared, found: Search) -> None:
    """Write down what was not accepted in a tile, but for what lies in its margin.

    Parameters
    ----------
    scratch : Scratch
    tile : int
    box : ndarray of shape (2, 3)
        Of the tile, scene units.
    prepared : Prepared
        The tile and its margin.
    found : Search
        What was found there.
    """
    kept = []
    for one in rejected_fits(found.rejected, prepared, found.indexed):
        point = one.fit.cylinder.point
        if ((point >= box[0]) & (point < box[1])).all():
            kept.append(_plain(one))
    scratch.write_json(rejected_name(tile), kept)


def rejected_in(scratch: Scratch, tiles: int) -> tuple[RejectedFit, ...]:
    """Return what no tile has accepted, by confidence, then inliers; those not measured come last."""
    out: list[RejectedFit] = []
    for tile in range(tiles):
        if scratch.has(rejected_name(tile)):  # else it was not searched
            out += [_of_plain(one) for one in scratch.read_json(rejected_name(tile))]
    return tuple(sorted(out, key=by_trust))


def _plain(one: RejectedFit) -> dict[str, Any]:
    fit, shape = one.fit, one.fit.cylinder
    return {
        "reason": one.reason,
        "cylinder": [shape.point.tolist(), shape.direction.tolist(), shape.radius, shape.height],
        "inliers": int(fit.inliers),
        "rmse": fit.rmse,
        "coverage": float(fit.coverage),
        "support": int(fit.support),
        "payoff": None if fit.payoff is None else float(fit.payoff),
        "confidence": None if fit.confidence is None else float(fit.confidence),
        "evidence": {name: float(value) for name, value in fit.evidence.items()},
        "form": None if fit.form is None else float(fit.form),
    }


def _of_plain(content: Mapping[str, Any]) -> RejectedFit:
    rest = {name: value for name, value in content.items() if name not in ("reason", "cylinder")}
    return RejectedFit(CylinderFit(Cylinder(*content["cylinder"]), **rest), content["reason"])
