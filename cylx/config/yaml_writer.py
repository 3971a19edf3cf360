"""The configuration as commented YAML: every key with its value, its meaning and its allowed values."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from textwrap import wrap
from typing import Any

import yaml

from cylx.config.config import Config

_Object = Mapping[str, Any]

_WIDTH = 100
_BOUNDS = {"exclusiveMinimum": ">", "minimum": ">=", "exclusiveMaximum": "<", "maximum": "<="}
_HEADER = """\
# Configuration of cylx. Lengths are in the unit of the scan; null means "from the cloud".
# Leave out what you do not want to change: missing keys keep the value of the preset.

"""


def commented_yaml(config: Config) -> str:
    """Format a configuration as YAML with a comment above every key.

    Parameters
    ----------
    config : Config
        The values.

    Returns
    -------
    str
        Loads back to the same configuration.
    """
    schema = Config.model_json_schema()
    return _HEADER + "\n".join(_lines(schema, schema["$defs"], config.model_dump(mode="json"), "")) + "\n"


def plain_yaml(config: Config) -> str:
    """Format a configuration as YAML without comments."""
    return yaml.safe_dump(config.model_dump(mode="json"), sort_keys=False)


def _lines(schema: _Object, sections: _Object, values: _Object, indent: str) -> Iterator[str]:
    """Yield the lines of one section, and of the sections in it."""
    for key, entry in schema["properties"].items():
        section = sections.get(str(entry.get("$ref", "")).rpartition("/")[2])
        if section is not None:
            yield ""
        yield from _comment(entry, indent)
        if section is None:
            yield f"{indent}{key}: {_scalar(values[key])}"
        else:
            yield f"{indent}{key}:"
            yield from _lines(section, sections, values[key], indent + "  ")


def _comment(entry: _Object, indent: str) -> Iterator[str]:
    """Yield the lines of a comment: the meaning of a key and its allowed values."""
    for line in wrap(entry["description"], _WIDTH - len(indent) - 2):
        yield f"{indent}# {line}"
    if "$ref" not in entry:
        yield f"{indent}# ({_allowed(entry)}; default {_scalar(entry['default'])})"


def _allowed(entry: _Object) -> str:
    """Describe the allowed values of a key."""
    if "anyOf" in entry:
        return " or ".join(_allowed(choice) for choice in entry["anyOf"])
    if "$ref" in entry:
        return "entry"
    if "enum" in entry:
        return " or ".join(entry["enum"])
    if entry["type"] == "array":
        return f"list of {_allowed(entry['items'])}"
    if entry["type"] == "boolean":
        return "true or false"
    bounds = [f"{sign} {entry[name]:g}" for name, sign in _BOUNDS.items() if name in entry]
    return " ".join([str(entry["type"]), " and ".join(bounds)]).strip()


def _scalar(value: object) -> str:
    """Format one value in the flow style of YAML."""
    return (
        yaml.safe_dump(value, default_flow_style=True, width=10**9, allow_unicode=True).removesuffix("\n...\n").strip()
    )
