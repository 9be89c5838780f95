"""Greedy search: every drone heads for the cell with the greatest discounted success.

For a stationary target and searches of equal cost, the optimal plan searches next where success
is most likely (L. D. Stone, Theory of Optimal Search, 1975; M. C. Chew, Annals of Mathematical
Statistics 38:494, 1967). A drone must also fly there, so the usual heuristic discounts success by
`DISCOUNT` for each step of the way.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable
from typing import TypeVar

import numpy as np

from DroneSwarmSearch._internal.arrays import Floats, Ints, Singles
from DroneSwarmSearch._internal.cells import cell_position
from DroneSwarmSearch.core.collision_avoidance import approach_in_turn
from DroneSwarmSearch.core.grid import Cell, moves_between
from DroneSwarmSearch.core.rules import Action
from DroneSwarmSearch.core.scenario import Scenario
from DroneSwarmSearch.policies.base import SwarmPolicy
from DroneSwarmSearch.policies.belief_tracker import BeliefTracker, Outlook

DISCOUNT = 0.7  # factor on the value of a success for every step that it comes later

CLAIMED = 1e-3
"""Factor on the value of a claimed cell; not zero, so drones without another one gather there."""

FADING = 0.9  # factor per step on the memory of a search, since the person may drift back

WORTHWHILE = 0.3
WORTHWHILE_ON_ARRIVAL = 0.2
"""The share of the best cell's success, now and on arrival, that targets need: drones that stop on
the wide flanks of a posterior reach the middle too late."""

SLIGHT = 1e-20
"""Factor on the value of the other cells: enough to choose among them if all targets are taken."""

LEAST = 1e-300  # replaces a probability of 0, whose logarithm is infinite

Floating = TypeVar("Floating", Floats, Singles)
Claim = Callable[[int, Cell, Ints], Floats]


class _Greedy(SwarmPolicy):
    """The choice of targets and moves, for given values of the cells."""

    def __init__(self, scenario: Scenario) -> None:
        super().__init__(scenario)
        axis = np.arange(scenario.grid_size)
        # [a, b]: the logarithm of the discount for going from a to b along one axis.
        self._log_discount = math.log(DISCOUNT) * np.abs(axis[:, None] - axis).astype(np.float64)

    def _targets(
        self, cells: list[Cell], values: Floats, claim: Claim | None = None
    ) -> list[tuple[int, Cell]]:
        """Each drone's number and target, in the order in which the drones choose.

        The values of the cells have the shape (N, N), or (n_drones, N, N). `claim` gets a drone,
        its target and the drones that still choose; it returns their new values, (drones, N, N).
        """
        size = self.scenario.grid_size
        scores = self._scores(cells, values)
        targets = []
        claimed = np.zeros(size**2)
        for _ in cells:
            drone, favourite = divmod(int(scores.argmax()), size**2)
            target = cell_position(favourite, size)
            targets.append((drone, target))
            scores[drone] = -np.inf
            claimed[favourite] += math.log(CLAIMED)
            rivals = np.flatnonzero(scores[:, 0] > -np.inf)
            if claim is None:
                scores[:, favourite] += math.log(CLAIMED)
            elif rivals.size:
                others = [cells[rival] for rival in rivals]
                scores[rivals] = self._scores(others, claim(drone, target, rivals)) + claimed
        return targets

    def _scores(self, cells: list[Cell], values: Floats) -> Floats:
        """The logarithms of the discounted values, shape (len(cells), N * N)."""
        x, y = np.array(cells).T
        scores = np.log(np.maximum(values, LEAST)) + self._log_discount[y][:, :, None]
        scores += self._log_discount[x][:, None, :]
        flat: Floats = scores.reshape(len(cells), -1)
        return flat


def worthwhile(success: Floating, share: float) -> Floating:
    """The values of cells, (..., N, N), as targets, which need a share of the best success."""
    best = success.max(axis=(-2, -1), keepdims=True)
    return np.where(success < share * best, SLIGHT * success, success)


def claimed_in_turn(values: Singles) -> Ints:
    """The array form of `_Greedy._targets` without `claim`: int64 cells, shape (swarms, n).

    The values of each cell to each drone are discounted, at least 0; shape (swarms, n, N * N).
    """
    swarms, n, _ = values.shape
    values = values.copy()
    favourites: Ints = values.argmax(axis=2)
    best = np.take_along_axis(values, favourites[..., None], 2)[..., 0]
    rows = np.arange(swarms)
    for _ in range(n - 1):
        drone = best.argmax(axis=1)
        claimed = favourites[rows, drone]
        best[rows, drone] = -np.inf
        values[rows, :, claimed] *= CLAIMED
        rivals = (favourites == claimed[:, None]) & (best > -np.inf)
        favourites[rivals] = values[rivals].argmax(axis=1)
        best[rivals] = values[rivals].max(axis=1)
    return favourites


class GreedyPolicy(_Greedy):
    """Greedy on the matrix shown.

    In every step:

    1. The value of a cell to a drone is its probability times ``DISCOUNT`` to the power of the
       distance. The drone and cell with the greatest value come first: that drone gets that
       cell, which then has little value to the others. So the drones spread over the likely area.
    2. A drone on its target searches. Any other moves towards its target, through the likelier
       of two cells. It avoids cells that are occupied or that an earlier drone is about to enter;
       without a free move it idles. Drones therefore never collide and never leave the grid.

    Without `bayesian_update`, the matrix does not show which searches were unsuccessful; the policy
    then lowers the value of those cells for a few steps. Ties go to the first drone, then to the
    first cell row by row.
    """

    reads_persons = False

    def begin(self) -> Floats:
        """The fraction by which recent searches lower each cell's value, shape (N, N)."""
        return np.zeros((self.scenario.grid_size, self.scenario.grid_size))

    def choose(self, memory: Floats, cells: list[Cell], matrix: Singles) -> list[Action]:
        values = matrix.astype(np.float64) * (1.0 - memory)
        return approach_in_turn(cells, self._targets(cells, values), values, self.scenario.crash)

    def learn(self, memory: Floats, searched: list[int], actions: list[int]) -> None:
        if not self.scenario.bayesian_update:
            memory *= FADING
            memory.reshape(-1)[searched] = FADING


