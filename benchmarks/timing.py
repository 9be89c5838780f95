"""Timing in turns: a slow phase of the machine slows down every case alike."""

from __future__ import annotations

import time
from collections.abc import Callable, Hashable, Mapping, Sequence
from typing import NamedTuple, TypeVar

import numpy as np

Run = Callable[[int], int]
"""Performs about so many steps; returns the number of environment steps made."""

Key = TypeVar("Key", bound=Hashable)


class Spread(NamedTuple):
    """A median with its quartiles."""

    median: float
    lower: float
    upper: float

    @classmethod
    def of(cls, values: Sequence[float]) -> Spread:
        lower, median, upper = np.percentile(values, (25, 50, 75)).tolist()
        return cls(median, lower, upper)


def take_turns(
    runs: Mapping[Key, Run],
    *,
    rounds: int,
    seconds: float,
    warm_up: int,
    clock: Callable[[], float] = time.perf_counter,
) -> dict[Key, list[float]]:
    """Measure the environment steps per second of every case in every round.

    Args:
        runs: the cases.
        rounds: turns per case; every second round runs in reverse order.
        seconds: approximate length of a turn.
        warm_up: steps before timing starts, so that batched episodes no longer end together.
        clock: in seconds. `time.process_time` suits a busy machine, but counts all threads.
    """
    counts: dict[Key, int] = {}
    for key, run in runs.items():
        run(1)  # one-time costs such as compilation
        start = clock()
        run(warm_up)
        # At least two: a single step of a batch may consist of resets only.
        counts[key] = max(2, round(warm_up * seconds / (clock() - start)))
    rates: dict[Key, list[float]] = {key: [] for key in runs}
    order = list(runs)
    for _ in range(rounds):
        for key in order:
            start = clock()
            steps = runs[key](counts[key])
            rates[key].append(steps / (clock() - start))
        order.reverse()
    return rates
