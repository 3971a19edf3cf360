"""Every kind of damage to a kept kernel; `python -m tests.faults.kernel_files` lets the command line meet them."""

import pytest

from cylx.geometry.kernels import _MAGIC, _body, _content
from tests.faults.kernel_files import CHANGES, with_body

CODE = b"the code\n" * 1000
WHOLE = with_body(CODE)
KNOWN = {"whole, of another key", "whole, of another stamp", "whole, without code"}
"""Changes of what is within, which only a real file has."""


def test_what_is_whole_is_read(tmp_path):
    (tmp_path / "kernel").write_bytes(WHOLE)
    assert WHOLE.startswith(_MAGIC)
    assert _body(tmp_path / "kernel") == CODE


@pytest.mark.parametrize("name", [name for name in CHANGES if name not in KNOWN])
def test_what_is_damaged_counts_as_missing_or_fails_where_that_is_caught(tmp_path, name):
    (tmp_path / "kernel").write_bytes(CHANGES[name](WHOLE))
    if name.startswith("whole"):
        with pytest.raises(Exception, match=r".+"):
            _content(tmp_path / "kernel", (b"", ""))
    else:
        assert _body(tmp_path / "kernel") is None
