"""`cylx warmup`: compile the kernels ahead of the first scan."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from cylx.cli.options.configuration import debug_option
from cylx.cli.terminal.failures import answer
from cylx.cli.terminal.group import ExampleCommand

if TYPE_CHECKING:
    from cylx.api.warmup import Warmed


@click.command(cls=ExampleCommand, examples=["cylx warmup", "cylx warmup --quiet"])
@click.option("-q", "--quiet", is_flag=True, help="Show errors only.")
@debug_option
def warmup(*, quiet: bool) -> None:
    """Compile the kernels that 'cylx extract' needs, for images of containers and caches of CI.

    They are kept where 'cylx doctor' says, for this version and this processor. What is there already is not compiled
    again. Where nothing can be kept, one line says so; the exit code is 0.
    """
    from cylx.cli.terminal.display import Messages
    from cylx.cli.terminal.signals import check_heard
    from cylx.cli.terminal.startup import collect_rarely, import_numba_without_blas

    collect_rarely()
    import_numba_without_blas()
    from cylx.api.warmup import ask_between_kernels, warm_up

    ask_between_kernels(check_heard)
    with Messages(quiet=quiet).progress() as observer:
        warmed = warm_up(observer)
    if not quiet:
        answer(said(warmed) + "\n")


def said(warmed: Warmed) -> str:
    """Say in one line what was done."""
    took = f"{warmed.seconds:.1f} s"
    many = f"{warmed.compiled} kernel{'' if warmed.compiled == 1 else 's'}"
    if warmed.folder is None and warmed.compiled:
        return f"compiled {many} in {took}, but they cannot be kept: set NUMBA_CACHE_DIR to a writable folder"
    if warmed.folder is None:
        return f"all kernels are there already, where no more can be kept ({took})"
    if not warmed.compiled:
        return f"all {warmed.kept} kernels are there already, in {warmed.folder} ({took})"
    return f"compiled {many} in {took}; {warmed.kept} kept in {warmed.folder}"
