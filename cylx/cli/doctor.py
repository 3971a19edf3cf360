"""`cylx doctor`: whether the installation works."""

from __future__ import annotations

import json
from dataclasses import asdict

import click

from cylx.cli.options.configuration import debug_option, json_option
from cylx.cli.terminal.failures import answer
from cylx.cli.terminal.group import ExampleCommand


@click.command(
    cls=ExampleCommand, examples=["cylx doctor", "cylx doctor --json | jq '.checks[] | select(.state != \"ok\")'"]
)
@json_option
@debug_option
def doctor(*, as_json: bool) -> None:
    """Check the installation, and say what to do about what is not well.

    Libraries, compiled kernels, memory, and the extraction of a cylinder that is made up. The exit code is 0 if
    cylinders can be found and 1 if not; optional libraries that are missing are no fault. Nothing is fetched.
    """
    from cylx.cli.doctor import diagnose
    from cylx.cli.terminal.display import Conversation, show_table

    with Conversation().progress() as observer:
        checks = diagnose(observer)
    works = all(check.state == "ok" for check in checks if check.needed)
    if as_json:
        content = {"works": works, "checks": [asdict(check) for check in checks]}
        answer(json.dumps(content, indent=2, ensure_ascii=False) + "\n")
    else:
        show_table(["what", "state", "detail", "remedy"], [[c.name, c.state, c.detail, c.remedy] for c in checks])
        answer("cylinders can be found\n" if works else "cylinders cannot be found: see what is missing or broken\n")
    if not works:
        raise click.exceptions.Exit(1)
