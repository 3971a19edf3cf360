"""Describe the faults of a configuration to the user: the dotted path, the fault, the remedy."""

from __future__ import annotations

from collections.abc import Iterator
from difflib import get_close_matches
from typing import TYPE_CHECKING, TypeGuard, get_args, get_origin

from pydantic import BaseModel, ValidationError

if TYPE_CHECKING:
    from pydantic_core import ErrorDetails

_LIMITS = {
    "greater_than": ("gt", "out of range", "it must be > {:g}"),
    "greater_than_equal": ("ge", "out of range", "it must be >= {:g}"),
    "less_than": ("lt", "out of range", "it must be < {:g}"),
    "less_than_equal": ("le", "out of range", "it must be <= {:g}"),
    "too_short": ("min_length", "too short", "it must have {} or more entries"),
    "too_long": ("max_length", "too long", "it must have {} or fewer entries"),
}
_KINDS = {
    "bool": ("true or false", "write true or false without quotes"),
    "int": ("an integer", "write digits alone"),
    "float": ("a number", "write a number such as 0.05"),
    "finite": ("a finite number", "write a number such as 0.05"),
    "string": ("a word", "put it in quotes"),
    "list": ("a list", "write [a, b]"),
    "model": ("a section", "write its keys below it, indented"),
    "dict": ("a section", "write its keys below it, indented"),
}


def describe_fault(error: ValidationError, model: type[BaseModel]) -> tuple[tuple[str, ...], str, str]:
    """Describe the first fault of a failed validation.

    Parameters
    ----------
    error : pydantic.ValidationError
        The failure.
    model : type of pydantic.BaseModel
        The model that was validated.

    Returns
    -------
    path : tuple of str
        Keys that lead to the fault; empty for the model as a whole.
    fault, remedy : str
        What is wrong, and how to correct it.
    """
    return describe_faults(error, model)[0]


def describe_faults(error: ValidationError, model: type[BaseModel]) -> list[tuple[tuple[str, ...], str, str]]:
    """Describe all faults of a failed validation, one per path, in the form of `describe_fault`."""
    found: dict[tuple[str, ...], tuple[str, str]] = {}
    for details in error.errors(include_url=False):
        path = tuple(str(part) for part in details["loc"])
        if path not in found:
            found[path] = _fault_and_remedy(details, path, model)
    return [(path, *words) for path, words in found.items()]


def dotted_keys(model: type[BaseModel], prefix: str = "") -> Iterator[str]:
    """Yield the dotted path of every key of a model, sections before their keys."""
    for name, field in model.model_fields.items():
        yield prefix + (field.alias or name)
        if _is_model(field.annotation):
            yield from dotted_keys(field.annotation, f"{prefix}{name}.")


def _is_model(annotation: object) -> TypeGuard[type[BaseModel]]:
    """Return whether an annotation is a model; for Python 3.10, `tuple[float, float]` is a type."""
    return isinstance(annotation, type) and get_origin(annotation) is None and issubclass(annotation, BaseModel)


def _fault_and_remedy(details: ErrorDetails, path: tuple[str, ...], model: type[BaseModel]) -> tuple[str, str]:
    """Translate one of pydantic's errors."""
    kind, value, context = details["type"], details["input"], details.get("ctx", {})
    if kind in {"extra_forbidden", "missing"}:
        return ("unknown key", _suggest_key(path, model)) if kind == "extra_forbidden" else ("is missing", "add it")
    if kind == "literal_error":
        return f"{_show(value)} is not one of its values", _suggest_value(value, str(context["expected"]))
    if kind in _LIMITS:
        limit, fault, remedy = _LIMITS[kind]
        return f"{_show(value)} is {fault}", remedy.format(context[limit])
    if kind == "value_error":
        fault, _, remedy = str(context["error"]).partition("; ")
        return fault, remedy
    what, remedy = _KINDS.get(kind.split("_")[0], ("what belongs here", details["msg"].lower()))
    return f"{_show(value)} is not {what}", remedy


def _suggest_key(path: tuple[str, ...], model: type[BaseModel]) -> str:
    """Suggest the key with the closest name, in the same section or in another one."""
    keys = list(dotted_keys(model))
    if path[-1] in keys:
        above, _, key = path[-1].rpartition(".")
        return f"write '{key}' below '{above}:', indented"
    siblings = [field.alias or name for name, field in _model_at(path[:-1], model).model_fields.items()]
    if close := get_close_matches(path[-1], siblings, n=1):
        return f"did you mean '{close[0]}'?"
    if elsewhere := [key for key in keys if get_close_matches(path[-1], [key.rpartition(".")[2]], cutoff=0.8)]:
        return f"did you mean '{elsewhere[0]}'?"
    return f"the keys here are {', '.join(siblings)}"


def _model_at(path: tuple[str, ...], model: type[BaseModel]) -> type[BaseModel]:
    """Return the model of the section, or of the entry of a list, that a path leads to."""
    for part in path:
        field = model.model_fields.get(part)  # the index of a list entry is not a field, and is skipped
        model = model if field is None else _model_in(field.annotation) or model
    return model


def _model_in(annotation: object) -> type[BaseModel] | None:
    """Return the model in an annotation: the annotation itself, or the model of the entries of a list."""
    if _is_model(annotation):
        return annotation
    return next(filter(None, map(_model_in, get_args(annotation))), None)


def _suggest_value(value: object, expected: str) -> str:
    """Suggest the closest value, or list all; `expected` is pydantic's list of them."""
    choices = [word for word in expected.split("'") if word not in {"", ", ", " or "}]
    close = get_close_matches(str(value), choices, n=1)
    return f"did you mean '{close[0]}'?" if close else f"choose {' or '.join(choices)}"


def _show(value: object) -> str:
    """Format a value as in YAML, shortened."""
    if value is None or isinstance(value, bool):
        return str(value).lower().replace("none", "null")
    if isinstance(value, dict):
        return "a section"
    text = " ".join(repr(value).split())
    return text if len(text) <= 40 else f"{text[:36]} ..."
