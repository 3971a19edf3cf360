"""What a command costs before it does anything: its help, and a sample with nothing compiled yet and with everything.

The compiled code of the first run is kept in a folder of its own, empty at first, and removed afterwards.
"""

import argparse
import sys
import tempfile
from pathlib import Path

from runs import CYLX, SAMPLE, run, run_repeatedly
from tables import Bars, number, print_header, print_row


def main():
    """Print a row a command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeat", type=int, default=5, metavar="N", help="of which the median is given (default: 5)")
    parser.add_argument("--sample", type=Path, default=SAMPLE, help="scan to extract (default: sample_data/pipes.ply)")
    parser.add_argument("--max-help", type=float, metavar="BAR", help="exit with 1 if the help takes longer, seconds")
    parser.add_argument("--max-first", type=float, metavar="BAR", help="the same for the first extraction")
    parser.add_argument("--max-second", type=float, metavar="BAR", help="the same for the second")
    a = parser.parse_args()
    bars = Bars()
    print_header("command", "seconds", "peak MB", "bar")

    def report(name, measured, bar=None):
        if measured.code:
            sys.exit(f"{name}: exit {measured.code}: {measured.complaint}")
        print_row(name, number(measured.seconds, 2), f"{measured.peak_mb:.0f}", bars.at_most(measured.seconds, bar))

    report("`python -c pass`", run_repeatedly([sys.executable, "-c", "pass"], a.repeat))
    report("`cylx --help`", run_repeatedly([*CYLX, "--help"], a.repeat), a.max_help)
    with tempfile.TemporaryDirectory() as folder:
        command = [*CYLX, "extract", a.sample, "-o", f"{folder}/out.cylinders.json", "--overwrite", "--quiet"]
        kept = {"NUMBA_CACHE_DIR": f"{folder}/compiled"}
        name = f"`cylx extract {a.sample.name}`"
        report(f"{name}, the first ever", run(command, **kept), a.max_first)
        report(f"{name}, the second", run_repeatedly(command, a.repeat, **kept), a.max_second)
    return bars.exit_code()


if __name__ == "__main__":
    sys.exit(main())
