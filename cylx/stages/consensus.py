"""Clusters -> clusters of one surface: walls about one axis that lie close together give candidates that agree.

Candidates of noisy windows differ by a tenth of the radius, and so the game takes two walls whose radii differ by less
for one. The windows themselves were laid on one of them. Two discs far apart on one axis agree as well; of these the
windows lie in two places with nothing between.
"""

from __future__ import annotations

import numpy as np

from cylx.geometry.arrays import IndexArray
from cylx.geometry.cylinder import are_on
from cylx.records import Candidates, Cluster, IndexedCloud, Segment

WIDTH_NOISES, WIDTH_RADII = 5.0, 0.01
"""A window within so many noises or radii of a cylinder, whichever is more, was laid on it."""
MOST_TRIED = 12
"""Candidates of most weight that are tried as the surface."""
ENOUGH = 0.5
"""An average that passes through this share of the windows is that of one surface."""
LEAST_GAIN = 2.0
"""A candidate takes its place if so many times more windows were laid on it."""
WIDER, MOST_BESIDE = 3.0, 0.2
"""The windows of two walls lie on one or the other; those of a rough surface lie up to so many times further off, too,
and then they are more than this share."""
FAR_APART, FAR_RADII = 6.0, 1.0
"""Groups of candidates further apart, in their extents and in radii, are of two places, if each is"""
SHORT_GROUP = 0.3
"""no longer than this share of the gap."""
LEAST_WINDOWS = 3
"""Windows that make a surface."""


def of_one_surface(
    candidates: Candidates, cluster: Cluster, average: Segment, indexed: IndexedCloud
) -> tuple[Cluster, IndexArray] | None:
    """Split a cluster whose average lies between two surfaces.

    Parameters
    ----------
    candidates : Candidates
    cluster : Cluster
    average : Segment
        Of the cluster.
    indexed : IndexedCloud

    Returns
    -------
    one : Cluster
        The members of the surface on which most windows were laid.
    others : ndarray of int
        The members that belong to other surfaces; None instead of both if the average is that of one.
    """
    places = candidates.places[cluster.members]
    known = ~np.isnan(places[:, 0])
    if known.sum() < 2 * LEAST_WINDOWS:
        return None
    width = max(WIDTH_NOISES * indexed.noise_about(average.model, average.half), WIDTH_RADII * average.radius)
    on = known & are_on(places, average.model, width)
    if on.sum() >= ENOUGH * known.sum():
        return None
    best, most = on, LEAST_GAIN * float(on.sum())
    for i in cluster.members[np.argsort(-cluster.weights, kind="stable")[:MOST_TRIED]]:
        own = known & are_on(places, candidates.models[i], width)
        beside = known & are_on(places, candidates.models[i], WIDER * width) & ~own
        if own.sum() > most and beside.sum() <= MOST_BESIDE * own.sum():
            best, most = own, float(own.sum())
    if best is on or best.sum() < LEAST_WINDOWS:
        return None
    weights = cluster.weights[best]
    return Cluster(cluster.members[best], weights / weights.sum(), cluster.payoff), cluster.members[known & ~best]


def of_one_place(candidates: Candidates, cluster: Cluster, average: Segment) -> tuple[Cluster, IndexArray] | None:
    """Split a cluster whose candidates lie in two places of one axis that are far apart, compared with what each spans.

    A pipe that is seen in few places grows from one of them to the others; two discs on one axis do not.

    Parameters
    ----------
    candidates : Candidates
    cluster : Cluster
    average : Segment
        Of the cluster.

    Returns
    -------
    one : Cluster
        The members of the place where most are.
    others : ndarray of int
        The members elsewhere; None instead of both if they lie in one place.
    """
    members = cluster.members
    if len(members) < 2 * LEAST_WINDOWS:
        return None
    heights = (candidates.points[members] - average.point) @ average.direction
    order = np.argsort(heights, kind="stable")
    along = heights[order]
    gaps = np.diff(along)
    extent = float(np.median(candidates.extents[members]))
    bounds = np.flatnonzero(gaps > max(FAR_APART * extent, FAR_RADII * average.radius)) + 1
    if len(bounds) == 0:
        return None
    groups = np.split(order, bounds)
    spans = [float(np.ptp(heights[group])) + extent for group in groups]
    if max(spans) > SHORT_GROUP * float(gaps[bounds - 1].min()):
        return None
    most = max(groups, key=len)
    if len(most) < LEAST_WINDOWS:
        return None
    own = np.zeros(len(members), np.bool_)
    own[most] = True
    weights = cluster.weights[own]
    return Cluster(members[own], weights / weights.sum(), cluster.payoff), members[~own]
