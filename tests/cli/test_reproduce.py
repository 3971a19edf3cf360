"""`cylx reproduce`: tables, pictures, what is gone on with, exit codes."""

import json
import sys
from multiprocessing import util

import numpy as np
import pytest

from cylx.cli.options.configuration import METHODS
from cylx.cli.reproduce import NUMBERS
from cylx.experiments import FIGURES, Key, Outcome, header_line, parse_trials, trial_lines
from cylx.experiments.figures import CURVES

VERTICES = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n"
HEADER = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"


@pytest.fixture
def small(monkeypatch):
    """Figure 7 with two cheap cells, figure 11 with one; give the cells of figure 7."""
    chosen = [cell for cell in FIGURES[7].cells if cell.x == 0.01 and cell.method in {"line-fit", "jin"}]
    cells = tuple(cell._replace(scene=tuple({**dict(cell.scene), "points": 1500}.items())) for cell in chosen)
    cans = tuple(cell for cell in FIGURES[11].cells if cell.method == "jin")[:1]
    monkeypatch.setitem(FIGURES, 7, FIGURES[7]._replace(cells=cells))
    monkeypatch.setitem(FIGURES, 11, FIGURES[11]._replace(cells=cans))
    return cells


@pytest.fixture
def at_once(monkeypatch):
    """Let trials cost nothing; the list has what was run."""
    run = []

    def answer(tasks, jobs, scan):
        assert sys.version_info >= (3, 11) or "-I" in util._args_from_interpreter_flags()  # no modules of the folder
        for task in tasks:
            key = Key.of(task.cell, task.trial)
            run.append((key, jobs, scan))
            yield key, Outcome(1, 0.5 + task.trial, 0.25, 1.5, 0.125)

    monkeypatch.setattr("cylx.experiments.run_tasks", answer)
    return run


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def without_seconds(path):
    return [(key, outcome[:4]) for key, outcome in parse_trials(path.read_text()).items()]


def test_trials_run_in_processes_and_go_on_where_they_were(run_cylx, tmp_path, small):
    done = run_cylx("reproduce", 7, "--trials", 1, "--jobs", 1, "--out", tmp_path / "a" / "b")
    assert done.exit_code == 0
    table, picture = (tmp_path / "a" / "b" / f"figure-7.{suffix}" for suffix in ("csv", "png"))
    assert names(tmp_path / "a" / "b") == [table.name, picture.name]
    assert picture.read_bytes().startswith(b"\x89PNG")
    trials = parse_trials(table.read_text())
    assert list(trials) == sorted(Key.of(cell, 0) for cell in small)
    assert all(outcome.found == 1 and np.isfinite(outcome).all() for outcome in trials.values())
    # another process with two of them comes to the same, and to what it was before where that is there
    lines = table.read_text().splitlines()
    half = tmp_path / "half"
    half.mkdir()
    (half / "figure-7.csv").write_text("\n".join(lines[:2]) + "\n")
    again = run_cylx("reproduce", 7, "--trials", 1, "--jobs", 2, "--out", half)
    assert again.exit_code == 0
    assert "figure 7: 1 trials run" in again.stderr
    assert (half / "figure-7.csv").read_text().splitlines()[:2] == lines[:2]
    assert without_seconds(half / "figure-7.csv") == without_seconds(table)


def test_the_table_and_the_conversation(run_cylx, tmp_path, small, at_once):
    done = run_cylx("reproduce", 7, "--trials", 3, "--jobs", 2, "--out", tmp_path)
    assert done.exit_code == 0
    assert [(key, jobs, scan) for key, jobs, scan in at_once] == [
        (Key.of(cell, trial), 2, None) for trial in range(3) for cell in small
    ]
    files = f"{tmp_path / 'figure-7.csv'} and {tmp_path / 'figure-7.png'}"
    assert done.stderr == f"figure 7: 6 trials run, written to {files}\n"
    title, *table = done.stdout.splitlines()
    assert title == "figure 7: Gaussian noise, mean ± standard error"
    rows = [line.split() for line in table]
    # mean of 0.5, 1.5 and 2.5, and 1 / sqrt(3)
    assert [row[:7] for row in rows if row and row[0] in {"jin", "line-fit"}] == [
        [cell.curve, "0.01", "3", "1.00", "1.5", "±", "0.6"] for cell in small
    ]


