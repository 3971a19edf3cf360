"""The program as a whole: help, version, start-up, and what becomes of failures."""

import os
import subprocess
import sys
from pathlib import Path

import click
import pytest
from click.testing import CliRunner

import cylx
from cylx.cli.options.configuration import debug_option
from cylx.cli.terminal import failures
from cylx.cli.terminal.group import LazyGroup
from cylx.errors import BatchError, ConfigError, InputError, NothingFoundError, OutputError, UsageError

COMMANDS = [
    "extract",
    "runs",
    "stems",
    "view",
    "info",
    "config",
    "synth",
    "evaluate",
    "check",
    "diff",
    "deviation",
    "export",
    "doctor",
    "warmup",
    "reproduce",
]
LEAVES = [
    *(["extract"], ["info"], ["evaluate"], ["check"], ["diff"], ["deviation"], ["export"], ["doctor"], ["warmup"]),
    *(["config", name] for name in ("init", "show", "check", "schema")),
    *(["synth", name] for name in ("single", "multi")),
]
HEAVY = {"numba", "numpy", "open3d", "plyfile", "pydantic", "rich", "scipy", "yaml"}


def failing(failure):
    """A program whose only command fails."""

    class Program(LazyGroup):
        def get_command(self, ctx, cmd_name):
            return fail

    @click.command("fail")
    @debug_option
    def fail():
        raise failure

    return Program("cylx", homes={"fail": "nowhere"})


@pytest.mark.parametrize("flag", ["-h", "--help"])
def test_help_lists_the_commands(run_cylx, flag):
    shown = run_cylx(flag)
    assert shown.exit_code == 0
    listed = shown.stdout.partition("Commands:\n")[2].splitlines()
    assert [line.split()[0] for line in listed] == COMMANDS


def test_without_a_command_the_help_is_shown(run_cylx):
    shown = run_cylx()
    assert "Commands:" in shown.stdout + shown.stderr


@pytest.mark.parametrize("command", [[], ["config"], ["synth"], *LEAVES], ids=" ".join)
def test_help_leads_with_two_examples(run_cylx, command):
    shown = run_cylx(*command, "--help")
    assert shown.exit_code == 0
    usage, examples, rest = shown.stdout.split("\n\n", 2)
    assert usage.startswith(f"Usage: {' '.join(['cylx', *command])} ")
    title, *lines = examples.splitlines()
    assert title == "Examples:"
    assert len(lines) == 2
    assert all(line.startswith(f"  {' '.join(['cylx', *command])}") for line in lines)
    assert "-h, --help" in rest


@pytest.mark.parametrize("command", LEAVES, ids=" ".join)
def test_every_command_can_show_its_traceback(run_cylx, command):
    assert "--debug" in run_cylx(*command, "--help").stdout


def test_version(run_cylx):
    shown = run_cylx("--version")
    assert (shown.exit_code, shown.stdout, shown.stderr) == (0, f"cylx {cylx.__version__}\n", "")


def test_it_runs_as_a_module():
    shown = subprocess.run([sys.executable, "-m", "cylx", "--version"], capture_output=True, check=True, text=True)
    assert shown.stdout == f"cylx {cylx.__version__}\n"


@pytest.mark.parametrize("args", [["--help"], ["extract", "--help"], ["synth", "multi", "--help"], ["--version"]])
def test_help_imports_nothing_heavy(spawn_cylx, args):
    report = "import atexit, sys; atexit.register(lambda: print(*sys.modules, file=sys.stderr))"
    shown = spawn_cylx(*args, prelude=report)
    assert shown.returncode == 0
    loaded = {name.partition(".")[0] for name in shown.stderr.decode().split()}
    assert "click" in loaded
    assert loaded & HEAVY == set()


def test_extracting_imports_only_what_it_needs(spawn_cylx, scan, tmp_path):
    prelude = (
        "import atexit, sys, cylx.api.warmup as warmup; warmup.kernels_are_cold = lambda: False;"
        "atexit.register(lambda: print(*sys.modules, file=sys.stderr))"
    )
    shown = spawn_cylx("extract", scan, "-o", tmp_path / "found.json", "--quiet", prelude=prelude)
    assert shown.returncode == 0
    loaded = set(shown.stderr.decode().split())
    assert "numba" in loaded
    assert loaded & {"cylx.baselines", "cylx.experiments", "matplotlib", "open3d", "scipy.spatial"} == set()


def test_importing_cylx_imports_nothing_heavy():
    code = "import cylx, sys; print(*sys.modules)"
    shown = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True, text=True)
    assert {name.partition(".")[0] for name in shown.stdout.split()} & HEAVY == set()


@pytest.mark.parametrize("name", cylx.__all__)
def test_public_names_resolve(name):
    assert getattr(cylx, name) is not None
    assert name in dir(cylx)


def test_other_names_do_not():
    with pytest.raises(AttributeError, match="module 'cylx' has no attribute 'nonsense'"):
        _ = cylx.nonsense


