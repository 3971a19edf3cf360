"""The method on one screen: slices, ellipses, candidates, clustering, averaging; then what makes it trustworthy."""

from __future__ import annotations

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
from cylx.records import Candidates, Extraction, IndexedCloud, Observer, PointCloud, SilentObserver
from cylx.scene import prepare
from cylx.stages.clustering import CandidateGame

__all__ = ["extract_cylinders"]


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
    with log.stage("curvature"):
        windows, explained = windows_and_explained(prepared, log)
    with log.stage("patches"):
        patches, rims, normals = candidates_of_patches(prepared, explained, log)
        indexed = IndexedCloud.of(prepared.frame, explained.flatness, normals)
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
    rounds.report(log)
    with log.stage("merging"):
        findings = rounds.merge(log)
        blends = rounds.merge_blends(findings, log)
    with log.stage("labelling"):
        return assemble(prepared, indexed, findings, rounds.rejected, log.reports, blends)
