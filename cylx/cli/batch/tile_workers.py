"""Who works on the tiles of a cloud: this process, several processes of this machine, or a cluster."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from typing import TYPE_CHECKING, NamedTuple

from cylx.errors import CylxError, InputError

if TYPE_CHECKING:
    from cylx.cli.options.tiles import TileOptions
    from cylx.tiles.schedule import Answers, Runner, Work

OWN = 400_000_000
"""Memory that this process needs beside those that search tiles, bytes."""
MOST_DEATHS = 3
"""A task that takes so many processes with it is given up."""


class Task(NamedTuple):
    """What a process is sent: what is done to a tile or a group, and its number."""

    work: Work
    number: int


class Answer(NamedTuple):
    """What a process says of a task: what it gave, or why it failed."""

    value: int
    failure: CylxError | None


def processes_for(tiles: TileOptions, processes: int, each: float) -> int:
    """Return how many processes the memory allows."""
    if tiles.memory is None:
        return processes
    return max(1, min(processes, int((tiles.memory - OWN) / each)))


@contextmanager
def runner_of(tiles: TileOptions, processes: int | None, memory: float) -> Iterator[Runner]:
    """Yield who searches the tiles."""
    from cylx.tiles.schedule import Cluster, Here

    if tiles.scheduler is not None:
        with closing(Cluster(tiles.scheduler)) as cluster:
            yield cluster
    elif processes is None:
        yield Here()
    else:
        with closing(Processes(processes_for(tiles, processes, memory), memory)) as pool:
            yield pool


class Processes:
    """Runs tasks in processes of this machine, the same ones for all steps; a task whose process dies is done again.

    Parameters
    ----------
    count : int
    memory : float
        That each may need, bytes.
    """

    def __init__(self, count: int, memory: float) -> None:
        from cylx.cli.batch.workers import Workers

        self.memory = int(memory)
        self._pool: Workers[Task, Answer] = Workers(attempt, count, lambda _: None)

    def run(self, work: Work, numbers: Sequence[int], waited: Callable[[], None]) -> Answers:
        """Yield the number and the answer of each task as it is done."""
        from cylx.cli.batch.workers import Lost

        left, deaths = list(numbers), 0
        while left:
            tasks, lost = [Task(work, number) for number in left], []
            with closing(self._pool.run(tasks, [self.memory] * len(tasks), waited)) as answers:
                for place, answer in answers:
                    if isinstance(answer, Lost):
                        lost.append(left[place])
                        continue
                    if answer.failure is not None:
                        raise answer.failure
                    deaths = 0
                    yield left[place], answer.value
            left = lost
            deaths += bool(lost)
            if deaths >= MOST_DEATHS:
                fault = f"the process that works on it was killed {deaths} times, as when memory runs out"
                raise InputError(f"tile {lost[0]}", fault, "give less by --memory, or fewer --jobs")

    def close(self) -> None:
        """End the processes."""
        self._pool.close()


def attempt(task: Task) -> Answer:
    """Do a task in a process of its own."""
    try:
        return Answer(task.work(task.number), None)
    except CylxError as failure:
        return Answer(task.number, failure)
