"""A comparison of two results as JUnit XML, which CI servers show as tests: one for each entry that was compared."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import PurePath
from typing import Any
from xml.etree import ElementTree

from cylx.evaluation.differences import Difference
from cylx.evaluation.regression import Comparison
from cylx.harmless import visible
from cylx.wording import number

LISTS = ("cylinders", "blends", "fittings", "runs")


def junit(a: Mapping[str, Any], b: Mapping[str, Any], comparison: Comparison, names: tuple[str, str]) -> bytes:
    """Return a comparison as a JUnit file, with one suite of tests.

    Each cylinder, blend, fitting and run of a is a test, and so is each that only b has. It fails if it differs; the
    one failure has all differences, as some servers show the first failure only. There are no times, so that the same
    comparison gives the same bytes. Characters that do not print, some of which XML forbids, are escaped.

    Parameters
    ----------
    a, b : mapping
        The JSON objects that were compared.
    comparison : Comparison
        What `compare` returned for them.
    names : (str, str)
        What to call a and b, such as their paths; the path of a groups the tests on a server.

    Returns
    -------
    bytes
        XML in UTF-8.
    """
    cases = [
        (of, title, differences[0].kind if differences else "", [_said(one) for one in differences])
        for of, title, differences in _cases(a, comparison)
    ]
    return junit_of("cylx diff", f"{names[0]} and {names[1]}", names[0], cases)


def junit_of(tool: str, title: str, path: str, cases: Sequence[tuple[str, str, str, Sequence[str]]]) -> bytes:
    """Return tests as a JUnit file, with one suite.

    Parameters
    ----------
    tool : str
        What made them.
    title : str
        Name of the suite.
    path : str
        What groups the tests on a server.
    cases : sequence of (str, str, str, sequence of str)
        Of each test its group, its name, the type of its failure, and what is wrong; it fails if that is something.

    Returns
    -------
    bytes
        XML in UTF-8.
    """
    failures = sum(bool(wrong) for *_, wrong in cases)
    counts = {"tests": str(len(cases)), "failures": str(failures), "errors": "0", "skipped": "0", "time": "0"}
    root = ElementTree.Element("testsuites", {"name": tool, **counts})
    suite = ElementTree.SubElement(root, "testsuite", {"name": visible(title), **counts})
    group, taken = _group(path), Counter[tuple[str, str]]()
    for of, called, kind, wrong in cases:
        taken[of, called] += 1
        # servers take the same name for one test
        name = called if taken[of, called] == 1 else f"{called} ({taken[of, called]})"
        attributes = {"classname": f"{group}.{visible(of)}", "name": visible(name), "time": "0"}
        case = ElementTree.SubElement(suite, "testcase", attributes)
        if wrong:
            lines = [visible(line) for line in wrong]
            failure = ElementTree.SubElement(case, "failure", {"type": kind, "message": "; ".join(lines)})
            failure.text = "\n".join(lines)
    ElementTree.indent(root)
    return bytes(ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)) + b"\n"


def _cases(a: Mapping[str, Any], comparison: Comparison) -> Iterator[tuple[str, str, list[Difference]]]:
    """Yield the list, the title and the differences of each test, in the order of a, with those only in b last."""
    for of in LISTS:
        here = [difference for difference in comparison.differences if difference.of == of]
        known: dict[int, list[Difference]] = {}
        for difference in here:
            if difference.id_a is not None:
                known.setdefault(difference.id_a, []).append(difference)
        for index, entry in enumerate(a.get(of, ())):
            number = entry.get("id", index)
            yield of, f"{of.removesuffix('s')} {number}", known.pop(number, [])
        for difference in here:
            if difference.id_a is None:
                yield of, f"{of.removesuffix('s')} {difference.id_b} of B", [difference]


def _said(difference: Difference) -> str:
    """Say one difference in words."""
    if difference.kind in {"missing", "extra"}:
        only = ("A", difference.id_a) if difference.kind == "missing" else ("B", difference.id_b)
        radius = difference.a if difference.kind == "missing" else difference.b
        size = "" if radius is None else f" of radius {number(radius, 6)}"
        return f"{difference.kind}: {difference.what} {only[1]}{size} is only in {only[0]}"
    values = [("A", difference.a), ("B", difference.b), ("difference", difference.difference)]
    values.append(("tolerance", difference.tolerance))
    told = ", ".join(f"{name} {number(value, 6)}" for name, value in values if value is not None)
    ids = f"id {difference.id_a} in A, {difference.id_b} in B"
    return f"{difference.kind}: {difference.what}{': ' if told else ''}{told} ({ids})"


def _group(name: str) -> str:
    """Return the path of a file with dots between its parts, as servers build a tree from that."""
    parts = [part.replace(".", "_") for part in PurePath(name).parts if part not in {PurePath(name).anchor, ".."}]
    return visible(".".join(parts)) or "cylx"
