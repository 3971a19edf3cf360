"""The method on one screen: slices, ellipses, candidates, clustering, averaging; then what makes it trustworthy."""

from __future__ import annotations

from typing import NamedTuple

from cylx.config import Config
from cylx.pipeline.assembly import assemble
from cylx.pipeline.candidates import (
    candidates_of_patches,
    candidates_of_slices,
    candidates_of_windows,
    cut_slices,
    ellipses_of_slices,
    select_candidates,
    windows_and_explained,
)
from cylx.pipeline.rounds import Rounds
from cylx.pipeline.stage_log import StageLog
from cylx.pipeline.viewed import with_sides
from cylx.records import (
    Candidates,
    Extraction,
    Finding,
    IndexedCloud,
    Observer,
    PointCloud,
    RejectedSegment,
    SilentObserver,
)
from cylx.scene import Prepared, prepare
from cylx.stages.clustering import CandidateGame

__all__ = ["Search", "extract_cylinders", "search_cylinders"]


class Search(NamedTuple):
    """What was found in a cloud, in its frame, before the points are labelled.

    Parameters
    ----------
    indexed : IndexedCloud
        The cloud, and what its points lie on.
    windows : Candidates
        What a cylinder should agree with.
    findings : list of Finding
        The cylinders, the most trusted first.
    blends : list of Finding
        The arcs that go on tangentially, the most trusted first.
    rejected : list of RejectedSegment
        What was not accepted, in the order it came.
    """

    indexed: IndexedCloud
    windows: Candidates
    findings: list[Finding]
    blends: list[Finding]
    rejected: list[RejectedSegment]


def extract_cylinders(
    cloud: PointCloud, config: Config, *, threads: int | None = None, observer: Observer | None = None
) -> Extraction:
    """Find the cylinders of a cloud.

    Parameters
    ----------
    cloud : PointCloud
    config : Config
        `null` values are read off the cloud.
    threads : int, optional
        Does not change the result; all cores by default.
    observer : Observer, optional
        Is told of stages and their times.

    Returns
    -------
    Extraction

    Raises
    ------
    InputError
        If no cylinder could be told from anything else in the cloud (see `cylx.scene.check_usable`).
    ConfigError
        If the method needs open3d, and it cannot be imported.
    """
    log = StageLog(observer or SilentObserver())
    with log.stage("scene"):
        prepared = prepare(cloud, config, threads)
    if config.method != "gt":
        from cylx.pipeline.competitors import extract_by_competitor  # noqa: PLC0415  brings scipy.spatial: 0.3 s

        return extract_by_competitor(prepared, log)
    found = search_cylinders(prepared, log)
    with log.stage("labelling"):
        return with_sides(assemble(prepared, found.indexed, found.findings, found.rejected, log.reports, found.blends))


def search_cylinders(prepared: Prepared, log: StageLog) -> Search:
    """Search a prepared cloud by the clustering game.

    Parameters
    ----------
    prepared : Prepared
    log : StageLog
        Is told of stages, their times and counts.

    Returns
    -------
    Search
    """
    with log.stage("curvature"):
        windows, explained = windows_and_explained(prepared, log)
    with log.stage("patches"):
        patches, rims, normals, planes = candidates_of_patches(prepared, explained, log)
        indexed = IndexedCloud.of(prepared.frame, explained.flatness, normals, planes)
    with log.stage("slicing"):
        slices = cut_slices(prepared, explained.flatness, log)
    with log.stage("ellipses"):
        ellipses = ellipses_of_slices(prepared, slices, log)
    with log.stage("candidates"):
        of_slices = candidates_of_slices(prepared, ellipses, log)
        local = candidates_of_windows(prepared, explained, log)
        found = Candidates.joined([windows, patches, rims, of_slices, local])
        all_windows = Candidates.joined([windows, patches, local]) if len(windows) or len(patches) else found
        candidates = select_candidates(prepared, found, log)
    with log.stage("clustering"):
        game = CandidateGame(candidates, prepared.config.clustering, prepared.threads)
    rounds = Rounds(prepared, indexed, game, all_windows)
    for clusters in rounds.clusters(log):
        with log.stage("averaging"):
            segments = rounds.fit(clusters)
        with log.stage("verification"):
            rounds.verify(segments, log)
    with log.stage("verification"):
        rounds.look_about_axes(log)
    rounds.report(log)
    with log.stage("merging"):
        findings = rounds.merge(log)
        blends = rounds.merge_blends(findings, log)
    return Search(indexed, all_windows, findings, blends, rounds.rejected)
