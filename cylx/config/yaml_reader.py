"""A strict YAML reader.

It reads only what a configuration needs: mappings, lists, and the scalars of YAML 1.2, so that `1e-3` is a number and
`yes` is a word. Tags, anchors, aliases and repeated keys are errors, and only plain data are constructed.
"""

from __future__ import annotations

import re

import yaml

from cylx.errors import ConfigError

_MOST_DIGITS = 300
_MOST_DEPTH = 20
_INTEGER = re.compile(rf"[-+]?[0-9]{{1,{_MOST_DIGITS}}}$")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?$")
_WORDS: dict[str, bool | None] = {"": None, "~": None, "null": None, "true": True, "false": False}


def parse_yaml(text: str, place: str) -> object:
    """Read one YAML document into plain data.

    Parameters
    ----------
    text : str
        The document.
    place : str
        Its name in an error: a file, an option.

    Returns
    -------
    dict, list, str, int, float, bool or None
        None for an empty document.

    Raises
    ------
    ConfigError
        If the text is not YAML, or uses tags, anchors, aliases, a key twice or deep nesting.

    Examples
    --------
    >>> parse_yaml("thickness: 1e-3", "my.yaml")
    {'thickness': 0.001}
    >>> parse_yaml("pieces: yes", "my.yaml")
    {'pieces': 'yes'}
    """
    try:
        _refuse_anchors_and_tags(text, place)
        node = yaml.compose(text, Loader=yaml.SafeLoader)
        return None if node is None else _plain(node, place)
    except yaml.MarkedYAMLError as error:
        words = [error.context, error.problem] if (error.problem or "").startswith("but ") else [error.problem]
        fault = " ".join(" ".join(filter(None, words)).split()) or "is not YAML"
        raise ConfigError(_line(place, error.problem_mark), fault, "correct the YAML there") from None
    except yaml.reader.ReaderError as error:
        fault = f"holds the character #x{error.character:04x}" if isinstance(error.character, int) else "is not text"
        raise ConfigError(place, fault, "give a YAML text file") from None
    except (OverflowError, ValueError):  # of chr: an escape such as \UFFFFFFFF is no letter
        raise ConfigError(place, "has an escape that is no letter", "write the letter itself") from None


def entry_lines(text: str) -> list[int]:
    """Return the line number of each entry of a list that `parse_yaml` has read."""
    node = yaml.compose(text, Loader=yaml.SafeLoader)
    return [item.start_mark.line + 1 for item in node.value] if isinstance(node, yaml.SequenceNode) else []


def _refuse_anchors_and_tags(text: str, place: str) -> None:
    """Refuse anchors, aliases, tags and deep nesting, before anything is constructed."""
    depth = 0
    for event in yaml.parse(text, Loader=yaml.SafeLoader):
        line = _line(place, event.start_mark)
        if isinstance(event, yaml.AliasEvent) or getattr(event, "anchor", None) is not None:
            raise ConfigError(line, "anchors and aliases are not allowed", "write the value out")
        tag = getattr(event, "tag", None)
        if tag not in {None, "!"}:
            raise ConfigError(line, f"the tag {tag} is not allowed", "write a plain value")
        depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        if depth > _MOST_DEPTH:
            raise ConfigError(line, "is nested too deeply", "a configuration has two levels")


def _line(place: str, mark: object) -> str:
    """Return the place with the line of a mark, if there is one."""
    line = getattr(mark, "line", None)
    return place if line is None else f"{place}:{line + 1}"


def _plain(node: yaml.Node, place: str) -> object:
    """Turn a node into plain data."""
    if isinstance(node, yaml.MappingNode):
        return _mapping(node, place)
    if isinstance(node, yaml.SequenceNode):
        return [_plain(item, place) for item in node.value]
    quoted = isinstance(node, yaml.ScalarNode) and node.style is not None
    return node.value if quoted else _scalar(node.value)


def _mapping(node: yaml.MappingNode, place: str) -> dict[str, object]:
    """Turn a mapping node into a dict; repeated keys are errors."""
    mapping: dict[str, object] = {}
    for key_node, value_node in node.value:
        line = _line(place, key_node.start_mark)
        if not isinstance(key_node, yaml.ScalarNode):
            raise ConfigError(line, "a key must be a word", "write 'key: value'")
        key = str(key_node.value)
        if key in mapping:
            raise ConfigError(line, f"the key '{key}' appears twice", "leave one of them out")
        mapping[key] = _plain(value_node, place)
    return mapping


def _scalar(text: str) -> object:
    """Parse an unquoted scalar: null, a truth value, a number, or a word."""
    if text.lower() in _WORDS and text in {text.lower(), text.title(), text.upper()}:
        return _WORDS[text.lower()]
    if _INTEGER.match(text):
        return int(text)
    return float(text) if _FLOAT.match(text) else text
