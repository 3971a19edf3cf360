"""Random streams: one table says who draws with which number."""

from pathlib import Path

import numpy as np

import cylx
from cylx.records.streams import STREAMS, stream


def test_no_two_draw_the_same():
    assert len(set(STREAMS.values())) == len(STREAMS)
    first = {name: stream(0, name).random() for name in STREAMS}
    assert len(set(first.values())) == len(STREAMS)
    assert stream(0, "ellipses", 1).random() != stream(0, "ellipses", 2).random()


def test_a_stream_is_the_same_for_the_same_seed():
    assert stream(5, "planes").random() == stream(5, "planes").random() == np.random.default_rng([5, 2]).random()


def test_nobody_has_a_number_of_its_own():
    sources = {path: path.read_text(encoding="utf-8") for path in Path(cylx.__file__).parent.rglob("*.py")}
    assert [path.name for path, text in sources.items() if "default_rng([" in text] == ["streams.py"]
