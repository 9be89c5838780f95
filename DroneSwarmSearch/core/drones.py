"""The drones of an episode: their cells and returns, and the outcomes of a step."""

from __future__ import annotations

from collections import deque
from operator import add

import numpy as np

from DroneSwarmSearch._internal.arrays import Flags
from DroneSwarmSearch.core import rules
from DroneSwarmSearch.core.frame import HISTORY_STEPS, TRAIL_STEPS
from DroneSwarmSearch.core.grid import OFF_GRID
from DroneSwarmSearch.core.radio import LastHeard, hearing
from DroneSwarmSearch.core.rules import Action, Ending
from DroneSwarmSearch.core.scenario import Scenario
from DroneSwarmSearch.core.world import WorldState

_SEARCH = int(Action.SEARCH)


class Drones:
    """The drones of a search, in one episode after another.

    Attributes:
        cells: each drone's cell, y * N + x.
        searching: the drones that searched in the last step.
        heard: which drone heard which in the last step, see `radio.hearing`; None if drones always
            hear each other.
        last_heard: where each drone last heard each other one; None if `heard` is None.
        finders: the drones that have found a person in this episode.
        returns: each drone's sum of rewards.
        history: the last steps, oldest first, and the start: all drones' cells, and who searched.
    """

    def __init__(self, names: tuple[str, ...], scenario: Scenario) -> None:
        self._names = names
        self._rules = scenario.rules
        self._grid_size = scenario.grid_size
        self._radio_range = scenario.radio_range
        self._quiet = dict.fromkeys(names, self._rules.scheme.step)
        self.heard: Flags | None = None
        self.last_heard: LastHeard | None = None

    def start(self, cells: list[int]) -> None:
        """Start an episode with the drones in some cells."""
        self.cells = cells
        self.searching: list[int] = []
        self.finders: set[int] = set()
        self.returns = [0.0] * len(cells)
        self.history = deque([(cells, self.searching)], maxlen=HISTORY_STEPS + 1)
        if self._radio_range is not None:
            self.heard = hearing(np.array(cells), self._grid_size, self._radio_range)
            self.last_heard = LastHeard.at_start(np.array(cells))

    def resolve(
        self, chosen: bytes, targets: list[int], world: WorldState
    ) -> tuple[dict[str, float], Ending | None]:
        """Let the drones search and move, given each one's action and target cell or OFF_GRID.

        Returns each drone's reward, for reading only, and the ending or None.
        """
        crash = self._rules.crash
        arrived = targets
        if crash != rules.END:
            arrived = targets = rules.arrivals(self.cells, targets, crash)
        self.searching = []
        rewards = self._quiet
        ending = None
        if not self._rules.is_quiet(chosen, targets, world.step):
            if OFF_GRID in targets:
                arrived = rules.arrivals(self.cells, targets, crash)
            self.searching = self._searching(chosen)
            rewards, ending = self._outcome(targets, arrived, world)
        self.cells = arrived
        self.returns = [*map(add, self.returns, rewards.values())]
        self.history.append((arrived, self.searching))
        if self.last_heard is not None and self._radio_range is not None:
            cells = np.array(arrived)
            self.heard = hearing(cells, self._grid_size, self._radio_range)
            self.last_heard = self.last_heard.after(cells, self.heard)
        return rewards, ending

    def _searching(self, chosen: bytes) -> list[int]:
        """The drones that search, given all actions."""
        if self._rules.search_in_flight:
            return [*range(len(chosen))]
        return [drone for drone, action in enumerate(chosen) if action == _SEARCH]

    def _outcome(
        self, targets: list[int], arrived: list[int], world: WorldState
    ) -> tuple[dict[str, float], Ending | None]:
        """Let the drones search the cells in which they have arrived, and apply the rules."""
        found: set[int] = set()
        observed: dict[int, float] = {}
        if self.searching:
            searches: dict[int, list[int]] = {}
            for drone in self.searching:
                searches.setdefault(arrived[drone], []).append(drone)
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
            (cells[drone], last - step)
            for step, (cells, searching) in enumerate(self.history)
            for drone in searching
        ]
