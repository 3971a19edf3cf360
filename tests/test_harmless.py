"""Texts of others: what a terminal and a spreadsheet would act on, and what they show instead."""

import csv
import io
import json

import pytest

from cylx.cli.batch.summary import COLUMNS, table_text
from cylx.harmless import cell, visible
from cylx.results.parts import text_of

NASTY = "a\x1b]0;title\x07\u009b2J\u202egpj\u2066\r\n\tb\u2028\u200b\ud800\U000e0001"


def test_nothing_that_does_not_print_is_left():
    shown = visible(NASTY)
    assert shown.isprintable()
    assert json.loads(f'"{shown}"') == NASTY
    assert visible("Büro 大\u3000\u00a0ok") == "Büro 大\u3000\u00a0ok"
    assert visible("a\nb\r", keep="\n") == "a\nb\\u000d"


def test_a_json_file_means_the_same_and_holds_no_command_for_a_terminal():
    text = text_of({"file": NASTY})
    assert json.loads(text) == {"file": NASTY}
    assert text.replace("\n", "").isprintable()
    assert text_of({"file": "Büro"}) == '{\n  "file": "Büro"\n}\n'


@pytest.mark.parametrize(
    "text",
    [
        "=1+1.ply",
        "+cmd",
        "-cmd",
        "@sum",
        "\t=1",
        "\r=1",
        "\n=1",
        " =1",
        "\uff1d1",
        "\uff0ba",
        "\uff0da",
        "\uff20a",
        "-1+cmd",
    ],
)
def test_a_spreadsheet_runs_no_cell(text):
    assert cell(text)[0] == "'"
    assert visible(text, keep="\n") in cell(text)


@pytest.mark.parametrize("value", ["-3.5", "+1e-5", "-.5", -3.5, 7, None, True, "pipe-1", "a=b", "-", "a@b"])
def test_numbers_and_plain_texts_stay(value):
    assert cell(value) == value


def test_a_semicolon_begins_no_formula():
    assert cell("a;=1+1") == "a;'=1+1"


def test_the_table_of_many_scans_is_harmless():
    cylinder = {name: [0.0, 0.0, -1.0] for name in ("axis_point", "axis_direction", "start", "end")}
    cylinder |= {"id": 0, "radius": 1.0, "height": -0.0, "catalogue": {"name": "=cmd|' /C calc'!A0"}}
    text = table_text([('=1+1"\n.ply', {"cylinders": [cylinder]})])
    _, row = csv.reader(io.StringIO(text))
    found = dict(zip(COLUMNS, row, strict=True))
    assert found["file"] == "'=1+1\"\n.ply"
    assert found["catalogue_name"] == "'=cmd|' /C calc'!A0"
    assert found["axis_point_z"] == "-1.0"


def test_an_exported_table_is_harmless(tmp_path, make_extraction, run_cylx):
    from cylx.results import Result

    content = Result.of(make_extraction()).to_object()
    content["input"]["file"] = NASTY.replace("\ud800", "")
    for cylinder in content["cylinders"]:
        cylinder["evidence"] = {"=1+1": 0.5, "-plain": -1.0}
    (tmp_path / "r.json").write_text(json.dumps(content))
    done = run_cylx("export", tmp_path / "r.json", tmp_path / "r.csv")
    assert done.exit_code == 0, done.stderr
    header, *rows = csv.reader(io.StringIO((tmp_path / "r.csv").read_text()))
    assert not [name for name in header if name[0] in "=+-@"]
    assert rows[0][header.index("evidence_-plain")] == "-1.0"


def test_names_reach_the_terminal_escaped(tmp_path, monkeypatch, run_cylx):
    monkeypatch.chdir(tmp_path)
    name = "a\x1b]0;owned\x07\u009b31m\u202egpj.xyz"
    (tmp_path / name).write_text("".join(f"{x} {x * x % 7} {x % 3}\n" for x in range(40)))
    for options in ([], ["--json"]):
        shown = run_cylx("info", name, *options)
        assert shown.exit_code == 0
        for text in (shown.stdout, shown.stderr):
            assert text.replace("\n", "").isprintable()
    assert json.loads(shown.stdout)["file"] == name
