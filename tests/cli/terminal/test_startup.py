"""Numba starts without SciPy's linear algebra on the command line, and as ever elsewhere."""

import subprocess
import sys

from cylx.cli.terminal.startup import BLAS
from cylx.io import write_cloud
from cylx.synthetic import single
from tests.support.patience import PATIENCE


def told(program, *arguments):
    """Run a program in a process of its own; give what it printed last."""
    command = [sys.executable, "-c", program, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=True, timeout=PATIENCE).stdout.splitlines()[-1]


def test_the_command_line_does_without_linear_algebra(tmp_path):
    write_cloud(tmp_path / "scan.pcd", single(points=2000).points)
    program = (
        "import sys; from cylx.cli import main;"
        "main(['extract', sys.argv[1], '--out-dir', sys.argv[2], '--quiet'], standalone_mode=False);"
        "there = any(name.startswith('scipy.linalg') for name in sys.modules); import scipy.linalg;"
        f"print(there, 'scipy.linalg.cython_blas' in sys.modules, sys.modules.get('{BLAS}', 0) is None)"
    )
    assert (
        told(program, tmp_path / "scan.pcd", tmp_path) == "False True False"
    )  # importable as ever, once somebody wants it


def test_programs_that_import_cylx_keep_matrix_products_in_their_own_kernels():
    program = (
        "import cylx, numba, numpy as np; cylx.extract(np.random.default_rng(0).random((200, 3)));"
        "product = numba.njit(lambda a, b: a @ b); print(product(np.eye(2), 3.0 * np.eye(2))[1, 1])"
    )
    assert told(program) == "3.0"


def test_it_does_nothing_if_numba_is_there_already():
    program = (
        "import sys, numba.np.arraymath; from cylx.cli.terminal.startup import import_numba_without_blas as start;"
        f"start(); print(sys.modules.get('{BLAS}', 0) is not None)"
    )
    assert told(program) == "True"


def test_a_process_of_its_own_looks_for_no_garbage_and_no_plugins():
    program = (
        "import gc, os, sys; import cylx.__main__ as cylx;"
        "sys.argv = ['cylx', '--version'];"
        "before = gc.get_threshold(), gc.get_freeze_count(), os.environ.get('PYDANTIC_DISABLE_PLUGINS');\n"
        "try:\n    cylx.run()\nexcept SystemExit:\n    pass\n"
        "print(before[0] != gc.get_threshold(), before[1] == 0, gc.get_freeze_count() > 0,"
        " before[2], os.environ['PYDANTIC_DISABLE_PLUGINS'])"
    )
    assert told(program) == "True True True None __all__"


def test_a_program_that_imports_cylx_keeps_its_garbage_collector():
    program = "import gc; before = gc.get_threshold(); import cylx, cylx.cli; print(before == gc.get_threshold())"
    assert told(program) == "True"
