"""The value of every `null` in a configuration, from the scale of the cloud, in scene units."""

from __future__ import annotations

import math

from cylx.config import Config
from cylx.records import Scene


def resolve(config: Config, scene: Scene) -> Config:
    """Replace every `null` that means "from the cloud" by its value, in scene units.

    Parameters
    ----------
    config : Config
    scene : Scene

    Returns
    -------
    Config
    """
    least, greatest, radius = config.scene.radius_min, config.scene.radius_max, config.scene.known_radius
    catalogue = config.scene.catalogue
    thickness = config.slicing.thickness or 2.0 * max(scene.spacing, 2.0 * scene.noise)
    known = {
        "scene": {
            "spacing": scene.spacing,
            "noise": scene.noise,
            "radius_min": least or min(thinnest(scene)[0], greatest or math.inf),
            "radius_max": greatest or max(0.5 * scene.extent, least or 0.0),
            "known_radius_sd": config.scene.known_radius_sd or (radius and 1e-3 * radius),
            "catalogue": catalogue and [entry.model_copy(update={"tolerance": entry.spread}) for entry in catalogue],
        },
        "slicing": {"thickness": thickness},
        "ellipses": {"tolerance": config.ellipses.tolerance or 4.0 * scene.noise + 0.06 * thickness},
        "msac": {"distance": config.msac.distance or 3.0 * scene.noise},
        "tran": {"distance": config.tran.distance or 3.0 * scene.noise},
        "jin": {"distance": config.jin.distance or 3.0 * scene.noise},
    }
    return config.model_copy(
        update={name: getattr(config, name).model_copy(update=values) for name, values in known.items()}
    )


def thinnest(scene: Scene) -> tuple[float, float]:
    """Return the least radius searched for, and the radius from which a free-standing cylinder is usually found.

    Parameters
    ----------
    scene : Scene

    Returns
    -------
    looked_for, found : float
        Scene units.
    """
    return max(3.0 * scene.noise, 0.25 * scene.spacing), max(6.0 * scene.noise, 0.5 * scene.spacing)
