"""The available memory, and the memory a scan will need."""

from __future__ import annotations

import math
import os
import re
from pathlib import Path

BASE, A_POINT = 250_000_000, 200
"""Peak memory of a run and per point, bytes; measured, see 'Growth' in docs/benchmarks.md."""
MEMINFO, CONTAINER = Path("/proc/meminfo"), Path("/sys/fs/cgroup")
"""Where Linux reports free memory and the limit of a container."""


def memory_needed(scan: str) -> int:
    """Estimate the peak memory of the extraction of a scan, bytes."""
    from cylx.io import expected_points

    return memory_for(expected_points(scan))


def memory_for(points: int) -> int:
    """Estimate the peak memory of an extraction of this many points, bytes."""
    return BASE + A_POINT * points


def free_memory() -> float | None:
    """Return the memory that programs can use without swapping, bytes; None if the system does not report it."""
    found = re.search(r"^MemAvailable:\s*(\d+) kB", _read(MEMINFO), re.MULTILINE)
    if found is None:
        return None
    return min(1024 * int(found[1]), _left_to_container())


def _left_to_container() -> float:
    """Return the memory left below the limit of a container, bytes; infinity without a limit. Cache counts as free."""
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
    """Return the resident memory of a process, bytes; 0 if the system does not report it."""
    try:
        pages = int(Path(f"/proc/{process}/statm").read_text(encoding="ascii").split()[1])
        return pages * os.sysconf("SC_PAGE_SIZE")
    except (OSError, ValueError, IndexError, AttributeError):
        return 0


def cores() -> int:
    """Return the number of cores that this process may use."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # not available on macOS and Windows
        return os.cpu_count() or 1
