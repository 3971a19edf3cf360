"""How much memory there is, and how much of it a scan will need."""

from __future__ import annotations

import math
import os
import re
from pathlib import Path

BASE, A_POINT = 250_000_000, 200
"""Peak memory of a run, bytes, and of each point in it; measured, see 'Growth' in docs/benchmarks.md."""
MEMINFO, CONTAINER = Path("/proc/meminfo"), Path("/sys/fs/cgroup")
"""Where Linux tells what is free, and what a container may have."""


def memory_needed(scan: str) -> int:
    """Estimate the peak memory of the extraction of a scan, bytes."""
    from cylx.io import expected_points

    return memory_for(expected_points(scan))


def memory_for(points: int) -> int:
    """Estimate the peak memory of the extraction of so many points, bytes."""
    return BASE + A_POINT * points


def memory_available() -> float | None:
    """Return the memory that programs can have without swapping, bytes; None where the system does not tell."""
    found = re.search(r"^MemAvailable:\s*(\d+) kB", _read(MEMINFO), re.MULTILINE)
    if found is None:
        return None
    return min(1024 * int(found[1]), _left_to_container())


def _left_to_container() -> float:
    """Return what the limit of a container leaves, bytes; infinity without one. What is only cached counts as free."""
    limit, used = _read(CONTAINER / "memory.max").strip(), _read(CONTAINER / "memory.current").strip()
    if not (limit.isdecimal() and used.isdecimal()):
        return math.inf
    cached = re.search(r"^inactive_file (\d+)", _read(CONTAINER / "memory.stat"), re.MULTILINE)
    return max(int(limit) - int(used) + (int(cached[1]) if cached else 0), 0)


def _read(path: Path) -> str:
    try:
        return path.read_text(encoding="ascii", errors="replace")
    except OSError:
        return ""


def memory_held(process: int) -> int:
    """Return the resident memory of a process, bytes; 0 where the system does not tell."""
    try:
        pages = int(Path(f"/proc/{process}/statm").read_text(encoding="ascii").split()[1])
        return pages * os.sysconf("SC_PAGE_SIZE")
    except (OSError, ValueError, IndexError, AttributeError):
        return 0


def cores() -> int:
    """Return the number of cores that this process may use."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # macOS and Windows do not tell
        return os.cpu_count() or 1
