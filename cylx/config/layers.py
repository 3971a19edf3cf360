"""The layers of a configuration: presets, files, overrides and options, as plain nested values."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.resources import files
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

from cylx.config.catalogue_file import Given, entries_of
from cylx.config.yaml_reader import parse_yaml
from cylx.errors import ConfigError

_MOST_BYTES = 100_000
_AXES = {"x": [1.0, 0.0, 0.0], "y": [0.0, 1.0, 0.0], "z": [0.0, 0.0, 1.0]}


class Layer(NamedTuple):
    """Values given in one place.

    Parameters
    ----------
    prefix : str
        Name of the place in errors, in front of the dotted path.
    values : dict
        Nested as in the file.
    """

    prefix: str
    values: dict[str, Any]


def preset_layer(name: str) -> Layer:
    """Read a preset from its file in the package."""
    text = (files("cylx") / "presets" / f"{name}.yaml").read_text(encoding="utf-8")
    return Layer(f"preset {name}: ", _mapping(parse_yaml(text, f"preset {name}"), f"preset {name}"))


def file_layer(path: str | Path) -> Layer:
    """Read a user's file."""
    try:
        with Path(path).open("rb") as file:
            content = file.read(_MOST_BYTES + 1)
        text = content.decode("utf-8-sig")
    except FileNotFoundError:
        raise ConfigError(str(path), "no such file", "'cylx config init' writes one") from None
    except UnicodeDecodeError:
        raise ConfigError(str(path), "is not UTF-8 text", "give a YAML file") from None
    except (OSError, ValueError) as error:
        fault = getattr(error, "strerror", None) or str(error)
        raise ConfigError(str(path), f"cannot be read: {fault}", "give a readable YAML file") from None
    if len(content) > _MOST_BYTES:
        raise ConfigError(str(path), "is larger than 100 kB", "give a YAML file")
    return Layer(f"{path}: ", _mapping(parse_yaml(text, str(path)), str(path)))


def _mapping(values: object, place: str) -> dict[str, Any]:
    """Check that the top level is a mapping; an empty document is an empty mapping."""
    if values is None:
        return {}
    if not isinstance(values, dict):
        raise ConfigError(place, "has no keys at its top level", "write 'section:' and its keys below it")
    return values


def override_layer(text: str) -> Layer:
    """Parse one `section.key=value`."""
    key, equals, value = text.partition("=")
    if not equals or not key.strip():
        raise ConfigError(f"--set {text}", "has no key and value", "write --set section.key=value")
    return Layer("--set ", nested(key.strip(), parse_yaml(value, f"--set {key.strip()}")))


def named_options(
    *,
    method: str | None = None,
    seed: int | None = None,
    radius: tuple[float | None, float | None] | None = None,
    max_cylinders: int | None = None,
    planes: int | None = None,
    axis: Sequence[float] | str | None = None,
    axis_tolerance_deg: float | None = None,
    axis_sd_deg: float | None = None,
    known_radius: tuple[float, float | None] | None = None,
    catalogue: Given | str | PathLike[str] | None = None,
    min_coverage_deg: float | None = None,
    blends: bool | None = None,
) -> dict[str, object]:
    """Return the dotted keys for the named options of the command line and of `cylx.extract`.

    Parameters
    ----------
    method : str, optional
        As in the configuration.
    seed, max_cylinders, planes : int, optional
        As in the configuration.
    radius : pair of float or None, optional
        Smallest and largest radius, scene units; None keeps that limit of the configuration.
    axis : sequence of float or str, optional
        Direction of the cylinders, three numbers, or `x`, `y` or `z`.
    axis_tolerance_deg : float, optional
        Largest angle of a cylinder to the axis, degrees.
    axis_sd_deg : float, optional
        Standard deviation of the cylinders' tilts from the axis, degrees.
    known_radius : pair of float, optional
        Known radius of the cylinders, and its standard deviation or None, scene units.
    catalogue : str, path-like, or sequence, optional
        Nominal radii: a file, entries as in the configuration, or just radii, scene units.
    min_coverage_deg : float, optional
        Smallest angle about the axis that must be covered, degrees.
    blends : bool, optional
        Whether arcs that go on tangentially are looked for.

    Returns
    -------
    dict
        The options that were given, for `load_config`.

    Raises
    ------
    ConfigError
        If the file of the catalogue cannot be read.
    """
    smallest, largest = radius or (None, None)
    known, known_sd = known_radius or (None, None)
    values = {
        "method": method,
        "seed": seed,
        "max_cylinders": max_cylinders,
        "slicing.planes": planes,
        "scene.radius_min": smallest,
        "scene.radius_max": largest,
        "scene.axis": None if axis is None else _axis(axis),
        "scene.axis_tolerance_deg": axis_tolerance_deg,
        "scene.axis_sd_deg": axis_sd_deg,
        "scene.known_radius": known,
        "scene.known_radius_sd": known_sd,
        "scene.catalogue": None if catalogue is None else entries_of(catalogue),
        "verification.min_coverage_deg": min_coverage_deg,
        "verification.blends": blends,
    }
    return {key: value for key, value in values.items() if value is not None}


NAMED_OPTIONS = tuple(named_options.__kwdefaults__ or ())
"""Their names; the command line passes on what was given by these."""


def _axis(axis: Sequence[float] | str) -> object:
    """Return a direction in the form of the file; the validation reports any other value."""
    if isinstance(axis, str):
        return _AXES.get(axis, axis)
    return [x.item() if hasattr(x, "item") else x for x in axis]  # Python numbers instead of numpy's


def nested(key: str, value: object) -> dict[str, Any]:
    """Turn a dotted key and its value into nested dicts."""
    head, _, rest = key.partition(".")
    return {head: nested(rest, value) if rest else value}


def merge(below: dict[str, Any], above: dict[str, Any]) -> dict[str, Any]:
    """Override one set of values by another, section by section."""
    merged = dict(below)
    for key, value in above.items():
        both = isinstance(value, dict) and isinstance(merged.get(key), dict)
        merged[key] = merge(merged[key], value) if both else value
    return merged
