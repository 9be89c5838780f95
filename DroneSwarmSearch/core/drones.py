"""The drones of an episode: their cells and returns, and the outcomes of a step."""

from __future__ import annotations

from collections import deque
from operator import add

from DroneSwarmSearch.core import rules
from DroneSwarmSearch.core.frame import HISTORY_STEPS, TRAIL_STEPS
from DroneSwarmSearch.core.grid import OFF_GRID
from DroneSwarmSearch.core.rules import Action, Ending
from DroneSwarmSearch.core.scenario import Scenario
from DroneSwarmSearch.core.world import WorldState

_SEARCH = int(Action.SEARCH)


class Drones:
    """The drones of a search, in one episode after another.

    Attributes:
        cells: each drone's cell, y * N + x.
        chosen: each drone's last action.
        finders: the drones that have found a person in this episode.
        returns: each drone's sum of rewards.
        history: the last steps, oldest first, and the start: all drones' cells, and their actions.
    """

    def __init__(self, names: tuple[str, ...], scenario: Scenario) -> None:
        self._names = names
        self._rules = scenario.rules
        self._quiet = dict.fromkeys(names, self._rules.scheme.step)

    def start(self, cells: list[int]) -> None:
        """Start an episode with the drones in some cells."""
        self.cells = cells
        self.chosen = bytes([Action.IDLE]) * len(cells)
        self.finders: set[int] = set()
        self.returns = [0.0] * len(cells)
        self.history = deque([(cells, self.chosen)], maxlen=HISTORY_STEPS + 1)

    def resolve(
        self, chosen: bytes, targets: list[int], world: WorldState
    ) -> tuple[dict[str, float], Ending | None]:
        """Let the drones search and move, given each one's action and target cell or OFF_GRID.

        Returns each drone's reward, for reading only, and the ending or None.
        """
        if self._rules.crash != rules.END:
            targets = rules.arrivals(self.cells, targets, self._rules.crash)
        rewards = self._quiet
        ending = None
        if not rules.is_quiet(chosen, targets, world.step, self._rules.timestep_limit):
            rewards, ending = self._outcome(chosen, targets, world)
        if ending:  # a drone that tries to leave the grid stays
            moves = zip(self.cells, targets, strict=True)
            targets = [cell if target == OFF_GRID else target for cell, target in moves]
        self.chosen = chosen
        self.cells = targets
        self.returns = [*map(add, self.returns, rewards.values())]
        self.history.append((targets, chosen))
        return rewards, ending

    def _outcome(
        self, chosen: bytes, targets: list[int], world: WorldState
    ) -> tuple[dict[str, float], Ending | None]:
        """Let the drones search, and apply the rules."""
        found: set[int] = set()
        observed: dict[int, float] = {}
        if _SEARCH in chosen:
            searches: dict[int, list[int]] = {}
            for drone, (cell, action) in enumerate(zip(self.cells, chosen, strict=True)):
                if action == _SEARCH:
                    searches.setdefault(cell, []).append(drone)
            observed = world.observed(searches)
            found = world.search(searches)
        events = rules.StepEvents(
            targets=targets,
            observed=observed,
            found=found,
            found_before=self.finders,
            returns=self.returns,
            steps_before=world.step,
            all_found=not world.missing,
            covered=world.is_covered,
        )
        rewards, ending = rules.outcome(self._rules, events)
        self.finders |= found
        return dict(zip(self._names, rewards, strict=True)), ending

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
