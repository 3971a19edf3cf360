"""The method on one screen: slice, ellipses, candidates, clustering, averaging; then what makes it trustworthy."""

from __future__ import annotations

import os
from dataclasses import replace

from cylx.config import Config
from cylx.geometry.cells import Cells
from cylx.pipeline.assembly import assemble
from cylx.pipeline.candidates import (
    candidates_along_axis,
    candidates_of_slices,
    candidates_of_windows,
    ellipses_of_slices,
    windows_and_explained,
)
from cylx.pipeline.rounds import Rounds
from cylx.pipeline.stage_log import StageLog
from cylx.pipeline.warmup import kernels_are_cold, practice_cloud, second_process
from cylx.records import Candidates, Extraction, IndexedCloud, Observer, PointCloud, SilentObserver
from cylx.scene import catalogue_of, check_usable, known_of, make_frame, radius_range, resolve
from cylx.stages.clustering import CandidateGame, thin_candidates

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
    check_usable(cloud.points, cloud.source.file)
    threads = threads or os.cpu_count() or 1
    log = StageLog(observer or SilentObserver())
    if kernels_are_cold():
        with log.stage("compiling"), second_process():
            extract_cylinders(PointCloud(practice_cloud()), Config(), threads=1)
    if config.method != "gt":
        from cylx.pipeline.competitors import extract_by_competitor  # noqa: PLC0415  brings scipy.spatial: 0.3 s

        return extract_by_competitor(cloud, config, threads, log)
    with log.stage("scene"):
        frame, scene = make_frame(cloud.points, config, threads)
        scene = replace(scene, given=config.scene.given)
        config = resolve(config, scene)
        radii = radius_range(config, frame)
    with log.stage("curvature"):
        windows, explained = windows_and_explained(frame, radii, config, threads, log)
        indexed = IndexedCloud(Cells(frame.points, frame.codes), explained.flatness, frame.noise)
    with log.stage("slicing"):
        fits = ellipses_of_slices(frame, explained.flatness, radii, config, threads, log)
    with log.stage("candidates"):
        whole = candidates_of_slices(fits, frame, radii, config, log)
        local = candidates_of_windows(frame, explained, radii, config, threads, log)
        candidates = Candidates.joined([windows, whole, local])
    with log.stage("clustering"):
        candidates = candidates_along_axis(candidates, config, log)
        candidates = thin_candidates(candidates) if config.clustering.population == "local" else candidates
        all_windows = Candidates.joined([windows, local]) if len(windows) else candidates
        game = CandidateGame(candidates, config.clustering, threads)
        known, catalogue = known_of(config, frame), catalogue_of(config, frame)
        rounds = Rounds(game, candidates, all_windows, indexed, radii, known, catalogue, config, threads)
    with log.stage("averaging"):
        findings = rounds.play(log)
    with log.stage("merging"):
        findings = rounds.merge(findings, log)
    with log.stage("labelling"):
        return assemble(cloud, frame, scene, indexed, findings, rounds.refused, log.reports, config)
