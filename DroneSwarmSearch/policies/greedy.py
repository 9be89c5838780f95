"""Greedy search: every drone goes for the cell that is worth most for its distance.

For a target that stays where it is and looks that cost alike, the best plan is to look
next where a look is most likely to succeed (Stone, Theory of Optimal Search, 1975;
Chew, Annals of Mathematical Statistics 38:1967). A drone must also get there, and while
it flies it finds nobody. The heuristic here is the usual way out: a success is worth the
less the later it comes, `DISCOUNT` for each step of the way, and of the cells the drone
takes the one with the greatest discounted probability. It looks one target ahead and
plans no path beyond that: a planner can do better, above all with few drones in a wide
area. With the posterior as its matrix it still makes a search of it, since searched cells
lose their probability and the next target is then another one.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch import checks
from DroneSwarmSearch.observations import Observation
from DroneSwarmSearch.rules import Action
from DroneSwarmSearch.scenario import Cell

__all__ = ["GreedyPolicy"]

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

LEAST = 1e-300
"""Stands for a probability of 0, whose logarithm would be infinite."""

STEPS: tuple[tuple[Action, int, int], ...] = (
    (Action.LEFT, -1, 0),
    (Action.RIGHT, 1, 0),
    (Action.UP, 0, -1),
    (Action.DOWN, 0, 1),
)
"""The moves and where they lead, (x, y)."""

Floats = NDArray[np.float64]


class GreedyPolicy:
    """Sends every drone to the cell that is worth most for its distance, and searches there.

    In every step:

    1. A cell is worth its probability times `DISCOUNT` to the number of steps to it. The
       greatest worth among all drones and cells decides first: that drone gets that
       cell, which is worth next to nothing to the others from then on. So the drones
       spread over the likely area, each on its own side of it.
    2. A drone on its target searches. Any other takes the move towards its target that
       leads through the likelier cell. A cell is free for it if no drone is in it and no
       drone that chose before it is about to enter it; without a free move it idles.
       Hence drones never collide, and never leave the grid.

    With `bayesian_update=True` the matrix itself tells where it is no use to search
    again. A matrix that shows the drift alone does not, and so the policy remembers the
    cells it has searched lately, and values them less for some steps. A new episode is
    noticed when a drone stands where no move could have brought it, but only `reset`
    makes sure of it.

    The policy is deterministic, with ties going to the drone named first and then to the
    cell that comes first row by row. A step takes time and memory in proportion to the
    drones times the cells.

    Args:
        grid_size: cells along each side of the square grid; an integer of at least 2.

    Raises:
        TypeError: `grid_size` is no integer.
        ValueError: `grid_size` is less than 2.
    """

    def __init__(self, grid_size: int) -> None:
        size = checks.integer("grid_size", grid_size, 2)
        axis = np.arange(size)
        # [a, b]: the logarithm of the discount for going from a to b along one axis.
        self._delay = math.log(DISCOUNT) * np.abs(axis[:, None] - axis).astype(np.float64)
        self._searched = np.zeros((size, size))
        self._shown: Floats | None = None
        self._cells: list[Cell] = []
        self._looked_at: list[Cell] = []

    def reset(self) -> None:
        """Forget the episode: the next observations are the first of another one."""
        self._searched.fill(0.0)
        self._shown = None
        self._cells = []
        self._looked_at = []

    def __call__(self, observations: Mapping[str, Observation], /) -> dict[str, int]:
        """Choose an action for every drone.

        Args:
            observations: as the environment hands them out, one for each drone.

        Returns:
            The action of each of these drones, 0 to 5, see `rules.Action`.
        """
        if not observations:
            return {}
        seen = [observation["observation"] for observation in observations.values()]
        cells = [cell for cell, _ in seen]
        matrix = seen[0][1].astype(np.float64)
        self._remember(cells, matrix)

        probability = matrix * (1.0 - self._searched)
        targets = self._targets(cells, probability)
        actions = _moves(cells, targets, probability)
        self._shown, self._cells = matrix, cells
        self._looked_at = [cells[i] for i, action in actions.items() if action is Action.SEARCH]
        return {name: int(actions[i]) for i, name in enumerate(observations)}

    def _remember(self, cells: list[Cell], matrix: Floats) -> None:
        """Note the searches of the last step that the matrix does not show."""
        before = self._shown
        if before is None or not _one_step_apart(self._cells, cells):
            self.reset()
            return
        self._searched *= FADING
        if not self._looked_at:
            return
        others_before, others = before.copy(), matrix.copy()
        for x, y in self._looked_at:
            others_before[y, x] = others[y, x] = 0.0
        for x, y in self._looked_at:
            around = np.s_[max(y - 1, 0) : y + 2, max(x - 1, 0) : x + 2]
            kept = matrix[y, x] * others_before[around].sum()
            if kept >= UNNOTICED * before[y, x] * others[around].sum():
                self._searched[y, x] = FADING

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


def _moves(
    cells: list[Cell], targets: Iterable[tuple[int, Cell]], probability: Floats
) -> dict[int, Action]:
    """The action that brings each drone nearer to its target without meeting another."""
    taken = set(cells)
    actions = {}
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
        for action, dx, dy in STEPS
        if across * dx + down * dy > 0 and (x + dx, y + dy) not in taken
    ]
    if not nearer:
        return Action.IDLE, cell
    _, action, ahead = max(nearer, key=lambda way: way[0])
    return action, ahead


def _one_step_apart(before: list[Cell], now: list[Cell]) -> bool:
    """Whether one step can have brought the drones from some cells to others."""
    return len(before) == len(now) and all(
        abs(x - u) + abs(y - v) <= 1 for (x, y), (u, v) in zip(before, now, strict=True)
    )