def test_json_has_the_means(run_cylx, tmp_path, small, at_once):
    done = run_cylx("reproduce", 7, "--trials", 3, "--jobs", 2, "--out", tmp_path, "--json")
    (figure,) = json.loads(done.stdout)["figures"]
    assert (done.exit_code, figure["figure"]) == (0, 7)
    assert [(cell["panel"], cell["curve"], cell["x"]) for cell in figure["cells"]] == [
        (cell.panel, cell.curve, cell.x) for cell in small
    ]
    for cell in figure["cells"]:
        assert (cell["trials"], cell["found"], cell["means"]["angle_deg"]) == (3, 1, 1.5)
        assert cell["means"].keys() == cell["standard_errors"].keys() > cell["bounds"].keys()
        assert cell["bounds"]["angle_deg"] > 0


def test_what_is_there_is_not_run_again_and_stays_byte_by_byte(run_cylx, tmp_path, small, at_once):
    assert run_cylx("reproduce", 7, "--trials", 2, "--out", tmp_path).exit_code == 0
    before = (tmp_path / "figure-7.csv").read_bytes()
    at_once.clear()
    again = run_cylx("reproduce", 7, "--trials", 2, "--out", tmp_path)
    assert (again.exit_code, at_once) == (0, [])
    assert "figure 7: 0 trials run" in again.stderr
    assert (tmp_path / "figure-7.csv").read_bytes() == before
    # fewer trials are shown, and none is lost
    fewer = run_cylx("reproduce", 7, "--trials", 1, "--out", tmp_path)
    assert [line.split()[2] for line in fewer.stdout.splitlines() if line.split()[:1] == ["jin"]] == ["1"]
    assert (tmp_path / "figure-7.csv").read_bytes() == before
    # more go on
    run_cylx("reproduce", 7, "--trials", 3, "--out", tmp_path)
    assert [key.trial for key, _, _ in at_once] == [2, 2]
    assert len(parse_trials((tmp_path / "figure-7.csv").read_text())) == 3 * len(small)


def test_quiet_says_just_the_table(run_cylx, tmp_path, small, at_once):
    done = run_cylx("reproduce", 7, "-q", "--trials", 1, "--out", tmp_path)
    assert (done.exit_code, done.stderr) == (0, "")
    assert "jin" in done.stdout


def test_what_was_done_is_saved_when_it_is_interrupted(run_cylx, tmp_path, small, monkeypatch):
    def interrupted(tasks, *_):
        yield Key.of(tasks[0].cell, tasks[0].trial), Outcome(1, 0.5, 0.25, 1.5, 0.125)
        raise KeyboardInterrupt

    monkeypatch.setattr("cylx.experiments.run_tasks", interrupted)
    done = run_cylx("reproduce", 7, "--trials", 5, "--out", tmp_path)
    assert (done.exit_code, done.stderr.splitlines()[-1]) == (130, "cylx: interrupted")
    assert list(parse_trials((tmp_path / "figure-7.csv").read_text())) == [Key.of(small[0], 0)]
    assert names(tmp_path) == ["figure-7.csv"]


def test_curves_leave_the_others_out(run_cylx, tmp_path, small, at_once):
    other = {Key("", "auto", 0.01, 0): Outcome(1, 1.0, 1.0, 1.0, 1.0)}
    (tmp_path / "figure-7.csv").write_text(header_line() + trial_lines(other.items()))
    done = run_cylx("reproduce", 7, "--trials", 1, "--curves", " jin ", "--out", tmp_path)
    assert done.exit_code == 0
    assert [key.curve for key, _, _ in at_once] == ["jin"]
    assert set(parse_trials((tmp_path / "figure-7.csv").read_text())) == {*other, Key("", "jin", 0.01, 0)}


def test_the_scan_is_for_figures_that_need_one(run_cylx, tmp_path, small, at_once):
    can = tmp_path / "can.xyz"
    can.write_text(VERTICES)
    out = tmp_path / "out"
    done = run_cylx("reproduce", 11, 7, 7, "--trials", 1, "--data", can, "--out", out)
    assert done.exit_code == 0
    assert [(key.curve, scan is None) for key, _, scan in at_once] == [
        *((cell.curve, True) for cell in small),
        ("jin", False),
    ]
    assert at_once[-1][2].points.shape == (4, 3)
    assert names(out) == ["figure-11.csv", "figure-11.png", "figure-7.csv", "figure-7.png"]


