"""Commands whose help starts with examples, and a group that imports commands on demand."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from importlib import import_module
from typing import Any

import click

from cylx.cli.terminal.failures import Failures, blamed_on


class ExampleCommand(click.Command):
    """A command whose help starts with examples.

    Parameters
    ----------
    examples : sequence of str
        Command lines.
    """

    def __init__(self, *args: Any, examples: Sequence[str] = (), **attributes: Any) -> None:  # noqa: ANN401  the signature is click's
        super().__init__(*args, **attributes)
        self.examples = examples

    def format_help_text(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the examples and the description of the command."""
        if self.examples:
            with formatter.section("Examples"):
                for line in self.examples:
                    formatter.write(f"{'':>{formatter.current_indent}}{line}\n")
        super().format_help_text(ctx, formatter)

    def invoke(self, ctx: click.Context) -> object:
        """Run the command; a failure that it did not foresee names the files that it was given."""
        given = [ctx.params.get(item.name or "") for item in self.params if isinstance(item, click.Argument)]
        files = [name for one in given for name in (one if isinstance(one, tuple) else (one,)) if isinstance(name, str)]
        with blamed_on(*files):
            return super().invoke(ctx)


class ExampleGroup(ExampleCommand, click.Group):
    """A group whose help and whose commands' help start with examples."""

    command_class = ExampleCommand


class LazyGroup(ExampleGroup):
    """A group that imports its commands on demand, and turns failures into one line and an exit code.

    Parameters
    ----------
    homes : mapping of str to str
        Command name to the module that defines the command.
    """

    def __init__(self, *args: Any, homes: Mapping[str, str], **attributes: Any) -> None:  # noqa: ANN401  the signature is click's
        super().__init__(*args, **attributes)
        self.homes = homes

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the names of the commands, in the order of use."""
        return list(self.homes)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import a command."""
        if cmd_name not in self.homes:
            return None
        command = getattr(import_module(self.homes[cmd_name]), cmd_name)
        assert isinstance(command, click.Command)
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Find the command, or suggest the one with the closest name."""
        name = args[0]
        if name not in self.homes and not name.startswith("-"):
            close = get_close_matches(name, self.homes, n=1)
            ctx.fail(f"no such command '{name}'" + (f"; did you mean '{close[0]}'?" if close else ""))
        return super().resolve_command(ctx, args)

    def make_context(
        self,
        info_name: str | None,
        args: list[str],
        parent: click.Context | None = None,
        **extra: Any,  # noqa: ANN401  the signature is click's
    ) -> click.Context:
        """Parse the group's own options."""
        with Failures():
            return super().make_context(info_name, args, parent, **extra)

    def invoke(self, ctx: click.Context) -> object:
        """Run the command."""
        with Failures(ctx):
            return super().invoke(ctx)
