"""`cylx check`: check whether files of results are whole and valid."""

from __future__ import annotations

import json
from importlib import import_module
from typing import TYPE_CHECKING

import click

from cylx.cli.batch.summary import legible
from cylx.cli.options.configuration import complete_files, debug_option, json_option
from cylx.cli.terminal.failures import answer, describe_failure, tell
from cylx.cli.terminal.group import ExampleCommand
from cylx.errors import InputError

if TYPE_CHECKING:
    from cylx.results.parts import Part

_FORMATS = {
    "cylx.cylinders/1": ("cylx.results.result", "Result"),
    "cylx.rejected/1": ("cylx.results.rejected", "Rejections"),
    "cylx.stems/1": ("cylx.results.stems", "Stems"),
    "cylx.deviation/1": ("cylx.deviation.document", "Deviations"),
}
"""The models of the formats, by their names in the files; imported when a file has one."""


@click.command(
    cls=ExampleCommand, examples=["cylx check room.cylinders.json", "cylx check --quiet golden/*.cylinders.json"]
)
@click.argument("files", nargs=-1, required=True, metavar="FILE...", shell_complete=complete_files)
@click.option("-q", "--quiet", is_flag=True, help="Show errors only.")
@json_option
@debug_option
def check(*, files: tuple[str, ...], quiet: bool, as_json: bool) -> None:
    """Check whether each FILE is a whole and valid result, for hooks before commits and for archives.

    A FILE is the JSON of 'cylx extract', of its --rejected, of 'cylx runs', 'cylx stems' or 'cylx deviation'. Every key
    must be there, with a value that the schema allows. Standard error has the first fault of each file; the exit code
    is 3 if there is one. What is left by a merge, cut off, or changed by hand in a way that programs cannot read, is
    found by this; whether the cylinders are right is a question for 'cylx diff'.
    """
    verdicts, refused = [], False
    for file in files:
        try:
            form, fault = checked(file), None
        except InputError as failure:
            form, fault, refused = None, failure, True
            tell(describe_failure(failure)[0])
        verdicts.append({"file": legible(file), "valid": fault is None, "schema": form, "fault": _told(fault)})
        if fault is None and not quiet and not as_json:
            answer(f"{legible(file)}: valid, {form}\n")
    if as_json:
        answer(json.dumps(verdicts, indent=2, ensure_ascii=False) + "\n", as_json=True)
    if refused:
        raise click.exceptions.Exit(InputError.exit_code)


def checked(file: str) -> str:
    """Return the name of the format of a file that is valid.

    Parameters
    ----------
    file : str
        A file, or `-` for standard input.

    Raises
    ------
    InputError
        If it cannot be read, or is not as its format has it.
    """
    from cylx.io import read_json

    document = read_json(file)
    form = document.get("schema")
    if not isinstance(form, str) or form not in _FORMATS:
        fault = "has no schema" if form is None else f"has the schema {form!r}"[:80]
        raise InputError(file, fault, f"give a file with one of {', '.join(_FORMATS)}")
    home, name = _FORMATS[form]
    model: type[Part] = getattr(import_module(home), name)
    model.parse(document, file)
    return form


def _told(fault: InputError | None) -> dict[str, str] | None:
    """Return a fault as a JSON object."""
    if fault is None:
        return None
    return {"place": legible(fault.place), "fault": fault.fault, "remedy": fault.remedy}
