"""What every method starts from: a cloud in its frame, and what the configuration means for it."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace

from cylx.config import Config
from cylx.fits.likelihood import Prior
from cylx.fits.nominal_radius import Catalogue
from cylx.records import Frame, PointCloud, Scene
from cylx.scene.frame import check_usable, make_frame
from cylx.scene.priors import catalogue_of, known_of, radius_range
from cylx.scene.resolve import resolve


@dataclass(frozen=True, slots=True, eq=False)
class Prepared:
    """A cloud, measured and put into its frame.

    Parameters
    ----------
    cloud : PointCloud
    frame : Frame
        Its points in units of their spacing.
    scene : Scene
        What was measured or given, scene units.
    config : Config
        Resolved: no `null` means "from the cloud" any more.
    radii : tuple of float
        Least and greatest radius, frame units.
    known : Prior or None
        What is known of each cylinder, frame units.
    catalogue : Catalogue or None
        Nominal radii, frame units.
    threads : int
        Does not change the result.
    """

    cloud: PointCloud
    frame: Frame
    scene: Scene
    config: Config
    radii: tuple[float, float]
    known: Prior | None
    catalogue: Catalogue | None
    threads: int


def prepare(cloud: PointCloud, config: Config, threads: int | None = None) -> Prepared:
    """Measure a cloud, put it into its frame and resolve the configuration.

    Parameters
    ----------
    cloud : PointCloud
    config : Config
        `null` values are read off the cloud.
    threads : int, optional
        One a core by default.

    Returns
    -------
    Prepared

    Raises
    ------
    InputError
        If no cylinder could be told from anything else in the cloud (see `check_usable`).
    """
    check_usable(cloud.points, cloud.source.file)
    threads = threads or os.cpu_count() or 1
    frame, scene = make_frame(cloud.points, config, threads)
    scene = replace(scene, given=config.scene.given)
    config = resolve(config, scene)
    radii = radius_range(config, frame)
    return Prepared(cloud, frame, scene, config, radii, known_of(config, frame), catalogue_of(config, frame), threads)
