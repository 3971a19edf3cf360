"""The command line: one file per command.

A command imports heavy libraries only when it needs them, so `cylx --help` is fast.
"""

from __future__ import annotations

import click

from cylx.cli.options.configuration import debug_option
from cylx.cli.terminal.group import LazyGroup
from cylx.version import __version__


@click.group(
    cls=LazyGroup,
    homes={
        "extract": "cylx.cli.extract",
        "runs": "cylx.cli.runs",
        "stems": "cylx.cli.stems",
        "view": "cylx.cli.view",
        "info": "cylx.cli.info",
        "config": "cylx.cli.config",
        "synth": "cylx.cli.synth",
        "evaluate": "cylx.cli.evaluate",
        "check": "cylx.cli.check",
        "diff": "cylx.cli.diff",
        "deviation": "cylx.cli.deviation",
        "export": "cylx.cli.export",
        "doctor": "cylx.cli.doctor",
        "warmup": "cylx.cli.warmup",
        "reproduce": "cylx.cli.reproduce",
    },
    examples=["cylx extract scan.ply", "cylx extract scan.ply -o - | jq '.cylinders | length'"],
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)
@click.version_option(__version__, prog_name="cylx", message="%(prog)s %(version)s")
@debug_option
def main() -> None:
    """Find every cylinder in a point cloud that has no normals.

    Exit codes: 0 done; 1 a difference or a fault was found, or a bug; 2 usage or configuration; 3 unreadable or
    unusable input; 4 output could not be written; 5 fewer cylinders than --require; 6 some of several inputs failed;
    130 interrupted; 141 the reader of a pipe went away.
    """
