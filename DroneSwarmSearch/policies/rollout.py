"""The policy "rollout": paths over the next steps, in which a find also counts what it teaches."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from DroneSwarmSearch._internal.arrays import Singles
from DroneSwarmSearch._internal.cells import cell_number
from DroneSwarmSearch.core.grid import Cell, Grid
from DroneSwarmSearch.core.scenario import Scenario
from DroneSwarmSearch.paths.best_paths import DronePath, path_beside_others
from DroneSwarmSearch.policies.base import SwarmPolicy
from DroneSwarmSearch.policies.belief_tracker import BeliefTracker
from DroneSwarmSearch.policies.gains import SearchGains
from DroneSwarmSearch.policies.open_loop import PlanStep, steps_of

AHEAD = 30
"""Steps to look ahead: with half or twice as many, drones find no more of a wreck."""

KEPT = 5
"""Steps for which drones follow their paths before they look ahead again."""


@dataclass
class _RolloutMemory:
    """The beliefs, and the paths that the drones follow, from some step on."""

    tracker: BeliefTracker
    plan: list[PlanStep] = field(default_factory=list)
    first: int = 0
    missing: tuple[int, ...] = ()

    def __deepcopy__(self, memo: dict[int, Any]) -> _RolloutMemory:
        return replace(self, tracker=copy.deepcopy(self.tracker, memo))


class RolloutPolicy(SwarmPolicy):
    """Looks ahead along all paths of the next steps, and counts what a find teaches.

    The policy tracks the posterior itself. Drones choose in turn: each takes the path of the next
    `AHEAD` steps that gains most (`SearchGains`), by dynamic programming, given the searches of
    those before it. If persons drift together, a find counts what it teaches. So drones look for
    anybody soon, in directions that are not known to be wrong; greedy search stays where most
    persons may be.

    After ``KEPT`` steps, a find, or a displacement, the drones look ahead again. With a
    `radio_range`, each drone plans for itself and for those in range, from what it knows.

    For a decision, this is a rollout of every path instead of a few: until the first find, what
    drones learn does not depend on where the persons are, so all possible worlds are simulated at
    once (D. P. Bertsekas, Rollout, Policy Iteration, and Distributed Reinforcement Learning, 2020).
    """

    def __init__(self, scenario: Scenario) -> None:
        super().__init__(scenario)
        self._tracker = BeliefTracker(scenario)
        self._grid = Grid.of(scenario.grid_size)

    def begin(self) -> _RolloutMemory:
        return _RolloutMemory(copy.deepcopy(self._tracker))

    def learn(self, memory: _RolloutMemory, searched: list[int], actions: list[int]) -> None:
        memory.tracker.learn(searched, actions)

    def choose(self, memory: _RolloutMemory, cells: list[Cell], matrix: Singles) -> Sequence[int]:
        tracker = memory.tracker
        tracker.observe(matrix)
        now = tracker.step - memory.first
        is_current = now < min(KEPT, len(memory.plan)) and memory.missing == tracker.missing
        if not is_current or memory.plan[now][0] != cells:
            memory.plan = self._looked_ahead(tracker, cells)
            memory.first = tracker.step
            memory.missing = tracker.missing
            now = 0
        return memory.plan[now][1]

    def _looked_ahead(self, tracker: BeliefTracker, cells: list[Cell]) -> list[PlanStep]:
        """The drones' cells and actions in the next steps."""
        steps = max(min(AHEAD, self.scenario.timestep_limit - tracker.step), 1)
        gains = SearchGains(tracker, steps)
        starts = [cell_number(x, y, self.scenario.grid_size) for x, y in cells]
        paths: list[DronePath] = []
        for number, start in enumerate(starts):
            path = path_beside_others(
                gains.beside(paths),
                start,
                before=paths,
                waiting=starts[number + 1 :],
                crash=self.scenario.crash,
                in_flight=self.scenario.search_in_flight,
            )
            paths.append(path)
        return steps_of(paths, self._grid)
