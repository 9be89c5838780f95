"""Threads: what is large in a step is done beside the rest of it, on other processors.

While NumPy goes through an array, other threads may run. What does not depend on the rest
of a step, matrices to be written or beliefs that go on, is therefore divided into parts,
which helpers take one by one while the step goes on; then whoever waits for them takes
parts as well. What comes out does not depend on who has done what.
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

__all__ = ["parts_of", "processors", "run_in_parts", "usual_number", "worth_sharing"]

Part = TypeVar("Part")

_LEAST_BYTES = 2**23
"""An array that takes less is written before a helper has woken up."""

_PART_BYTES = 2**22
"""Of an array a thread writes so much at a time."""

_PATIENCE = 0.001
"""Seconds between two looks at helpers who are still at work after an error."""

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


def _nothing() -> None:
    pass


def run_in_parts(
    work: Callable[[Part], object],
    parts: Iterable[Part],
    meanwhile: Callable[[], None] = _nothing,
    shares: bool = True,
) -> None:
    """Do work in parts, on other threads if there are any, while this thread does something else.

    All work is done when this returns. When it raises, whether because of the work, of what is
    done meanwhile or of an interrupt such as Ctrl-C, nobody is at work any more either.

    Args:
        work: called once with every part, from any thread; it must not touch what other
            parts or `meanwhile` touch.
        parts: in any order.
        meanwhile: what this thread does before it takes parts as well.
        shares: False: nobody helps, for that would cost more than it saves.
    """
    left = deque(parts)
    number = len(left)
    reports: SimpleQueue[BaseException | None] = SimpleQueue()  # on parts done by helpers
    helping: list[None] = []  # an entry for each helper at work

    def take() -> Iterator[Part]:
        """Parts that nobody else has taken."""
        while True:
            try:
                part = left.popleft()
            except IndexError:
                return
            yield part

    def help_out() -> None:
        helping.append(None)  # before taking a part, which must not go unseen
        for part in take():
            try:
                work(part)
            except BaseException as problem:  # the caller's to see
                reports.put(problem)
            else:
                reports.put(None)
        helping.pop()

    # Everything from the first helper on is in one block of one function: between two
    # functions an interrupt could come unseen.
    try:
        if shares:
            _helpers.ask(number, help_out)
        meanwhile()
        own = 0
        for part in take():
            work(part)
            own += 1
        for _ in range(number - own):  # helpers have taken them, and may be at work
            problem = reports.get()
            if problem is not None:
                raise problem
    except BaseException:
        left.clear()
        while helping:
            with suppress(BaseException):  # another Ctrl-C changes nothing
                time.sleep(_PATIENCE)
        raise
