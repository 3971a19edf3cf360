"""What the processes of tests do, apart from the tests: they import this and little else."""

import os
import signal

from cylx.errors import UsageError


def die_once(folder, number):
    """Kill the process at the first try of task 1."""
    seen = folder / str(number)
    if number == 1 and not seen.exists():
        seen.touch()
        os.kill(os.getpid(), signal.SIGTERM)
    return 10 * number


def always_die(number):
    os.kill(os.getpid(), signal.SIGTERM)
    return number


def refuse(number):
    raise UsageError("here", "no", "stop")


def tell(number):
    return os.getpid()


def tell_otherwise(number):
    return -os.getpid()
