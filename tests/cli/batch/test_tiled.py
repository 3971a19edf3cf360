"""How a cloud is cut: by the memory that is given, and not by who works on it."""

import pytest

from cylx.cli.batch.tile_workers import processes_for
from cylx.cli.batch.tiled import options_of
from cylx.cli.options.tiles import TileOptions
from cylx.errors import UsageError


def test_tiles_do_not_depend_on_the_number_of_processes():
    for memory in (None, 2_000_000_000, 64_000_000_000):
        sizes = {options_of(TileOptions(0.0, memory=memory), jobs, None).memory for jobs in (None, 1, 2, 16)}
        assert len(sizes) == 1
    assert processes_for(TileOptions(0.0, memory=2_000_000_000), 16, 8e8) == 2
    assert processes_for(TileOptions(0.0), 16, 1e9) == 16
    with pytest.raises(UsageError, match=r"^--memory: 0\.5 GB are too little; give at least 0\.77 GB$"):
        options_of(TileOptions(0.0, memory=500_000_000), None, None)
