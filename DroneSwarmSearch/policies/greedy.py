"""Greedy search: every drone goes for the cell that is worth most for its distance.

For a target that stays where it is and looks that cost alike, the best plan is to look
next where a look is most likely to succeed (Stone, Theory of Optimal Search, 1975;
Chew, Annals of Mathematical Statistics 38:494, 1967). A drone must also get there, and while
it flies it finds nobody. The heuristic here is the usual way out: a success is worth the
less the later it comes, `DISCOUNT` for each step of the way, and of the cells the drone
takes the one with the greatest discounted probability. It looks one target ahead and
plans no path beyond that: a planner can do better, above all with few drones in a wide
area. With the posterior as its matrix it still makes a search of it, since searched cells
lose their probability and the next target is then another one.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch.policies.belief_tracker import BeliefTracker
from DroneSwarmSearch.policies.conflicts import MOVES
from DroneSwarmSearch.policies.swarm import SwarmPolicy
from DroneSwarmSearch.rules import Action
from DroneSwarmSearch.scenario import Cell, Scenario

__all__ = ["GreedyPolicy", "PosteriorGreedyPolicy"]

DISCOUNT = 0.7
"""What is left of the worth of a success for every step that it comes later."""

CLAIMED = 1e-3
"""What is left of the worth of a cell that another drone is going for. Not nothing, so
that drones with no other likely cell gather around the likely one."""

FADING = 0.9
"""What is left after every step of the memory of a search, as the person may drift back."""

UNNOTICED = 0.95
"""Only searches that the matrix does not show are remembered: those whose cell keeps at
least this share of its probability, measured by what the cells around it keep. Measured
on many episodes: nearly always less in a posterior, nearly always more without."""

WORTHWHILE = 0.3
"""Of the likeliest cell's chance of success; what has less is passed over while there is
more. A person's posterior has wide flanks where a look hardly ever succeeds, and whoever
stops there on the way to the middle comes late. Measured on six searches of 20 or 40 cells
a side, 0.25 to 0.5 found more in the mean than none or 0.6; not more on every one of them."""

PASSED_OVER = 1e-20
"""What is left of the worth of such a cell: enough to choose among them if all others are
claimed."""

LEAST = 1e-300
"""Stands for a probability of 0, whose logarithm would be infinite."""

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]


@dataclass
class _Trail:
    """What a search is remembered by: the last step, and the searches made lately."""

    searched: Floats  # what every cell has lost of its worth, as a share
    shown: Floats | None = None
    looked_at: list[Cell] = field(default_factory=list)


class _Greedy(SwarmPolicy):
    """The choice itself, for cells of given worth."""

    def __init__(self, scenario: Scenario) -> None:
        super().__init__(scenario)
        axis = np.arange(scenario.grid_size)
        # [a, b]: the logarithm of the discount for going from a to b along one axis.
        self._delay = math.log(DISCOUNT) * np.abs(axis[:, None] - axis).astype(np.float64)

    def _steer(self, cells: list[Cell], worth: Floats, probability: Floats) -> list[Action]:
        """The drones' actions, given what cells are worth as targets and on the way, (N, N)."""
        return _moves(cells, self._targets(cells, worth), probability)

    def _targets(self, cells: list[Cell], probability: Floats) -> list[tuple[int, Cell]]:
        """Each drone, by its place in `cells`, with its target, in the order of choice."""
        n, size = len(cells), len(probability)
        x, y = np.array(cells).T
        worth = np.log(np.maximum(probability, LEAST)) + self._delay[y][:, :, None]
        worth += self._delay[x][:, None, :]
        worth = worth.reshape(n, -1)
        favourites = worth.argmax(axis=1)
        values = worth[np.arange(n), favourites]
        targets = []
        for _ in range(n):
            drone = int(values.argmax())
            favourite = int(favourites[drone])
            targets.append((drone, (favourite % size, favourite // size)))
            values[drone] = -np.inf
            worth[:, favourite] += math.log(CLAIMED)
            for rival in np.flatnonzero((favourites == favourite) & (values > -np.inf)):
                favourites[rival] = worth[rival].argmax()
                values[rival] = worth[rival, favourites[rival]]
        return targets


class GreedyPolicy(_Greedy):
    """Greedy on the matrix shown: to the cell worth most for its distance, and search there.

    In every step:

    1. A cell is worth its probability times ``DISCOUNT`` to the number of steps to it. The
       greatest worth among all drones and cells decides first: that drone gets that
       cell, which is worth next to nothing to the others from then on. So the drones
       spread over the likely area, each on its own side of it.
    2. A drone on its target searches. Any other takes the move towards its target that
       leads through the likelier cell. A cell is free for it if no drone is in it and no
       drone that chose before it is about to enter it; without a free move it idles.
       Hence drones never collide, and never leave the grid.

    With `bayesian_update=True` the matrix itself tells where it is no use to search
    again. A matrix that shows the drift alone does not, and so the policy remembers the
    cells it has searched lately, and values them less for some steps.

    The policy is deterministic, with ties going to the drone named first and then to the
    cell that comes first row by row. A step takes time and memory in proportion to the
    drones times the cells.

    Args:
        scenario: the parameters of every search that the policy is going to steer.

    Raises:
        TypeError: `scenario` is no `Scenario`.
    """

    def begin(self) -> _Trail:
        return _Trail(np.zeros(self._board))

    def choose(self, memory: _Trail, cells: list[Cell], matrix: Singles) -> list[Action]:
        probability = matrix.astype(np.float64)
        _remember(memory, probability)
        left = probability * (1.0 - memory.searched)
        actions = self._steer(cells, left, left)
        memory.shown = probability
        memory.looked_at = _searched(cells, actions)
        return actions


class PosteriorGreedyPolicy(_Greedy):
    """Greedy on the exact posterior, which the swarm keeps itself, whatever the matrix shows.

    The choice is that of `GreedyPolicy`.

    A cell is worth the chance that a search of it succeeds, POS: the mean over the
    persons missing of POD times posterior, as `BeliefTracker` keeps it. Cells with less than
    ``WORTHWHILE`` of the greatest chance are passed over.

    Args:
        scenario: the parameters of every search that the policy is going to steer.

    Raises:
        TypeError: `scenario` is no `Scenario`.
    """

    def begin(self) -> BeliefTracker:
        return BeliefTracker(self._scenario)

    def choose(self, memory: BeliefTracker, cells: list[Cell], matrix: Singles) -> list[Action]:
        memory.observe(matrix)
        success = memory.success
        slight = success < WORTHWHILE * success.max()
        actions = self._steer(cells, np.where(slight, PASSED_OVER * success, success), success)
        memory.acted(cells, actions)
        return actions


def _remember(memory: _Trail, matrix: Floats) -> None:
    """Note the searches of the last step that the matrix does not show."""
    before = memory.shown
    if before is None:
        return
    memory.searched *= FADING
    if not memory.looked_at:
        return
    others_before, others = before.copy(), matrix.copy()
    for x, y in memory.looked_at:
        others_before[y, x] = others[y, x] = 0.0
    for x, y in memory.looked_at:
        around = np.s_[max(y - 1, 0) : y + 2, max(x - 1, 0) : x + 2]
        kept = matrix[y, x] * others_before[around].sum()
        if kept >= UNNOTICED * before[y, x] * others[around].sum():
            memory.searched[y, x] = FADING


def _searched(cells: list[Cell], actions: list[Action]) -> list[Cell]:
    return [cell for cell, action in zip(cells, actions, strict=True) if action is Action.SEARCH]


def _moves(
    cells: list[Cell], targets: Iterable[tuple[int, Cell]], probability: Floats
) -> list[Action]:
    """The action that brings each drone nearer to its target without meeting another."""
    taken = set(cells)
    actions = [Action.IDLE] * len(cells)
    for drone, target in targets:
        action, cell = _approach(cells[drone], target, taken, probability)
        actions[drone] = action
        taken.add(cell)
    return actions


def _approach(
    cell: Cell, target: Cell, taken: set[Cell], probability: Floats
) -> tuple[Action, Cell]:
    """A drone's action and where it leads, given the cells that it must not enter."""
    if cell == target:
        return Action.SEARCH, cell
    x, y = cell
    across, down = target[0] - x, target[1] - y
    nearer = [
        # Where both ways are as likely, the longer leg first: that leaves the choice open.
        ((probability[y + dy, x + dx], abs(across * dx + down * dy)), action, (x + dx, y + dy))
        for (dx, dy), action in MOVES.items()
        if across * dx + down * dy > 0 and (x + dx, y + dy) not in taken
    ]
    if not nearer:
        return Action.IDLE, cell
    _, action, ahead = max(nearer, key=lambda way: way[0])
    return action, ahead
