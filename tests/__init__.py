"""Tests of cylx, in folders like those of the package.

The folders are packages because several files have the same name (`cli/test_config.py`, `config/test_config.py`). Each
is imported by its full name, `tests.cli.test_config`, from the root of the checkout. So no folder of tests is put on
`sys.path`, where `tests/io` would hide `io`. `tests.conftest` is the module that pytest loaded, and workers of xdist
and the processes that tests start import everything by the same names. `--import-mode=importlib` would leave
`tests.support` to namespace packages, which not every version of pytest treats alike.
"""
