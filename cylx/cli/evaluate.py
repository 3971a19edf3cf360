"""`cylx evaluate`: compare a result with the truth."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

import click

from cylx.cli.options.configuration import complete_files, debug_option, json_option
from cylx.cli.options.numbers import NumberRange
from cylx.cli.terminal.failures import answer, called_by_file, tell
from cylx.cli.terminal.group import ExampleCommand

if TYPE_CHECKING:
    from cylx.evaluation import Evaluation, KindScore, RunScore

_SHARE = NumberRange(0, 1)
_ERROR = NumberRange(min=0)


@click.command(
    cls=ExampleCommand,
    examples=[
        "cylx evaluate room.cylinders.json room.truth.json",
        "cylx evaluate room.cylinders.json room.truth.json --min-f1 0.99 --max-angle 0.1",
    ],
)
@click.argument("result", shell_complete=complete_files)
@click.argument("truth", shell_complete=complete_files)
@click.option("--angle", "angle_deg", type=float, default=5.0, show_default=True, help="Limit of a match, degrees.")
@click.option("--offset", type=float, default=0.25, show_default=True, help="Limit of a match, in radii.")
@click.option("--radius", type=float, default=0.15, show_default=True, help="Limit of a match, relative radius.")
@click.option("--min-f1", type=_SHARE, metavar="BAR", help="Exit with 1 if F1 is below.")
@click.option("--min-precision", type=_SHARE, metavar="BAR", help="Exit with 1 if the precision is below.")
@click.option("--min-recall", type=_SHARE, metavar="BAR", help="Exit with 1 if the recall is below.")
@click.option("--max-angle", type=_ERROR, metavar="BAR", help="Exit with 1 if any match is off by more, degrees.")
@click.option("--max-offset", type=_ERROR, metavar="BAR", help="Exit with 1 if any match is off by more, in radii.")
@click.option(
    "--max-radius-error", type=_ERROR, metavar="BAR", help="Exit with 1 if any match is off by more, relative."
)
@json_option
@debug_option
def evaluate(
    *, result: str, truth: str, angle_deg: float, offset: float, radius: float, as_json: bool, **bars: float | None
) -> None:
    """Compare the cylinders of RESULT with those of TRUTH, and fittings and runs if both have them.

    Both are JSON files; 'cylx synth' writes the truth of its scenes. Cylinders are matched one to one if angle, offset
    and radius are within their limits, fittings if kind, place and radius agree. Without a BAR option the exit code is
    0 whatever the result.
    """
    from cylx import evaluation
    from cylx.io import read_json

    documents = read_json(truth), read_json(result)
    with called_by_file({"truth": truth, "result": result}):
        outcome = evaluation.evaluate(*documents, angle_deg=angle_deg, offset=offset, radius=radius)
    missed = list(missed_bars(outcome, bars))
    if as_json:
        answer(json.dumps({**outcome.to_dict(), "bars_missed": missed}, indent=2) + "\n", as_json=True)
    else:
        answer(as_text(outcome))
    for line in missed:
        tell(f"cylx: {line}")
    if missed:
        raise click.exceptions.Exit(1)


def missed_bars(outcome: Evaluation, bars: Mapping[str, float | None]) -> Iterator[str]:
    """Yield a message for each bar that is missed; without any match the errors are unknown, which counts as a miss.

    Parameters
    ----------
    outcome : Evaluation
        The evaluation.
    bars : mapping of str to float or None
        `min_f1`, `min_precision`, `min_recall`, `max_angle`, `max_offset`, `max_radius_error`.
    """
    for name, value in (("f1", outcome.f1), ("precision", outcome.precision), ("recall", outcome.recall)):
        bar = bars.get(f"min_{name}")
        if bar is not None and value < bar:
            yield f"{name} {value:.6g} is below --min-{name} {bar:g}"
    errors = {"angle": outcome.angle_deg, "offset": outcome.offset, "radius-error": outcome.radius}
    for name, spread in errors.items():
        bar = bars.get(f"max_{name.replace('-', '_')}")
        if bar is None:
            continue
        if spread is not None and spread.max > bar:
            yield f"{name} {spread.max:.6g} is above --max-{name} {bar:g}"
        elif spread is None and outcome.truth:
            yield f"{name} is unknown, as nothing was matched, and --max-{name} {bar:g} needs it"


def as_text(outcome: Evaluation) -> str:
    """Format an evaluation as text."""
    counts = (
        f"truth {outcome.truth}, found {outcome.predicted}, matched {outcome.matched}, duplicates {outcome.duplicates},"
        f" ignored {outcome.ignored}"
    )
    lines = [
        counts + (f", unusable {outcome.unusable}" if outcome.unusable else ""),
        f"precision {outcome.precision:.4f}, recall {outcome.recall:.4f}, F1 {outcome.f1:.4f}",
    ]
    for name, unit, spread in (
        ("angle", "°", outcome.angle_deg),
        ("offset", " r", outcome.offset),
        ("radius", " r", outcome.radius),
    ):
        if spread is not None:
            values = (f"{label} {value:.3g}{unit}" for label, value in _statistics(spread))
            lines.append(f"{name:<9} {', '.join(values)}")
    lines += [f"missed    {', '.join(map(str, outcome.missed))}"] if outcome.missed else []
    lines += [f"false     {', '.join(map(str, outcome.false))}"] if outcome.false else []
    lines += [*_fitting_lines(outcome), *_run_lines(outcome)]
    return "\n".join(lines) + "\n"


def _fitting_lines(outcome: Evaluation) -> Iterator[str]:
    """Yield a line for each kind of fitting, and one for the measures of the elbows."""
    if outcome.fittings is None:
        return
    for kind, score in outcome.fittings.kinds.items():
        counts = f"truth {score.truth}, found {score.predicted}, matched {score.matched}, ignored {score.ignored}"
        yield f"{kind:<9} {counts}, {_rates(score)}"
    bend, angle = outcome.fittings.bend_radius, outcome.fittings.angle_deg
    if bend is not None and angle is not None and outcome.fittings.good_elbows is not None:
        off = f"bend radius median {bend.median:.3g}, max {bend.max:.3g}"
        turned = f"angle median {angle.median:.3g}°, max {angle.max:.3g}°"
        yield f"elbows    {off}, {turned}, within 5 % and 1° {outcome.fittings.good_elbows:.4f}"


def _run_lines(outcome: Evaluation) -> Iterator[str]:
    """Yield a line about the pairs of straights in one run."""
    if outcome.runs is not None:
        score = outcome.runs
        pairs = f"pairs {score.pairs_truth}, found {score.pairs_predicted}, matched {score.pairs_matched}"
        yield f"runs      truth {score.truth}, found {score.predicted}, {pairs}, {_rates(score)}"


def _rates(score: KindScore | RunScore) -> str:
    return f"precision {score.precision:.4f}, recall {score.recall:.4f}, F1 {score.f1:.4f}"


def _statistics(spread: object) -> list[tuple[str, float]]:
    """Return the statistics of an error with their labels."""
    return [(name, getattr(spread, name)) for name in ("median", "mean", "max")]