@pytest.mark.parametrize(
    ("args", "fault"),
    [
        (
            [7, "--curves", "gt,msca"],
            "--curves gt,msca: 'msca' is not a method; the methods are gt, msac, line-fit, tran, ",
        ),
        ([7, "--curves", ""], "--curves : '' is not a method"),
        ([11, "--curves", "gt", "--data", "can.xyz"], "--curves gt: figure 11 has none of them; leave --curves out"),
        ([11], "--data: figure 11 needs the scan of a can; give one by --data FILE"),
        ([7, 11, 12], "--data: figures 11 and 12 need the scan of a can; give one by --data FILE"),
        (["all"], "--data: figures 11 and 12 need the scan of a can; give one by --data FILE"),
        ([13], "Invalid value for 'FIGURE...': '13' is not one of "),
        ([], "Missing argument 'FIGURE...'"),
        ([7, "--trials", 0], "Invalid value for '--trials'"),
        ([7, "--jobs", 0], "Invalid value for '--jobs'"),
    ],
)
def test_what_cannot_be_meant_is_refused(run_cylx, tmp_path, small, at_once, args, fault):
    failed = run_cylx("reproduce", *args, "--out", tmp_path / "out")
    (line,) = failed.stderr.splitlines()
    assert (failed.exit_code, at_once) == (2, [])
    assert line.startswith(f"cylx: {fault}")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("content", "fault"),
    [
        (None, ": no such file"),
        (b"", ": is empty"),
        (b"solid can\n", ": is not PLY"),
        (
            f"{HEADER}element face 1\nproperty list uchar int vertex_index\nend_header\n{VERTICES}3 0 1 9\n".encode(),
            ": has faces that refer to missing points; save the mesh again",
        ),
    ],
)
def test_a_scan_that_cannot_be_used_is_refused(run_cylx, tmp_path, small, at_once, content, fault):
    data = tmp_path / "can.ply"
    if content is not None:
        data.write_bytes(content)
    failed = run_cylx("reproduce", 11, "--data", data, "--out", tmp_path / "out")
    (line,) = failed.stderr.splitlines()
    assert (failed.exit_code, at_once) == (3, [])
    assert line.startswith(f"cylx: {data}{fault}")
    assert not (tmp_path / "out").exists()


def test_a_folder_that_cannot_be_made_is_refused(run_cylx, tmp_path, small, at_once):
    (tmp_path / "file").write_text("precious")
    for out in (tmp_path / "file", tmp_path / "file" / "below"):
        failed = run_cylx("reproduce", 7, "--out", out)
        (line,) = failed.stderr.splitlines()
        assert (failed.exit_code, at_once) == (4, [])
        assert line.startswith(f"cylx: {out}: cannot be created: ")
    assert (tmp_path / "file").read_text() == "precious"


@pytest.mark.parametrize("content", [b"precious\n", b"\xff\xfe\0", b"a" * 200_000])
def test_a_foreign_table_stays(run_cylx, tmp_path, small, at_once, content):
    (tmp_path / "figure-7.csv").write_bytes(content)
    failed = run_cylx("reproduce", 7, "--out", tmp_path)
    line = f"cylx: {tmp_path / 'figure-7.csv'}: exists and is not a table of trials; give another folder by --out\n"
    assert (failed.exit_code, failed.stderr, at_once) == (4, line, [])
    assert (tmp_path / "figure-7.csv").read_bytes() == content
    assert names(tmp_path) == ["figure-7.csv"]


@pytest.mark.parametrize("name", ["figure-7.csv", "figure-7.png"])
def test_a_folder_in_the_place_of_a_file_is_refused(run_cylx, tmp_path, small, at_once, name):
    (tmp_path / name).mkdir()
    failed = run_cylx("reproduce", 7, "--out", tmp_path)
    assert (failed.exit_code, at_once, names(tmp_path)) == (4, [], [name])
    assert "is a folder" in failed.stderr


def test_without_matplotlib_nothing_is_run(run_cylx, tmp_path, small, at_once, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    failed = run_cylx("reproduce", 7, "--out", tmp_path)
    line = "cylx: the picture: matplotlib is not installed; pip install 'cylx[plots]'\n"
    assert (failed.exit_code, failed.stderr, at_once) == (2, line, [])
    assert names(tmp_path) == []


def test_names_at_the_command_line_are_those_of_the_library():
    assert [int(number) for number in NUMBERS] == list(FIGURES)
    assert set(CURVES) == {*METHODS, "auto"}
