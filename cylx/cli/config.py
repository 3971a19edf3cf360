"""`cylx config`: write, show and check configurations, and publish the schemas."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import click

from cylx.cli.batch.summary import legible
from cylx.cli.options.configuration import (
    complete_files,
    configured,
    debug_option,
    json_option,
    overwrite_option,
)
from cylx.cli.terminal.failures import answer
from cylx.cli.terminal.group import ExampleGroup
from cylx.config.choices import PRESETS
from cylx.errors import ConfigError, UsageError

if TYPE_CHECKING:
    from cylx.config import Config


@click.group(cls=ExampleGroup, examples=["cylx config init my.yaml", "cylx config check my.yaml"])
def config() -> None:
    """Write, show and check configurations."""


@config.command(examples=["cylx config init my.yaml", "cylx config init - --preset paper"])
@click.argument("file", default="cylx.yaml", shell_complete=complete_files)
@click.option("--preset", type=click.Choice(PRESETS), default="auto", show_default=True, help="Values to write.")
@overwrite_option
@debug_option
def init(*, file: str, preset: str, overwrite: bool) -> None:
    """Write a configuration with every key, its value and its meaning.

    FILE is cylx.yaml by default, - for standard output. Change what you like, leave out the rest, and pass it to
    'cylx extract -c FILE'.
    """
    from cylx.config import load_config
    from cylx.config.yaml_writer import commented_yaml
    from cylx.io import write_text

    write_text(file, commented_yaml(load_config(preset=preset)), overwrite=overwrite)


@config.command(examples=["cylx config show --preset paper", "cylx config show -c my.yaml --set slicing.planes=80"])
@configured
@json_option
@debug_option
def show(*, settings: Config, as_json: bool) -> None:
    """Show the configuration that these options give.

    Values that are null are derived from the cloud; the JSON that 'cylx extract' writes has the derived values.
    """
    from cylx.config import plain_yaml

    answer(
        json.dumps(settings.model_dump(mode="json"), indent=2) + "\n" if as_json else plain_yaml(settings),
        as_json=as_json,
    )


@config.command(examples=["cylx config check my.yaml", "cylx config check my.yaml && cylx extract scan.ply -c my.yaml"])
@click.argument("file", shell_complete=complete_files)
@json_option
@debug_option
def check(*, file: str, as_json: bool) -> None:
    """Check whether the configuration FILE is valid, and report its faults if not.

    Standard error shows the first fault; --json lists all faults that can be found at once.
    """
    from cylx.config import load_config

    try:
        preset = load_config(path=file).preset
    except ConfigError as failure:
        if as_json:
            answer(_verdict(file, None, _faults_of(failure, file)), as_json=True)
        raise
    said = _verdict(file, preset, []) if as_json else f"{file}: valid, preset {preset}\n"
    answer(said, as_json=as_json)


def _verdict(file: str, preset: str | None, faults: Sequence[Mapping[str, object]]) -> str:
    """Return the JSON report."""
    content = {"file": legible(file), "valid": not faults, "preset": preset, "faults": faults}
    return json.dumps(content, indent=2, ensure_ascii=False) + "\n"


def _faults_of(failure: ConfigError, file: str) -> list[dict[str, object]]:
    """Return all faults with their dotted path or line, if known."""
    place = failure.place.removeprefix(file)
    line, key = re.fullmatch(r":(\d+)", place), re.fullmatch(r"(?:: )?(\w+(?:\.\w+)*)", place)
    known = failure.faults or ((key[1] if key else "", failure.fault, failure.remedy),)
    return [
        {"key": path or None, "line": int(line[1]) if line else None, "fault": fault, "remedy": remedy}
        for path, fault, remedy in known
    ]


@config.command(examples=["cylx config schema > cylx.schema.json", "cylx config schema --result"])
@click.option("--result", is_flag=True, help="Print the schema of NAME.cylinders.json instead.")
@click.option("--rejected", is_flag=True, help="Print the schema of the file of 'cylx extract --rejected' instead.")
@click.option("--deviation", is_flag=True, help="Print the schema of the JSON of 'cylx deviation' instead.")
@click.option("--stems", is_flag=True, help="Print the schema of the JSON of 'cylx stems' instead.")
@debug_option
def schema(*, result: bool, rejected: bool, deviation: bool, stems: bool) -> None:
    """Print the JSON schema of the configuration, or of the output files.

    With the schema, editors complete and check the YAML while you type.
    """
    if result and rejected:
        raise UsageError("--rejected", "contradicts --result", "leave one of them out")
    if deviation and (result or rejected):
        raise UsageError("--deviation", "contradicts --result and --rejected", "leave one of them out")
    if stems and (result or rejected or deviation):
        raise UsageError("--stems", "contradicts the other schemas", "leave one of them out")
    if stems:
        from cylx.results.stems import stems_schema

        document = stems_schema()
    elif deviation:
        from cylx.deviation.document import deviation_schema

        document = deviation_schema()
    elif rejected:
        from cylx.results import rejections_schema

        document = rejections_schema()
    elif result:
        from cylx.results import result_schema

        document = result_schema()
    else:
        from cylx.config import Config

        document = Config.model_json_schema()
    answer(json.dumps(document, indent=2) + "\n", as_json=True)
