"""Threads: what is large in a step is done beside the rest of it, on other processors.

While NumPy goes through an array, other threads may run. What does not depend on the rest
of a step, matrices to be written or beliefs that go on, is therefore divided into parts,
which helpers take one by one while the step goes on; then whoever waits for them takes
parts as well. What comes out does not depend on who has done what.
"""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from queue import SimpleQueue
from threading import Thread
from types import TracebackType
from typing import Any, Generic, TypeVar

from numpy.typing import NDArray

__all__ = ["Beside", "parts_of", "processors", "usual_number", "worth_sharing"]

Part = TypeVar("Part")

_LEAST_BYTES = 2**23
"""An array that takes less is written before a helper has woken up."""

_PART_BYTES = 2**22
"""Of an array a thread writes so much at a time."""

_MOST = 8
"""More threads than these would wait for the memory."""


def processors() -> int:
    """How many processors this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def usual_number() -> int:
    """How many threads a process uses, the caller's among them.

    What the environment variable OMP_NUM_THREADS says, by which numerical libraries go, and
    programs that start many workers; without it the processors that the process may use.
    At most 8.
    """
    wanted = os.environ.get("OMP_NUM_THREADS", "").split(",")[0].strip()
    number = int(wanted) if wanted.isdecimal() and int(wanted) > 0 else processors()
    return min(number, _MOST)


class _Helpers:
    """The threads that help the batches of a process; they start when there is work for them."""

    def __init__(self) -> None:
        self.number = usual_number() - 1
        self._started = 0
        self._asked: SimpleQueue[Callable[[], None]] = SimpleQueue()

    def ask(self, number: int, work: Callable[[], None]) -> None:
        """Let so many helpers, or all if they are fewer, each do the same work."""
        for _ in range(min(number, self.number)):
            self._asked.put(work)
        while self._started < self.number:
            # A program that ends does not wait for daemons.
            thread = Thread(target=self._serve, name="DroneSwarmSearch", daemon=True)
            try:
                thread.start()
            except RuntimeError:  # there may be no more threads, or the program is ending
                self.number = self._started
            else:
                self._started += 1

    def _serve(self) -> None:
        while True:
            self._asked.get()()


_helpers = _Helpers()


def worth_sharing(written: NDArray[Any]) -> bool:
    """Whether an array is so large, and there are helpers, that threads should share in it."""
    return written.nbytes >= _LEAST_BYTES and _helpers.number > 0


def _renew_helpers() -> None:
    global _helpers
    _helpers = _Helpers()


if hasattr(os, "register_at_fork"):
    # A forked process has none of the threads of the one that it was.
    os.register_at_fork(after_in_child=_renew_helpers)


def parts_of(written: NDArray[Any]) -> list[slice]:
    """The first axis of an array that is to be written, in parts of a size worth sharing."""
    count = max(1, _PART_BYTES // max(1, written[:1].nbytes))
    return [slice(first, first + count) for first in range(0, len(written), count)]


class Beside(Generic[Part]):
    """Work in parts, done beside what a `with` block does; at the block's end all is done.

    Args:
        work: called once with every part, from any thread; it must not touch what other
            parts or the block touch.
        parts: in any order.
        shares: False: nobody helps, for that would cost more than it saves.
    """

    def __init__(
        self, work: Callable[[Part], object], parts: Iterable[Part], shares: bool = True
    ) -> None:
        self._work = work
        self._left = deque(parts)
        self._number = len(self._left)
        self._shares = shares
        self._reports: SimpleQueue[BaseException | None] = SimpleQueue()  # on parts helped with

    def __enter__(self) -> None:
        if self._shares:
            _helpers.ask(self._number, self._help)

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        where: TracebackType | None,
    ) -> None:
        own, problem = 0, error
        for part in self._taken():
            own += 1
            if problem is None:
                problem = self._report_on(part)
        for _ in range(self._number - own):  # helpers have taken them, and may be at work
            problem = self._reports.get() or problem
        if problem is not None and problem is not error:
            raise problem

    def _help(self) -> None:
        for part in self._taken():
            self._reports.put(self._report_on(part))

    def _taken(self) -> Iterator[Part]:
        """Parts that nobody else has taken."""
        while True:
            try:
                part = self._left.popleft()
            except IndexError:
                return
            yield part

    def _report_on(self, part: Part) -> BaseException | None:
        """Do a part; what it raises is the caller's to see, whoever does it."""
        try:
            self._work(part)
        except BaseException as problem:
            return problem
        return None
