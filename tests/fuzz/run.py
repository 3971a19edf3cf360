"""Fuzz the targets: `python -m tests.fuzz.run [--target NAME] [--seconds N | --inputs N] [--seed S]`."""

import argparse
import hashlib
import os
import random
import sys
import time
import traceback
import warnings
from collections import Counter
from pathlib import Path

from tests.fuzz.mutate import mutate
from tests.fuzz.targets import TARGETS

LONGEST = 1000
"""Letters of a message: some hundred."""
SLOWEST = 5.0
"""Seconds of processor time that an input of a few thousand bytes may take; the machine may be busy, ..."""
_WAITING = 60.0
"""... but not so that it takes these seconds for each of them."""
MOST_FILES = 20
"""Findings of one kind that are kept."""


def all_targets():
    """Return all targets, those of native code too if they can be imported."""
    try:
        from tests.fuzz.native import NATIVE_TARGETS
    except ImportError:
        return TARGETS
    return {**TARGETS, **NATIVE_TARGETS}


def judge(function, data, *, slowest=SLOWEST):
    """Return `success`, `error`, or a description of the defect."""
    from cylx.errors import CylxError

    started, spent = time.perf_counter(), _processor_time()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", RuntimeWarning)
            function(data)
        verdict = "success"
    except CylxError as error:
        line = str(error)
        verdict = "error"
        if not line.isprintable():
            verdict = f"a message of several lines: {line[:200]!r}"
        elif len(line) > LONGEST:
            verdict = f"a message of {len(line)} letters: {line[:200]!r}"
    except Exception as failure:  # noqa: BLE001  this is what is looked for
        frames = traceback.extract_tb(failure.__traceback__)
        ours = next((frame for frame in reversed(frames) if "/cylx/" in frame.filename), frames[-1])
        verdict = f"{type(failure).__name__} at {Path(ours.filename).name}:{ours.lineno}: {str(failure)[:200]!r}"
    seconds = max(_processor_time() - spent, (time.perf_counter() - started) / _WAITING)
    return verdict if seconds < slowest else f"slow: {seconds:.1f} s, then {verdict[:100]}"


def _processor_time():
    """Return the processor time of this process and of those that it has waited for."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


def inputs_of(seeds, rng):
    """Yield the seeds, and mutated ones without end."""
    yield from seeds
    while True:
        yield mutate(rng, rng.choice(seeds), seeds)


def fuzz(name, target, *, seed=0, inputs=None, seconds=None, findings=None, slowest=SLOWEST):
    """Fuzz one target and return the counts of its verdicts."""
    seeds, function = target
    rng = random.Random(f"{name} {seed}")
    counts, kinds = Counter(), Counter()
    stop = None if seconds is None else time.monotonic() + seconds
    for number, data in enumerate(inputs_of(seeds, rng)):
        if (inputs is not None and number >= inputs) or (stop is not None and time.monotonic() > stop):
            break
        verdict = judge(function, data, slowest=slowest if number >= len(seeds) else 60.0)  # the first ones import
        counts["inputs"] += 1
        if verdict in ("success", "error"):
            counts[verdict] += 1
            continue
        counts["defect"] += 1
        kind = verdict.partition(": ")[0]
        kinds[kind] += 1
        if findings is not None and kinds[kind] <= MOST_FILES:
            keep(Path(findings), name, data, verdict)
    return counts, kinds


def keep(folder, name, data, verdict):
    """Save an input that showed a defect, with the defect beside it."""
    place = folder / name
    place.mkdir(parents=True, exist_ok=True)
    stem = hashlib.sha256(data).hexdigest()[:12]
    (place / stem).write_bytes(data)
    (place / f"{stem}.why").write_text(f"{verdict}\n", encoding="utf-8", errors="backslashreplace")


def main():
    """Fuzz the chosen targets, and print a table."""
    targets = all_targets()
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz.run", description="Fuzz everything that reads files.")
    parser.add_argument("--target", action="append", choices=sorted(targets), help="only this one; may be repeated")
    length = parser.add_mutually_exclusive_group()
    length.add_argument("--seconds", type=float, help="of each target (default: 10)")
    length.add_argument("--inputs", type=int, help="of each target")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--findings", default="fuzz-findings", help="folder for what shows a defect")
    given = parser.parse_args()
    seconds = 10.0 if given.seconds is None and given.inputs is None else given.seconds
    total = Counter()
    print(f"{'target':<16} {'inputs':>9} {'successes':>10} {'errors':>9} {'defects':>8}", flush=True)
    for name in given.target or targets:
        counts, kinds = fuzz(
            name, targets[name], seed=given.seed, inputs=given.inputs, seconds=seconds, findings=given.findings
        )
        total += counts
        print_row(name, counts)
        for kind, count in kinds.most_common():
            print(f"    {count} x {kind}", flush=True)
    print_row("all", total)
    sys.exit(1 if total["defect"] else 0)


def print_row(name, counts):
    """Print a row of the table."""
    numbers = (counts["inputs"], counts["success"], counts["error"], counts["defect"])
    print("{:<16} {:>9} {:>10} {:>9} {:>8}".format(name, *numbers), flush=True)


if __name__ == "__main__":
    main()
