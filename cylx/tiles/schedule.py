"""Who works on the tiles: this process, other processes, or a cluster."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Generator, Sequence
from typing import Any, Protocol

from cylx.errors import InputError, UsageError
from cylx.optional.extras import require

Work = Callable[[int], int]
Answers = Generator[tuple[int, int], None, None]
"""The number and the answer of each task; closed, it stops those that are not done."""

_CALLED = "10s"
"""How long a scheduler is called."""
_LOOK_UP = 1.0
"""Seconds between two looks at whether somebody wants to stop."""


class Runner(Protocol):
    """Whoever runs tasks, in any order."""

    def run(self, work: Work, numbers: Sequence[int], waited: Callable[[], None]) -> Answers:
        """Yield the number and the answer of each task as it is done; `waited` is called now and then meanwhile."""


class Here:
    """Runs one task after the other in this process."""

    def run(self, work: Work, numbers: Sequence[int], waited: Callable[[], None]) -> Answers:
        """Yield the number and the answer of each task."""
        for number in numbers:
            waited()
            yield number, work(number)


class Cluster:
    """Runs tasks on a cluster of Dask.

    Parameters
    ----------
    address : str
        Of the scheduler, such as `tcp://host:8786`. All its workers must see the scratch folder under the same name.

    Raises
    ------
    UsageError
        If Dask is not installed, or the scheduler does not answer.
    """

    def __init__(self, address: str) -> None:
        require("distributed", place="--scheduler")
        from distributed import Client  # noqa: PLC0415  an extra

        try:
            self._client: Any = Client(address, timeout=_CALLED, set_as_default=False)
        except (OSError, ValueError) as error:
            fault = f"does not answer: {' '.join(str(error).split())[:100]}"
            raise UsageError(f"--scheduler {address}", fault, "check its address, and that it runs") from None

    def run(self, work: Work, numbers: Sequence[int], waited: Callable[[], None]) -> Answers:
        """Yield the number and the answer of each task as it is done; a task whose worker dies is done by another."""
        from distributed import KilledWorker, wait  # noqa: PLC0415  an extra

        shared = self._client.scatter(work, broadcast=True)
        futures = {self._client.submit(_call, shared, number, pure=False): number for number in numbers}
        try:
            while futures:
                waited()
                try:
                    with self._client.as_current():
                        done, _ = wait(list(futures), timeout=_LOOK_UP, return_when="FIRST_COMPLETED")
                except (TimeoutError, asyncio.TimeoutError):  # the same since Python 3.11
                    continue
                for future in done:
                    number = futures.pop(future)
                    try:
                        yield number, future.result()
                    except KilledWorker as error:
                        fault = "every worker that took it died, as when memory runs out"
                        raise InputError(f"tile {number}", fault, "give less by --memory") from error
        finally:
            self._client.cancel(list(futures))

    def close(self) -> None:
        """Leave the cluster."""
        self._client.close()


def _call(work: Work, number: int) -> int:
    return work(number)
