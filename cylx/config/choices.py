"""The methods and presets there are, listed once: for the configuration, the command line and results."""

from __future__ import annotations

from typing import Literal, get_args

Method = Literal["gt", "msac", "line-fit", "tran", "jin"]
Preset = Literal["auto", "paper"]

METHODS: tuple[Method, ...] = get_args(Method)
PRESETS: tuple[Preset, ...] = get_args(Preset)
