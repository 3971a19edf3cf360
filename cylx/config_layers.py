"""The layers a configuration is put together from: presets, files and overrides, as plain nested values."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path
from typing import Any, NamedTuple

from cylx.errors import ConfigError
from cylx.strict_yaml import parse_yaml

_MOST_BYTES = 100_000


class Layer(NamedTuple):
    """Values that were given in one place.

    Parameters
    ----------
    prefix : str
        How an error names the place, in front of the dotted path.
    values : dict
        Nested as in the file.
    """

    prefix: str
    values: dict[str, Any]


def preset_layer(name: str) -> Layer:
    """Read a preset from the file that comes with the package."""
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
    """Insist on keys at the top level; an empty document has none."""
    if values is None:
        return {}
    if not isinstance(values, dict):
        raise ConfigError(place, "has no keys at its top level", "write 'section:' and its keys below it")
    return values


def override_layer(text: str) -> Layer:
    """Read one `section.key=value`."""
    key, equals, value = text.partition("=")
    if not equals or not key.strip():
        raise ConfigError(f"--set {text}", "has no key and value", "write --set section.key=value")
    return Layer("--set ", nested(key.strip(), parse_yaml(value, f"--set {key.strip()}")))


def nested(key: str, value: object) -> dict[str, Any]:
    """Turn a dotted key and its value into nested dicts."""
    head, _, rest = key.partition(".")
    return {head: nested(rest, value) if rest else value}


def merge(below: dict[str, Any], above: dict[str, Any]) -> dict[str, Any]:
    """Lay one set of values over another, section by section."""
    merged = dict(below)
    for key, value in above.items():
        both = isinstance(value, dict) and isinstance(merged.get(key), dict)
        merged[key] = merge(merged[key], value) if both else value
    return merged
