"""JSON objects on their way into a file: what is left out of them, and their text."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from typing import Any


def drop_missing(parts: Iterable[dict[str, Any]]) -> None:
    """Take what was not computed out of parts of a JSON object."""
    for part in parts:
        for key in [key for key, value in part.items() if value is None]:
            del part[key]


def text_of(content: Mapping[str, Any]) -> str:
    """Give the text of a JSON file, with a newline at its end."""
    return json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
