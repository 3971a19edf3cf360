"""The memory that the system and a container leave."""

import pytest

from cylx.cli.batch.memory import free_memory


@pytest.mark.parametrize(
    ("files", "available"),
    [
        ({}, None),
        ({"meminfo": "MemFree: 1 kB\nMemAvailable:   2000 kB\n"}, 2_048_000),
        ({"meminfo": "MemAvailable: 2000 kB\n", "memory.max": "max\n", "memory.current": "5\n"}, 2_048_000),
        ({"meminfo": "MemAvailable: 2000 kB\n", "memory.max": "900000\n", "memory.current": "500000\n"}, 400_000),
        (
            {
                "meminfo": "MemAvailable: 2000 kB\n",
                "memory.max": "900000\n",
                "memory.current": "500000\n",
                "memory.stat": "anon 7\ninactive_file 100000\n",
            },
            500_000,
        ),
    ],
)
def test_memory_is_what_the_system_and_the_container_leave(tmp_path, monkeypatch, files, available):
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    monkeypatch.setattr("cylx.cli.batch.memory.MEMINFO", tmp_path / "meminfo")
    monkeypatch.setattr("cylx.cli.batch.memory.CONTAINER", tmp_path)
    assert free_memory() == available
