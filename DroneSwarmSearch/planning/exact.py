"""The optimal plan of a small search, by branch and bound.

A depth-first search over all paths of all drones. It abandons a partial plan if even an optimistic
completion cannot beat the best plan so far. The optimistic completion gives every drone its best
path and ignores how later searches reduce each other's gains (J. N. Eagle and J. R. Yee, Operations
Research 38:110, 1990, bound the path of a single searcher in this way). It extends only one of
several partial plans that lead to the same situation: the same cells with drones, and the same
probabilities of where the person is unfound. The work grows exponentially with steps and drones:
use it to check approximate methods, or limit the number of partial plans.
"""

from __future__ import annotations

from collections.abc import Sequence
from hashlib import blake2b
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch.drift.belief import over_hypotheses
from DroneSwarmSearch.drift.model import DriftModel
from DroneSwarmSearch.planning.paths import Path, values_to_go
from DroneSwarmSearch.rules import OFF_GRID, Action, neighbours_of_all
from DroneSwarmSearch.scenario import Scenario, checked_scenario

__all__ = ["BestPlan", "best_plan", "best_success", "branch_and_bound"]

Floats = NDArray[np.float64]

MIN_GAIN = 1e-12
"""Plans whose values differ by less are equally good."""

DIGITS = 13
"""Decimals of the probabilities by which situations are compared."""

DIGEST_BYTES = 16
"""The length of the hashes of these probabilities, which keep the table of situations small."""


class BestPlan(NamedTuple):
    """The best plan that was found.

    Attributes:
        success: its probability of success, or the known one if that is larger.
        paths: every drone's path, or None if no plan is better than the known one.
        is_optimal: whether no plan is better.
    """

    success: float
    paths: list[Path] | None
    is_optimal: bool


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
    return best_plan(scenario, drones_positions, known=known).success


def best_plan(
    scenario: Scenario,
    drones_positions: object,
    *,
    known: float = 0.0,
    nodes: int | None = None,
) -> BestPlan:
    """The plan with the largest probability of success by the time limit.

    Args:
        scenario: a search for one person.
        drones_positions: every drone's start cell (x, y).
        known: a probability that some plan is known to reach, which saves work.
        nodes: the most partial plans to extend; by default as many as it takes.

    Raises:
        TypeError: an argument has the wrong type.
        ValueError: the scenario has several persons, the cells do not fit, or `nodes` is negative.
    """
    persons = len(checked_scenario(scenario).situation)
    if persons > 1:
        raise ValueError(f"scenario must have one person, got {persons}")
    starts = scenario.drone_cells(drones_positions)
    checks.real("known", known, 0)
    if nodes is not None:
        checks.integer("nodes", nodes, 0)
    (forecast,) = scenario.forecasts()
    return branch_and_bound(
        forecast,
        scenario.detections[0],
        forecast.joint(0),
        range(scenario.timestep_limit),
        starts,
        known=known,
        nodes=nodes,
    )


def branch_and_bound(
    chain: DriftModel,
    detection: float,
    belief: Floats,
    steps: range,
    starts: Sequence[int],
    *,
    known: float = 0.0,
    nodes: int | None = None,
) -> BestPlan:
    """`best_plan` from any step of a search.

    Args:
        chain: the person's steps.
        detection: the probability of detection.
        belief: the person's distribution at the first of the steps, shape (M, N, N).
        steps: the steps to plan.
        starts: every drone's cell, y * N + x.
        known: as for `best_plan`.
        nodes: as for `best_plan`.
    """
    search = _BranchAndBound(chain, detection, steps, belief.shape[-1], known, nodes)
    search.branch(0, list(starts), belief, 0.0)
    paths = None
    if search.best_moves is not None:
        cells = np.array([list(starts), *(ahead for ahead, _ in search.best_moves)])
        searches = np.array([searching for _, searching in search.best_moves])
        paths = [Path(*arrays) for arrays in zip(cells.T, searches.T, strict=True)]
    return BestPlan(search.best, paths, search.nodes_left is None or search.nodes_left >= 0)


class _BranchAndBound:
    def __init__(
        self,
        chain: DriftModel,
        detection: float,
        steps: range,
        grid_size: int,
        known: float,
        nodes: int | None,
    ) -> None:
        self._chain = chain
        self._detection = detection
        self._steps = steps
        self.best = known
        self.best_moves: list[tuple[list[int], list[bool]]] | None = None
        self.nodes_left = nodes  # None: no limit; negative: it was reached
        self._moves: list[tuple[list[int], list[bool]]] = []
        self._visited: set[tuple[int, tuple[int, ...], bytes]] = set()
        # For each cell, (searches, next cell) of every action; idling is never better.
        self._choices = [
            [
                (action == Action.SEARCH, int(row[action]))
                for action in Action
                if action != Action.IDLE
            ]
            for row in neighbours_of_all(grid_size)
        ]

    def branch(self, done: int, cells: list[int], mass: Floats, found: float) -> None:
        """Try all completions of a plan.

        Args:
            done: the number of completed steps.
            cells: every drone's cell.
            mass: probability of each hypothesis and cell, and that the person has not been found.
            found: probability that the person has been found.
        """
        if done == len(self._steps):
            if found > self.best:
                self.best, self.best_moves = found, list(self._moves)
            return
        digest = blake2b(mass.round(DIGITS).tobytes(), digest_size=DIGEST_BYTES).digest()
        situation = done, tuple(sorted(cells)), digest
        if situation in self._visited:
            return
        if self.nodes_left is not None:
            self.nodes_left -= 1
            if self.nodes_left < 0:
                return
        self._visited.add(situation)
        now, later = self._optimistic_values(done, mass)
        if found + min(now[cells].sum(), mass.sum()) <= self.best + MIN_GAIN:
            return
        branches = []
        for choices in product(*(self._choices[cell] for cell in cells)):
            ahead = [cell for _, cell in choices]
            if OFF_GRID in ahead or len(set(ahead)) < len(ahead):
                continue
            searching = [searches for searches, _ in choices]
            searched = [cell for searches, cell in choices if searches]
            left, success = _after_search(mass, searched, self._detection)
            optimistic = success + float(later[ahead].sum())
            branches.append((optimistic, success, ahead, searching, left))
        branches.sort(key=lambda branch: -branch[0])
        for optimistic, success, ahead, searching, left in branches:
            if found + optimistic <= self.best + MIN_GAIN:
                break
            self._moves.append((ahead, searching))
            after = self._chain.forward(left, self._steps[done])
            self.branch(done + 1, ahead, after, found + success)
            self._moves.pop()

    def _optimistic_values(self, done: int, mass: Floats) -> tuple[Floats, Floats]:
        """The most that a drone can gain from each cell, from this step on and from the next."""
        masses = [mass]
        for step in self._steps[done:-1]:
            masses.append(self._chain.forward(masses[-1], step))
        gains = self._detection * np.array([*map(over_hypotheses, masses)])
        values = values_to_go(gains, np.zeros_like(gains[0]))
        return values[0].reshape(-1), values[1].reshape(-1)


def _after_search(
    mass: Floats, cells: Sequence[int], probability_of_detection: float
) -> tuple[Floats, float]:
    """One step's searches of different cells: what is left, and the probability of a find."""
    if not cells:
        return mass, 0.0
    after, within = mass.copy(), 0.0
    for flat in after.reshape(len(after), -1):  # faster than two indices at once
        searched = flat[cells]
        flat[cells] = (1.0 - probability_of_detection) * searched
        within += float(searched.sum())
    return after, probability_of_detection * within