class PosteriorGreedyPolicy(_Greedy):
    """Greedy on the exact posterior, which it tracks itself regardless of the matrix shown.

    It chooses like `GreedyPolicy`, but a cell's value is the probability that searching it
    succeeds (POS): the mean over the missing persons of probability of detection x posterior.
    Cells below ``WORTHWHILE`` times the greatest value are targets only if no other is left.
    """

    def __init__(self, scenario: Scenario) -> None:
        super().__init__(scenario)
        self._tracker = BeliefTracker(scenario)

    def begin(self) -> BeliefTracker:
        return copy.deepcopy(self._tracker)

    def choose(self, memory: BeliefTracker, cells: list[Cell], matrix: Singles) -> list[Action]:
        memory.observe(matrix)
        return self.actions(memory, cells)

    def learn(self, memory: BeliefTracker, searched: list[int], actions: list[int]) -> None:
        memory.learn(searched, actions)

    def actions(self, tracker: BeliefTracker, cells: list[Cell]) -> list[Action]:
        """The drones' actions, given the beliefs, which do not change."""
        targets, success = self._choice(tracker, cells)
        return approach_in_turn(cells, targets, success, tracker.scenario.crash)

    def _choice(
        self, memory: BeliefTracker, cells: list[Cell]
    ) -> tuple[list[tuple[int, Cell]], Floats]:
        """The drones' targets, see `_targets`, and the success in the cells on the way: (N, N)."""
        success = memory.success
        return self._targets(cells, worthwhile(success, WORTHWHILE)), success


class ForecastGreedyPolicy(PosteriorGreedyPolicy):
    """Greedy on the posterior at the time of arrival.

    It chooses like `PosteriorGreedyPolicy`, but the value of a cell at distance d is its
    probability of success d steps from now, if nobody searches before. What a drone finds on its
    target is subtracted for drones that arrive later, wherever it drifts. Cells that a drone
    cannot reach and search before the time limit have no value.
    """

    def __init__(self, scenario: Scenario) -> None:
        super().__init__(scenario)
        self._rows, self._columns = np.ogrid[: scenario.grid_size, : scenario.grid_size]

    def _choice(
        self, memory: BeliefTracker, cells: list[Cell]
    ) -> tuple[list[tuple[int, Cell]], Floats]:
        x, y = np.array(cells).T[:, :, None, None]
        distances = moves_between(self._columns - x, self._rows - y)  # [drone, y, x]
        steps = max(self.scenario.timestep_limit - memory.step - 1, 0)
        steps = min(steps, int(distances.max()))
        outlook = Outlook(memory, steps)
        next_success = outlook.success[min(steps, 1)].copy()

        def on_arrival(drones: Ints) -> Floats:
            to_cells = distances[drones]
            success = outlook.success[np.minimum(to_cells, steps), self._rows, self._columns]
            success[to_cells > steps] = 0.0
            return worthwhile(success, WORTHWHILE_ON_ARRIVAL)

        def claim(drone: int, target: Cell, others: Ints) -> Floats:
            arrival = int(distances[drone, target[1], target[0]])
            if arrival <= steps:
                outlook.search(target, arrival)
            return on_arrival(others)

        values = on_arrival(np.arange(len(cells)))
        return self._targets(cells, values, claim), next_success
