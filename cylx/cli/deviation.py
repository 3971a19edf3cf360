"""`cylx deviation`: a scan against the cylinders of a design."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import click

from cylx.cli.batch.jobs import check_apart
from cylx.cli.options.configuration import complete_files, debug_option, json_option, overwrite_option
from cylx.cli.options.numbers import NumberRange
from cylx.cli.options.selection import selecting
from cylx.cli.options.units import UNITS, units_option
from cylx.cli.terminal.failures import answer, tell
from cylx.cli.terminal.group import ExampleCommand
from cylx.wording import number

if TYPE_CHECKING:
    from cylx.deviation import Comparison
    from cylx.deviation.document import Deviations
    from cylx.records import Selection

_LENGTH = NumberRange(min=0)
_SIZE = NumberRange(min=0, min_open=True)
_HEADER = ("id", "name", "points", "seen", "offset", "tilt", "radius", "cylindricity", "ovality", "patches", "verdict")


@click.command(
    cls=ExampleCommand,
    examples=[
        "cylx deviation tank.e57 tank.step --radius 0.01 --dent 0.005 --report tank.html",
        "cylx deviation plant.laz plant.ifc --offset 0.02 --tilt 0.5 -o plant.deviation.json --junit plant.xml",
    ],
)
@click.argument("scan", shell_complete=complete_files)
@click.argument("design", shell_complete=complete_files)
@click.option("--offset", type=_LENGTH, metavar="X", help="Allowed distance of an axis from that of the design.")
@click.option("--tilt", "tilt_deg", type=_LENGTH, metavar="X", help="Allowed angle between the axes, degrees.")
@click.option("--radius", type=_LENGTH, metavar="X", help="Allowed difference of the radius, either way.")
@click.option("--cylindricity", type=_LENGTH, metavar="X", help="Allowed cylindricity (ISO 1101, minimum zone).")
@click.option("--ovality", type=_LENGTH, metavar="X", help="Allowed difference of the largest and smallest diameter.")
@click.option("--taper", type=_LENGTH, metavar="X", help="Allowed change of the diameter per length, either way.")
@click.option("--dent", type=_LENGTH, metavar="X", help="Allowed depth of dents and bulges.")
@click.option("--certain", is_flag=True, help="Exit with 1 also if a check is undecided within its uncertainty.")
@click.option("--within", type=_SIZE, metavar="X", help="Reach of a design surface.  [default: 15 % of its radius]")
@click.option("--cell", type=_SIZE, metavar="X", help="Side of the cells of a surface.  [default: by the points]")
@units_option("a design that has another needs")
@click.option("--design-units", type=click.Choice(UNITS), help="Unit of the design, if it does not say it.")
@click.option("-o", "--output", metavar="FILE", shell_complete=complete_files, help="Write everything as JSON.")
@click.option("--report", metavar="FILE", shell_complete=complete_files, help="Write an HTML page with unrolled maps.")
@click.option(
    "--junit", "junit_file", metavar="FILE", shell_complete=complete_files, help="Write the checks as JUnit XML."
)
@selecting
@overwrite_option
@json_option
@debug_option
def deviation(
    *,
    scan: str,
    design: str,
    certain: bool,
    within: float | None,
    cell: float | None,
    units: str | None,
    design_units: str | None,
    output: str | None,
    report: str | None,
    junit_file: str | None,
    selection: Selection,
    overwrite: bool,
    as_json: bool,
    **tolerances: float | None,
) -> None:
    """Compare SCAN with the cylinders of DESIGN, which is in the same coordinates.

    DESIGN is a result or a truth (.json), a table (.csv), or solids (.step, .ifc). For each of its cylinders this
    measures where it is, how large, how round and how dented, with uncertainties. Lengths are in the unit of the scan;
    those of the design are converted. The exit code is 1 if a cylinder was not found or is out of a tolerance for
    certain, that is by more than two standard deviations.
    """
    from cylx.api.deviations import measure_deviations
    from cylx.io import check_writable

    outputs = [name for name in (output, report, junit_file) if name is not None]
    check_apart([scan, design], outputs)
    for name in outputs:
        check_writable(name, overwrite=overwrite)
    options: dict[str, Any] = {**tolerances, "within": within, "cell": cell}
    options |= {name: getattr(selection, name) for name in ("crop", "voxel", "every", "classes", "scan")}
    found = measure_deviations(scan, design, units=units, design_units=design_units, **options)
    content = found.to_document()
    _write(content, found, (output, report, junit_file), (scan, design), overwrite=overwrite)
    if as_json:
        answer(json.dumps(content.to_object(), indent=2, ensure_ascii=False) + "\n", as_json=True)
    else:
        _show(content)
    if content.verdict == "fail" or (certain and content.verdict == "undecided"):
        raise click.exceptions.Exit(1)


def _write(
    content: Deviations,
    found: Comparison,
    names: tuple[str | None, str | None, str | None],
    inputs: tuple[str, str],
    *,
    overwrite: bool,
) -> None:
    """Write the requested files, all of them or none."""
    from cylx.io.outputs import write_together

    output, report, junit_file = names
    files: dict[str, bytes] = {}
    if output is not None:
        files[output] = content.to_json().encode()
    if report is not None:
        files[report] = page(content, found).encode()
    if junit_file is not None:
        from cylx.evaluation.junit import junit_of

        files[junit_file] = junit_of("cylx deviation", f"{inputs[0]} and {inputs[1]}", inputs[0], _cases(content))
    if files:
        write_together(files, overwrite=overwrite)
        tell(f"written to {', '.join(files)}")


def _cases(content: Deviations) -> list[tuple[str, str, str, list[str]]]:
    """Return a test for each check: group, name, type of the failure, and what is wrong, if it is."""
    cases: list[tuple[str, str, str, list[str]]] = []
    for entry in content.cylinders:
        for check in entry.checks:
            said = [] if check.verdict != "fail" else [_said(check.of, check.value, check.uncertainty, check.tolerance)]
            cases.append((f"cylinder {entry.id} {entry.name}", check.of, "out of tolerance", said))
    return cases


def _said(of: str, value: float | None, uncertainty: float | None, tolerance: float | None) -> str:
    if value is None or uncertainty is None or tolerance is None:
        return "was not found"
    return f"{of} {number(value, 6)} ± {number(uncertainty, 2)} is above {number(tolerance, 6)}"


def page(content: Deviations, compared: Comparison) -> str:
    """Return the report: the cloud and the cylinders found in 3-D, unrolled maps, and the tables."""
    import numpy as np

    from cylx.config import load_config
    from cylx.records import Extraction
    from cylx.report.page import page_of
    from cylx.report.page_data import page_data_of
    from cylx.scene import measure_scene, resolve

    cloud, found = compared.cloud, compared.deviations
    number_of = np.full(len(found) + 1, -1, np.int32)  # the last is that of no label
    present = [k for k, one in enumerate(found) if one.measured is not None]
    number_of[present] = np.arange(len(present))
    fits = tuple(one.measured.fit for one in found if one.measured is not None)
    scene = measure_scene(cloud.points, 0)
    missing = [f"cylinder {e.id}, {e.name}: not found, {e.fault}" for e in content.cylinders if e.fault is not None]
    extraction = Extraction(
        cylinders=fits, labels=number_of[compared.labels], residuals=compared.residuals.astype(np.float32),
        cloud=cloud, scene=scene, stages=(), config=resolve(load_config(), scene), warnings=tuple(missing),
    )  # fmt: skip
    data = page_data_of(extraction)
    data["tables"] = [
        {"title": f"Deviations ({content.verdict})", "heads": list(_HEADER), "lines": _rows(content)},
        {"title": "Checks", "heads": ["id", "of", "value", "uncertainty", "tolerance", "verdict"], "lines": [
            [str(entry.id), one.of, *(_text(getattr(one, name)) for name in ("value", "uncertainty", "tolerance")),
             one.verdict]
            for entry in content.cylinders for one in entry.checks
        ]},
        {"title": "Dents and bulges", "heads": ["id", "kind", "depth", "area", "around", "along", "middle"], "lines": [
            [str(entry.id), one.kind, *(_text(getattr(one, name)) for name in ("depth", "area", "around", "along")),
             ", ".join(f"{x:.3f}" for x in one.place)]
            for entry in content.cylinders for one in entry.patches
        ]},
    ]  # fmt: skip
    return page_of(data)


def _text(value: float | None) -> str:
    return "-" if value is None else number(value, 4)


def _show(content: Deviations) -> None:
    """Print a row for each cylinder, and a line for each check that is not passed."""
    from cylx.cli.terminal.display import show_table

    show_table(list(_HEADER), _rows(content))
    for entry in content.cylinders:
        if entry.fault is not None:
            tell(f"cylx: cylinder {entry.id}, {entry.name}: not found, {entry.fault}")
        for one in entry.checks:
            if one.verdict != "pass" and one.of != "found":
                said = f"{_text(one.value)} ± {number(one.uncertainty or 0.0, 2)}, allowed {_text(one.tolerance)}"
                tell(f"cylx: cylinder {entry.id}, {entry.name}: {one.of} {one.verdict}: {said}")


def _rows(content: Deviations) -> list[list[str]]:
    return [_row(entry) for entry in content.cylinders]


def _row(entry: Any) -> list[str]:  # noqa: ANN401  a DeviationEntry
    """Format the row of a cylinder."""
    head = [str(entry.id), entry.name, str(entry.points)]
    built, off, form = entry.built, entry.difference, entry.form
    if built is None or off is None:
        return [*head, *["-"] * 7, entry.verdict]
    patches = ", ".join(f"{one.kind} {number(one.depth, 3)}" for one in entry.patches[:2])
    more = len(entry.patches) - 2
    return [
        *head,
        f"{built.coverage_deg:.0f}°",
        number(off.offset, 3),
        f"{number(off.tilt_deg, 3)}°",
        f"{off.radius:+.3g}",
        "-" if form is None else number(form.cylindricity, 3),
        "-" if form is None or form.ovality is None else number(form.ovality, 3),
        (f"{patches} and {more} more" if more > 0 else patches) or "none",
        entry.verdict,
    ]
