"""The drones of an episode: their cells and returns, and the outcomes of a step."""

from __future__ import annotations

from collections import deque
from operator import add

from DroneSwarmSearch import rules
from DroneSwarmSearch.frame import HISTORY_STEPS, TRAIL_STEPS
from DroneSwarmSearch.rules import OFF_GRID, Action, Ending
from DroneSwarmSearch.scenario import Scenario
from DroneSwarmSearch.world import WorldState

__all__ = ["Drones"]

_SEARCH = int(Action.SEARCH)


class Drones:
    """The drones of a search, in one episode after another.

    Args:
        names: the drones' names.
        scenario: the search.

    Attributes:
        cells: each drone's cell, y * N + x.
        chosen: each drone's last action.
        finders: the drones that have found a person in this episode.
        returns: each drone's sum of rewards.
        history: the last steps, oldest first: all drones' cells after the step, and their
            actions in it. Also holds the start.
    """

    def __init__(self, names: tuple[str, ...], scenario: Scenario) -> None:
        self._scheme = scenario.reward_scheme
        self._timestep_limit = scenario.timestep_limit
        self._names = names
        self._uneventful = dict.fromkeys(names, rules.uneventful_reward(self._scheme))
        self.start([])

    def start(self, cells: list[int]) -> None:
        """Start an episode with the drones in some cells."""
        self.cells = cells
        self.chosen = bytes([Action.IDLE]) * len(cells)
        self.finders: set[int] = set()
        self.returns = [0.0] * len(cells)
        self.history: deque[tuple[list[int], bytes]] = deque(
            [(cells, self.chosen)], maxlen=HISTORY_STEPS + 1
        )

    def resolve(
        self, chosen: bytes, targets: list[int], world: WorldState
    ) -> tuple[dict[str, float], Ending | None]:
        """Resolve the actions of a step: determine outcomes and rewards, move the drones.

        Args:
            chosen: each drone's action.
            targets: each drone's target cell, or OFF_GRID; `cells` itself if no drone moves.
            world: the world state, which resolves the searches.

        Returns:
            Each drone's reward, for reading only, and the ending, or None.
        """
        is_last = world.step == self._timestep_limit - 1
        crashed = targets is not self.cells and len({OFF_GRID, *targets}) <= len(targets)
        if crashed or is_last or _SEARCH in chosen:
            rewards, ending = self._resolve_events(chosen, targets, world, crashed, is_last)
            if OFF_GRID in targets:  # a drone that tries to leave the grid stays
                pairs = zip(self.cells, targets, strict=True)
                targets = [cell if target == OFF_GRID else target for cell, target in pairs]
        else:
            rewards, ending = self._uneventful, None
        self.chosen, self.cells = chosen, targets
        self.returns = [*map(add, self.returns, rewards.values())]
        self.history.append((targets, chosen))
        return rewards, ending

    def _resolve_events(
        self, chosen: bytes, targets: list[int], world: WorldState, crashed: bool, is_last: bool
    ) -> tuple[dict[str, float], Ending | None]:
        """`resolve` a step with searches, with crashes, or at the time limit."""
        finders: set[int] = set()
        observed: dict[int, float] = {}  # by searching drone: the probability of its cell
        if _SEARCH in chosen:
            pairs = enumerate(zip(self.cells, chosen, strict=True))
            # Before a step, no two drones share a cell.
            searches = {cell: drone for drone, (cell, action) in pairs if action == _SEARCH}
            observed = world.observed(searches)
            finders = world.search(searches)
        shared = rules.same_cell(targets) if crashed else set()
        rewards = self._uneventful.copy()
        for drone in range(len(targets)) if crashed or is_last else observed:
            rewards[self._names[drone]] = rules.reward(
                self._scheme,
                targets[drone] in shared,
                targets[drone] == OFF_GRID,
                drone in finders,
                is_last and world.is_rescue,
                drone in self.finders,
                drone in observed,
                observed.get(drone, 0.0),
                world.step,
                self._timestep_limit,
                self.returns[drone],
            )
        self.finders |= finders
        return rewards, rules.ending(
            not world.missing, world.is_covered, bool(shared), OFF_GRID in targets, is_last
        )

    def trails(self) -> list[list[int]]:
        """For each drone, its last cells, oldest first, the current one last."""
        recent = [cells for cells, _ in self.history][-TRAIL_STEPS - 1 :]
        return [*map(list, zip(*recent, strict=True))]

    def recent_searches(self) -> list[tuple[int, int]]:
        """The cells of the last searches, oldest first, each with the steps since then."""
        last = len(self.history) - 1
        return [
            (cell, last - step)
            for step, (cells, chosen) in enumerate(self.history)
            for cell, action in zip(cells, chosen, strict=True)
            if action == _SEARCH
        ]
