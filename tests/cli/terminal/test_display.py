"""What is shown on a terminal while scans are counted."""

import os

import pytest

from cylx.cli.terminal.display import Messages
from tests.support.terminals import on_a_terminal


@pytest.mark.skipif(os.name == "nt", reason="Windows has no pseudo-terminals")
def test_progress_is_shown_on_a_terminal(monkeypatch):
    monkeypatch.setenv("TERM", "xterm")

    def show(messages):
        with messages.counting(5) as advance:
            advance()
            messages.say("a line in between")

    shown = on_a_terminal(lambda: show(Messages()))
    assert "1/5" in shown
    assert "a line in between" in shown
    assert "1/5" not in on_a_terminal(lambda: show(Messages(quiet=True)))
