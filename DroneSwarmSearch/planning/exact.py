"""The best plan of a small search, by branch and bound.

All paths of all drones are searched depth first. A beginning of a plan is given up if even
an optimist's end to it would not beat the best plan known: the optimist lets each drone fly
the best path for itself, counting anew whom others or the drone itself have found before
(Eagle and Yee, Operations Research 38:110, 1990, bound a single searcher's path so). The
work grows exponentially with steps and drones; this is for tests of what is less exact.
"""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch.planning.chain import Chain
from DroneSwarmSearch.planning.paths import values_to_go
from DroneSwarmSearch.rules import OFF_GRID, Action, neighbours_of_all
from DroneSwarmSearch.scenario import Scenario

__all__ = ["best_success"]

Floats = NDArray[np.float64]

LEAST_GAIN = 1e-12
"""Plans that differ by less are equally good."""


def best_success(scenario: Scenario, drones_positions: object, known: float = 0.0) -> float:
    """The chance of the best of all policies to find the person by the limit.

    Args:
        scenario: a search for one person, small: some ten steps of one drone, or six of two.
        drones_positions: every drone's cell (x, y) at the beginning.
        known: what some plan is known to reach, to save work.

    Raises:
        ValueError: there are several persons.
    """
    persons = len(scenario.person_initial_position)
    if persons > 1:
        raise ValueError(f"scenario must have one person, got {persons}")
    return _Search(scenario, known).run(scenario.drone_cells(drones_positions))


class _Search:
    def __init__(self, scenario: Scenario, known: float) -> None:
        (forecast,) = scenario.forecasts()
        self._first = forecast.exact(0)
        self._limit = scenario.timestep_limit
        self._q = scenario.detections[0]
        self._chain = Chain(forecast, self._q, 0, self._limit)
        self._best = known
        # Idling is no better than searching.
        self._onward = [
            [
                (action == Action.SEARCH, int(row[action]))
                for action in Action
                if action != Action.IDLE
            ]
            for row in neighbours_of_all(scenario.grid_size)
        ]

    def run(self, starts: list[int]) -> float:
        self._go_on(0, starts, self._first, 0.0)
        return self._best

    def _go_on(self, step: int, cells: list[int], mass: Floats, found: float) -> None:
        """Try all ends of a plan.

        Args:
            step: completed steps.
            cells: every drone's.
            mass: where the person is that has not been found.
            found: the chance that it has been.
        """
        if step == self._limit:
            self._best = max(self._best, found)
            return
        hopes = self._hopes(step, mass)
        if found + min(hopes[0][cells].sum(), mass.sum()) <= self._best + LEAST_GAIN:
            return
        branches = []
        for chosen in product(*(self._onward[cell] for cell in cells)):
            ahead = [cell for _, cell in chosen]
            if OFF_GRID in ahead or len(set(ahead)) < len(ahead):
                continue
            searched = [cell for searches, cell in chosen if searches]
            success = self._q * float(mass.reshape(-1)[searched].sum()) if searched else 0.0
            branches.append((success + float(hopes[1][ahead].sum()), success, ahead, searched))
        branches.sort(key=lambda branch: -branch[0])
        for hope, success, ahead, searched in branches:
            if found + hope <= self._best + LEAST_GAIN:
                break
            left = mass.copy()
            left.reshape(-1)[searched] *= 1.0 - self._q
            self._go_on(step + 1, ahead, self._chain.forward(left, step), found + success)

    def _hopes(self, step: int, mass: Floats) -> list[Floats]:
        """What the optimist hopes to gain from each cell: now, and after this step."""
        masses = [mass]
        for later in range(step, self._limit - 1):
            masses.append(self._chain.forward(masses[-1], later))
        values = values_to_go(self._q * np.array(masses), np.zeros_like(mass))
        return [values[0].reshape(-1), values[1].reshape(-1)]
