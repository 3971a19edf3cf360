"""Worker processes with one task each, started as memory allows; if one is killed, only its task is lost.

They stay for the next tasks until the pool is closed, as a start takes as long as a small task. They are spawned, not
forked, and do not receive Ctrl-C. The parent ends them; if the parent dies, they end by themselves.
"""

from __future__ import annotations

import errno
import multiprocessing
import os
import signal
import sys
import threading
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection, wait
from typing import Generic, NamedTuple, TypeVar

from cylx.cli.batch.memory import free_memory, memory_held
from cylx.cli.terminal.signals import listen
from cylx.errors import UsageError

Task = TypeVar("Task")
Answer = TypeVar("Answer")

_GLANCE = 1.0
"""Seconds between two checks of the memory."""
_SCARCE = {errno.EMFILE, errno.ENFILE, errno.EAGAIN, errno.ENOMEM}
"""What the system answers if there are too many files or processes."""
_GRACE = 10.0
"""Seconds that a process has to end by itself."""


class Lost(NamedTuple):
    """The answer of a process that died.

    Parameters
    ----------
    exit_code : int or None
        Exit code of the process; negative for the signal that killed it.
    """

    exit_code: int | None


class Workers(Generic[Task, Answer]):
    """A pool of processes; as a context manager it ends them.

    Parameters
    ----------
    work : callable
        Called with each task in a process; it is pickled.
    most : int
        Maximum number of processes.
    after_death : callable
        Called with the id of each process that died or had to be killed.
    """

    def __init__(self, work: Callable[[Task], Answer], most: int, after_death: Callable[[int], None]) -> None:
        self.work = work
        self.most = most
        self.after_death = after_death
        self._idle: list[_Worker] = []
        self._busy: dict[int, _Worker] = {}

    def __enter__(self) -> Workers[Task, Answer]:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def run(
        self, tasks: Sequence[Task], needs: Sequence[int], waited: Callable[[], None] = lambda: None
    ) -> Generator[tuple[int, Answer | Lost], None, None]:
        """Run all tasks; they are started in their order. Those that are not done are stopped if it is closed.

        Parameters
        ----------
        tasks : sequence
            They are pickled.
        needs : sequence of int
            Estimated peak memory of each, bytes.
        waited : callable
            Called at least once a second while tasks are running.

        Yields
        ------
        index : int
            Index of the finished task.
        answer : object or Lost
        """
        waiting = deque(range(len(tasks)))
        try:
            while waiting or self._busy:
                while waiting and len(self._busy) < self.most and self._fits(waiting[0], needs):
                    if not self._start(waiting[0], tasks):
                        break
                    waiting.popleft()
                waited()
                ready = wait([worker.pipe for worker in self._busy.values()], _GLANCE)
                for index in [index for index, worker in self._busy.items() if worker.pipe in ready]:
                    yield index, self._take(index)
        finally:
            self._stop_busy()

    def _fits(self, index: int, needs: Sequence[int]) -> bool:
        """Return whether memory allows another task beside the running ones; the first task always starts."""
        available = free_memory() if self._busy else None
        if available is None:
            return True
        ours = sum(memory_held(worker.pid) for worker in (*self._busy.values(), *self._idle))
        return sum(needs[busy] for busy in self._busy) + needs[index] <= available + ours

    def _start(self, index: int, tasks: Sequence[Task]) -> bool:
        """Start a task; if the system allows no further process, go on with those that there are.

        Raises
        ------
        UsageError
            If there is none.
        """
        try:
            self._busy[index] = self._give(tasks[index])
        except OSError as error:
            if error.errno not in _SCARCE:
                raise
            if not self._busy:
                fault = f"no process can be started: {os.strerror(error.errno).lower()}"
                remedy = "raise the limit (ulimit -a shows it), or leave --jobs out"
                raise UsageError("--jobs", fault, remedy) from error
            self.most = len(self._busy)
            return False
        return True

    def _give(self, task: Task) -> _Worker:
        """Send a task to an idle process, or to a new one."""
        while self._idle:
            worker = self._idle.pop()
            try:
                worker.pipe.send(task)
            except OSError:  # it died in the meantime
                self._part(worker)
            else:
                return worker
        worker = _Worker(self.work)
        with suppress(OSError):  # a dead process shows when its answer is read
            worker.pipe.send(task)
        return worker

    def _take(self, index: int) -> Answer | Lost:
        """Receive the answer to a task."""
        worker = self._busy.pop(index)
        try:
            answer: Answer = worker.pipe.recv()
        except (EOFError, OSError):
            self._part(worker)
            return Lost(worker.process.exitcode)
        self._idle.append(worker)
        return answer

    def close(self) -> None:
        """End all processes."""
        self._stop_busy()
        for worker in self._idle:
            worker.pipe.close()  # all of them, so that they end at the same time
        for worker in self._idle:
            self._part(worker)
        self._idle = []

    def _stop_busy(self) -> None:
        """End the processes that are at work: ask them to stop, and kill those that do not."""
        for worker in self._busy.values():
            worker.process.terminate()
        for worker in self._busy.values():
            self._part(worker)
        self._busy = {}

    def _part(self, worker: _Worker) -> None:
        worker.pipe.close()
        worker.process.join(_GRACE)
        if worker.process.exitcode is None:
            worker.process.kill()
            worker.process.join()
        if worker.process.exitcode:
            self.after_death(worker.pid)


class _Worker:
    """A process and the pipe to it."""

    def __init__(self, work: Callable[[Task], Answer]) -> None:
        context = multiprocessing.get_context("spawn")
        self.pipe, theirs = context.Pipe()
        self.process = context.Process(target=_serve, args=(theirs, work), daemon=True)
        try:
            with isolate_processes(), _ctrl_c_kept_back():
                self.process.start()
        except OSError:
            self.pipe.close()
            raise
        finally:
            theirs.close()  # so that the pipe closes when the process ends
        self.pid = self.process.pid or 0


@contextmanager
def isolate_processes() -> Iterator[None]:
    """Let processes that multiprocessing starts meanwhile look for no modules in the current folder, with Python 3.10.

    They look there for their first modules, before they are told the places that this process knows, and it may be full
    of files of others. Newer versions of Python know PYTHONSAFEPATH, which the command line sets.
    """
    if sys.version_info >= (3, 11):
        yield
        return
    from multiprocessing import util

    name = "_args_from_interpreter_flags"
    flags = vars(util)[name]
    setattr(util, name, lambda: [*dict.fromkeys([*flags(), "-I"])])
    try:
        yield
    finally:
        setattr(util, name, flags)


@contextmanager
def _ctrl_c_kept_back() -> Iterator[None]:
    """Block Ctrl-C for a process started meanwhile; this process receives it afterwards."""
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    from multiprocessing import resource_tracker

    resource_tracker.ensure_running()  # started inside the block, it would unblock Ctrl-C
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _serve(pipe: Connection, work: Callable[[Task], Answer]) -> None:
    """Run the tasks that come through the pipe until it is closed."""
    listen(worker=True)
    threading.Thread(target=_follow_parent, daemon=True).start()
    while True:
        try:
            task = pipe.recv()
        except EOFError:
            return
        answer = work(task)
        with suppress(OSError):
            pipe.send(answer)


def _follow_parent() -> None:
    """End this process when its parent has ended."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os.kill(os.getpid(), signal.SIGTERM)
