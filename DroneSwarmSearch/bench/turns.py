"""Measuring cases in turns, so that what slows the machine down slows all of them."""

from __future__ import annotations

import time
from collections.abc import Callable, Hashable, Mapping, Sequence
from typing import NamedTuple, TypeVar

import numpy as np

from DroneSwarmSearch.bench.cases import Run

__all__ = ["Spread", "take_turns"]

Key = TypeVar("Key", bound=Hashable)


class Spread(NamedTuple):
    """The median of some figures and their quartiles."""

    median: float
    lower: float
    upper: float

    @classmethod
    def of(cls, figures: Sequence[float]) -> Spread:
        """That of some figures."""
        lower, median, upper = np.percentile(figures, (25, 50, 75)).tolist()
        return cls(median, lower, upper)


def take_turns(
    runs: Mapping[Key, Run],
    *,
    rounds: int,
    seconds: float,
    warm_up: int,
    tell: Callable[[Key, int], object],
) -> dict[Key, list[float]]:
    """Environment steps per second of every case in every round.

    Args:
        runs: the cases.
        rounds: how often each has its turn; every second round goes backwards.
        seconds: for a turn, about.
        warm_up: steps beforehand, after which searches begun together stand apart.
        tell: is told whose turn it is in which round, 0 being the warm-up.
    """
    counts: dict[Key, int] = {}
    for key, run in runs.items():
        tell(key, 0)
        run(1)  # what happens but once, such as compiling, does not count
        begin = time.perf_counter()
        run(warm_up)
        # Of one step nothing may be left, since steps that begin an episode do not count.
        counts[key] = max(2, round(warm_up * seconds / (time.perf_counter() - begin)))
    rates: dict[Key, list[float]] = {key: [] for key in runs}
    order = list(runs)
    for number in range(1, rounds + 1):
        for key in order:
            tell(key, number)
            begin = time.perf_counter()
            made = runs[key](counts[key])
            rates[key].append(made / (time.perf_counter() - begin))
        order.reverse()
    return rates
