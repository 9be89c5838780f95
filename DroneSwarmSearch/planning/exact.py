"""The optimal plan of a small search, by branch and bound.

A depth-first search over all paths of all drones. It abandons a partial plan if even an optimistic
completion cannot beat the best plan so far. The optimistic completion gives every drone its best
path and ignores how later searches reduce each other's gains (J. N. Eagle and J. R. Yee, Operations
Research 38:110, 1990, bound the path of a single searcher in this way). The work grows
exponentially with steps and drones: use it to check approximate methods.
"""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch.drift.belief import after_search, over_hypotheses
from DroneSwarmSearch.drift.markov_chain import MarkovChain
from DroneSwarmSearch.planning.paths import values_to_go
from DroneSwarmSearch.rules import OFF_GRID, Action, neighbours_of_all
from DroneSwarmSearch.scenario import Scenario, checked_scenario

__all__ = ["best_success"]

Floats = NDArray[np.float64]

MIN_GAIN = 1e-12
"""Plans whose values differ by less are equally good."""


def best_success(scenario: Scenario, drones_positions: object, known: float = 0.0) -> float:
    """The largest probability of success that any policy can reach by the time limit.

    Args:
        scenario: a small search for one person: about ten steps with one drone, or six with two.
        drones_positions: every drone's start cell (x, y).
        known: a probability that some plan is known to reach, which saves work.

    Raises:
        TypeError: an argument has the wrong type.
        ValueError: the scenario has several persons, or the cells do not fit.
    """
    persons = len(checked_scenario(scenario).situation)
    if persons > 1:
        raise ValueError(f"scenario must have one person, got {persons}")
    return _BranchAndBound(scenario, known).solve(scenario.drone_cells(drones_positions))


class _BranchAndBound:
    def __init__(self, scenario: Scenario, known: float) -> None:
        (forecast,) = scenario.forecasts()
        (self._detection,) = scenario.detections
        self._prior = forecast.joint(0)
        self._limit = scenario.timestep_limit
        self._chain = MarkovChain(forecast)
        self._best = known
        # For each cell, (searches, next cell) of every action; idling is never better.
        self._choices = [
            [
                (action == Action.SEARCH, int(row[action]))
                for action in Action
                if action != Action.IDLE
            ]
            for row in neighbours_of_all(scenario.grid_size)
        ]

    def solve(self, starts: list[int]) -> float:
        self._branch(0, starts, self._prior, 0.0)
        return self._best

    def _branch(self, step: int, cells: list[int], mass: Floats, found: float) -> None:
        """Try all completions of a plan.

        Args:
            step: completed steps.
            cells: every drone's cell.
            mass: probability of each hypothesis and cell, and that the person has not been found.
            found: probability that the person has been found.
        """
        if step == self._limit:
            self._best = max(self._best, found)
            return
        now, later = self._optimistic_values(step, mass)
        if found + min(now[cells].sum(), mass.sum()) <= self._best + MIN_GAIN:
            return
        branches = []
        for choices in product(*(self._choices[cell] for cell in cells)):
            ahead = [cell for _, cell in choices]
            if OFF_GRID in ahead or len(set(ahead)) < len(ahead):
                continue
            searched = [cell for searches, cell in choices if searches]
            left, success = after_search(mass, searched, self._detection)
            branches.append((success + float(later[ahead].sum()), success, ahead, left))
        branches.sort(key=lambda branch: -branch[0])
        for optimistic, success, ahead, left in branches:
            if found + optimistic <= self._best + MIN_GAIN:
                break
            self._branch(step + 1, ahead, self._chain.forward(left, step), found + success)

    def _optimistic_values(self, step: int, mass: Floats) -> tuple[Floats, Floats]:
        """The most that a drone can gain from each cell, from this step on and from the next."""
        masses = [mass]
        for later in range(step, self._limit - 1):
            masses.append(self._chain.forward(masses[-1], later))
        gains = self._detection * np.array([*map(over_hypotheses, masses)])
        values = values_to_go(gains, np.zeros_like(gains[0]))
        return values[0].reshape(-1), values[1].reshape(-1)