@pytest.mark.parametrize(
    ("args", "line"),
    [
        (["extrct"], "no such command 'extrct'; did you mean 'extract'?; see 'cylx --help'"),
        (["zzz"], "no such command 'zzz'; see 'cylx --help'"),
        (["extract"], "Missing argument 'SCAN...'; see 'cylx extract --help'"),
        (["info", "a", "b"], "Got unexpected extra argument (b); see 'cylx info --help'"),
        (["extract", "a", "--threads", "0"], "Invalid value for '--threads': 0 is not in the range x>=1"),
        (["extract", "a", "--preset", "best"], "Invalid value for '--preset': 'best' is not one of 'auto', 'paper'"),
        (["--nonsense"], "No such option"),
        (["diff", "a"], "Missing argument 'B'; see 'cylx diff --help'"),
    ],
)
def test_a_usage_error_is_one_line(run_cylx, args, line):
    failed = run_cylx(*args)
    assert failed.exit_code == 2
    assert failed.stdout == ""
    assert failed.stderr.startswith(f"cylx: {line}")
    assert len(failed.stderr.splitlines()) == 1


@pytest.mark.parametrize(
    ("failure", "code", "line"),
    [
        (UsageError("-o", "is odd", "leave it out"), 2, "cylx: -o: is odd; leave it out"),
        (ConfigError("my.yaml: a\nb", "unknown key", "c"), 2, "cylx: my.yaml: a\\nb: unknown key; c"),
        (InputError("s.ply", "is empty", "give points"), 3, "cylx: s.ply: is empty; give points"),
        (OutputError("s.json", "exists", "give --overwrite"), 4, "cylx: s.json: exists; give --overwrite"),
        (NothingFoundError("s.ply", "0 found", "look at it"), 5, "cylx: s.ply: 0 found; look at it"),
        (BatchError("1 of 2", "failed", "see above"), 6, "cylx: 1 of 2: failed; see above"),
        (InputError("\x1b[31m\x07.ply", "is odd", "rename it"), 3, "cylx: \\x1b[31m\\x07.ply: is odd; rename it"),
        (KeyboardInterrupt(), 130, "cylx: interrupted"),
        (MemoryError(), 3, "cylx: out of memory; thin the scan, or cut it into parts"),
        (
            ValueError("two\nlines"),
            1,
            "cylx: this is a bug of cylx: ValueError: two lines; run it again with --debug for the traceback to report",
        ),
    ],
    ids=lambda value: type(value).__name__ if isinstance(value, BaseException) else None,
)
def test_a_failure_is_one_line_and_its_exit_code(failure, code, line):
    failed = CliRunner().invoke(failing(failure), ["fail"])
    assert (failed.exit_code, failed.stderr) == (code, f"{line}\n")
    debugged = CliRunner().invoke(failing(failure), ["fail", "--debug"])
    assert debugged.exit_code == code
    first, *_, last = debugged.stderr.splitlines()
    assert (first, last) == ("Traceback (most recent call last):", line)


def test_debug_may_come_before_the_command(run_cylx, tmp_path):
    for args in (["--debug", "info", tmp_path / "none.ply"], ["info", "--debug", tmp_path / "none.ply"]):
        assert run_cylx(*args).stderr.startswith("Traceback (most recent call last):\n")


@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "utf-8"])
def test_a_name_that_cannot_be_printed_is_no_failure(spawn_cylx, tmp_path, encoding):
    path = tmp_path / os.fsdecode("\N{SNOWMAN}".encode() + (b"\xff" if sys.platform == "linux" else b""))
    path.write_text("seed: 1")
    done = spawn_cylx("config", "check", path, env={**os.environ, "PYTHONIOENCODING": encoding})
    assert (done.returncode, done.stderr) == (0, b"")
    assert done.stdout.endswith(b": valid, preset auto\n")


def test_a_shell_can_complete_commands(spawn_cylx):
    shown = spawn_cylx(env={**os.environ, "_CYLX_COMPLETE": "bash_complete", "COMP_WORDS": "cylx e", "COMP_CWORD": "1"})
    assert shown.stdout.split() == [b"plain,extract", b"plain,evaluate", b"plain,export"]


def test_a_reader_that_went_away_is_no_news():
    failed = CliRunner().invoke(failing(BrokenPipeError()), ["fail"])
    assert (failed.exit_code, failed.output) == (141, "")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="only Linux has a device that is always full")
@pytest.mark.parametrize("args", [["config", "schema"], ["--version"], ["extract", "--help"]], ids=" ".join)
def test_a_full_disk_behind_standard_output_is_named(args):
    command = [sys.executable, "-m", "cylx", *args]
    with Path("/dev/full").open("wb") as full:
        failed = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, check=False)
    line = b"cylx: standard output: cannot be written: No space left on device; free some space, or write to a file\n"
    assert (failed.returncode, failed.stderr) == (4, line)


@pytest.mark.skipif(os.name == "nt", reason="Windows has no broken pipes")
def test_a_closed_pipe_ends_quietly():
    reader, writer = os.pipe()
    os.close(reader)
    failed = subprocess.run(
        [sys.executable, "-m", "cylx", "config", "schema"], stdout=writer, stderr=subprocess.PIPE, check=False
    )
    os.close(writer)
    assert (failed.returncode, failed.stderr) == (failures.READER_GONE, b"")


@pytest.mark.skipif(os.name == "nt", reason="Windows cannot close standard output")
def test_a_closed_standard_output_is_named():
    command = f'"{sys.executable}" -m cylx config schema >&-'
    failed = subprocess.run(["/bin/sh", "-c", command], stderr=subprocess.PIPE, check=False)
    line = b"cylx: standard output: is closed; open it, or write to a file\n"
    assert (failed.returncode, failed.stderr) == (4, line)


def test_standard_error_that_is_closed_does_not_hide_the_exit_code(spawn_cylx, tmp_path):
    failed = spawn_cylx("info", tmp_path / "none.ply", prelude="import os; os.close(2)")
    assert failed.returncode == 3
