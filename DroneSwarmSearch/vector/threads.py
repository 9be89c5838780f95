"""Background threads that share the large array work of a step.

NumPy releases the interpreter lock while it works on an array, so that other threads can
run. Work that does not depend on the rest of the step, such as writing matrices or updating
beliefs, is split into parts. Worker threads take the parts one by one while the main thread
continues with the step; then the main thread helps with the remaining parts. Results do not
depend on which thread did which part.
"""

from __future__ import annotations

import os
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from queue import SimpleQueue
from threading import Thread
from typing import Any, TypeVar

from numpy.typing import NDArray

__all__ = ["parts_of", "run_in_parts", "usual_number", "worth_sharing"]

Part = TypeVar("Part")

_LEAST_BYTES = 2**23
"""Writing a smaller array takes less time than waking a worker."""

_PART_BYTES = 2**22
"""The part of an array that a thread writes at a time."""

_POLL_SECONDS = 0.001
"""How often the main thread checks whether the workers have stopped after an error."""

_MOST = 8
"""With more threads, memory bandwidth is the limit."""


def usual_number() -> int:
    """The number of threads that a process uses, the main thread included; at most 8.

    The environment variable OMP_NUM_THREADS sets it, as for other numerical libraries.
    Without it, it is the number of processors that the process may use.
    """
    wanted = os.environ.get("OMP_NUM_THREADS", "").split(",")[0].strip()
    if wanted.isdecimal() and int(wanted) > 0:
        return min(int(wanted), _MOST)
    if hasattr(os, "sched_getaffinity"):
        return min(len(os.sched_getaffinity(0)), _MOST)
    return min(os.cpu_count() or 1, _MOST)


class _Workers:
    """The worker threads of this process, shared by its batches and started on first use."""

    def __init__(self) -> None:
        self.number = usual_number() - 1
        self._started = 0
        self._queue: SimpleQueue[Callable[[], None]] = SimpleQueue()

    def submit(self, number: int, work: Callable[[], None]) -> None:
        """Let a number of workers, or all if there are fewer, call the same function."""
        for _ in range(min(number, self.number)):
            self._queue.put(work)
        while self._started < self.number:
            # Daemon threads do not keep the program from exiting.
            thread = Thread(target=self._serve, name="DroneSwarmSearch", daemon=True)
            try:
                thread.start()
            except RuntimeError:  # no more threads are allowed, or the program is exiting
                self.number = self._started
            else:
                self._started += 1

    def _serve(self) -> None:
        while True:
            self._queue.get()()


_workers = _Workers()


def worth_sharing(written: NDArray[Any]) -> bool:
    """Whether an array is large enough to be written by several threads, and there are some."""
    return written.nbytes >= _LEAST_BYTES and _workers.number > 0


def _renew_workers() -> None:
    global _workers
    _workers = _Workers()


if hasattr(os, "register_at_fork"):
    # A forked process does not inherit its parent's threads.
    os.register_at_fork(after_in_child=_renew_workers)


def parts_of(written: NDArray[Any]) -> list[slice]:
    """Slices along the first axis of an array, each as large as a thread writes at a time."""
    count = max(1, _PART_BYTES // max(1, written[:1].nbytes))
    return [slice(first, first + count) for first in range(0, len(written), count)]


def _nothing() -> None:
    pass


def run_in_parts(
    work: Callable[[Part], object],
    parts: Iterable[Part],
    foreground: Callable[[], None] = _nothing,
    shares: bool = True,
) -> None:
    """Run work in the background, in parts, while this thread does something else.

    All work is done on return. If the work or the foreground raises, or Ctrl-C interrupts
    them, this function raises after all workers have stopped.

    Args:
        work: called once with each part, from any thread. It must not touch anything that
            other parts or the foreground touch.
        parts: the parts, in any order.
        foreground: called by this thread before it helps with the parts.
        shares: False does everything in this thread, where workers would cost more time
            than they save.
    """
    left = deque(parts)
    number = len(left)
    reports: SimpleQueue[BaseException | None] = SimpleQueue()  # one for each part of a worker
    running: list[None] = []  # one entry for each active worker

    def take() -> Iterator[Part]:
        """Take parts until none is left."""
        while True:
            try:
                part = left.popleft()
            except IndexError:
                return
            yield part

    def help_out() -> None:
        running.append(None)  # before taking a part, so that the main thread waits for it
        for part in take():
            try:
                work(part)
            except BaseException as problem:  # raised in the main thread
                reports.put(problem)
            else:
                reports.put(None)
        running.pop()

    # One try block in one function: an interrupt between two functions would be missed.
    try:
        if shares:
            _workers.submit(number, help_out)
        foreground()
        own = 0
        for part in take():
            work(part)
            own += 1
        for _ in range(number - own):
            problem = reports.get()
            if problem is not None:
                raise problem
    except BaseException:
        left.clear()
        while running:
            with suppress(BaseException):  # keep waiting after another Ctrl-C
                time.sleep(_POLL_SECONDS)
        raise
