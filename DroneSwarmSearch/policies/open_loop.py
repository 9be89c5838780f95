"""Policies that plan until a find: no search before it changes what is known in any other way."""

from __future__ import annotations

import copy
from abc import abstractmethod
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from DroneSwarmSearch._internal.arrays import Floats, Singles
from DroneSwarmSearch._internal.cells import cell_number
from DroneSwarmSearch.core.grid import Cell, Grid
from DroneSwarmSearch.core.moves import moved, searched
from DroneSwarmSearch.core.rules import Action
from DroneSwarmSearch.core.scenario import Scenario
from DroneSwarmSearch.paths.best_paths import DronePath
from DroneSwarmSearch.policies.base import ALL, SwarmPolicy
from DroneSwarmSearch.policies.belief_tracker import BeliefTracker

HORIZON = 500  # the most steps to plan at once, which bounds time and memory
CACHED_PLANS = 4096  # the most plans to keep for other searches that reach the same situation
PlanStep = tuple[list[Cell], list[int]]  # every drone's cell, and its action there

Act = Callable[[BeliefTracker, list[Cell]], Sequence[int]]
"""Chooses the drones' actions, given the beliefs and their cells."""


@dataclass
class OpenLoopMemory:
    """A search and its plan, which searches share.

    `plan_keys`: step, missing persons and drones' cells at every plan made in this search. With
    the scenario, they determine the plan.
    """

    tracker: BeliefTracker
    plan: list[PlanStep] = field(default_factory=list)
    plan_keys: tuple[tuple[int, tuple[int, ...], tuple[Cell, ...]], ...] = ((0, (), ()),)

    def __deepcopy__(self, memo: dict[int, Any]) -> OpenLoopMemory:
        return replace(self, tracker=copy.deepcopy(self.tracker, memo))


class OpenLoopPolicy(SwarmPolicy):
    """A policy that makes a plan at the start, after a find, and where a drone is displaced.

    Searches that begin in the same way share a plan. Subclasses implement `plan`. In a search with
    a `radio_range`, such policies are yardsticks: they act on what all drones together know.
    """

    knows = ALL

    def __init__(self, scenario: Scenario) -> None:
        super().__init__(scenario)
        self._tracker = BeliefTracker(scenario)
        self._grid = Grid.of(scenario.grid_size)
        self._plans: dict[tuple[Any, ...], list[PlanStep]] = {}

    @abstractmethod
    def plan(
        self, tracker: BeliefTracker, cells: list[Cell], rest: Sequence[PlanStep] = ()
    ) -> list[PlanStep]:
        """A plan for the next steps (see `horizon`) from now on; `tracker` must not be updated.

        `rest` are the steps that are left of the plan until now, if the drones followed it.
        """

    def begin(self) -> OpenLoopMemory:
        return OpenLoopMemory(copy.deepcopy(self._tracker))

    def choose(self, memory: OpenLoopMemory, cells: list[Cell], matrix: Singles) -> Sequence[int]:
        tracker = memory.tracker
        tracker.observe(matrix)
        first, missing, _ = memory.plan_keys[-1]
        ahead = memory.plan[tracker.step - first :]
        if not ahead or missing != tracker.missing or ahead[0][0] != cells:
            self._replan(memory, cells)
            ahead = memory.plan
        return ahead[0][1]

    def learn(self, memory: OpenLoopMemory, searched: list[int], actions: list[int]) -> None:
        memory.tracker.learn(searched, actions)

    def _replan(self, memory: OpenLoopMemory, cells: list[Cell]) -> None:
        """Give a search a plan from its current step on."""
        tracker = memory.tracker
        rest = memory.plan[tracker.step - memory.plan_keys[-1][0] :]
        rest = rest if rest and rest[0][0] == cells else []
        now = tracker.step, tracker.missing, tuple(cells)
        memory.plan_keys = (*memory.plan_keys, now)
        if memory.plan_keys not in self._plans:
            plan = self.plan(tracker, cells, rest)
            if len(self._plans) == CACHED_PLANS:
                self._plans.clear()
            self._plans[memory.plan_keys] = plan
        memory.plan = self._plans[memory.plan_keys]

    def horizon(self, tracker: BeliefTracker) -> int:
        """The number of steps to plan: until the time limit, or `HORIZON`."""
        return min(max(self.scenario.timestep_limit - tracker.step, 1), HORIZON)

    def simulated(
        self, act: Act, tracker: BeliefTracker, cells: list[Cell]
    ) -> tuple[list[PlanStep], Floats]:
        """The next steps (see `horizon`) of a swarm that finds nobody, by the actions of `act`.

        Also returns the probability that they find each missing person, alive.
        """
        size = self.scenario.grid_size
        tracker = copy.deepcopy(tracker)
        unfound = np.ones(len(tracker.missing))
        dead = np.zeros(len(unfound))  # the probability that they find the person dead
        steps: list[PlanStep] = []
        for _ in range(self.horizon(tracker)):
            actions = [*map(int, act(tracker, cells))]
            steps.append((cells, actions))
            after = moved(self.scenario, [cell_number(x, y, size) for x, y in cells], actions)
            looked_at = searched(self.scenario, after, actions)
            for which, person in enumerate(tracker.missing if looked_at else ()):
                found = self._found(tracker, person, looked_at)
                alive = self.scenario.persons_to_find[person].alive(tracker.step)
                dead[which] += unfound[which] * found * (1.0 - alive)
                unfound[which] *= 1.0 - found
            tracker.learn(looked_at, actions)
            cells = [self._grid.positions[cell] for cell in after]
        return steps, 1.0 - unfound - dead

    def _found(self, tracker: BeliefTracker, person: int, cells: list[int]) -> float:
        """The probability that searches of cells, each as often as it occurs, find a person."""
        belief = tracker.belief(person).reshape(-1)
        detection = self.scenario.detections[person]
        times = Counter(cells)
        if len(times) == len(cells):
            return min(detection * float(belief[cells].sum()), 1.0)
        missed = 1.0 - detection
        return min(sum(float(belief[cell]) * (1.0 - missed**n) for cell, n in times.items()), 1.0)


def steps_of(paths: Sequence[DronePath], grid: Grid) -> list[PlanStep]:
    """The plan along every drone's path."""
    steps: list[PlanStep] = []
    for step, searches in enumerate(zip(*(path.searches for path in paths), strict=True)):
        here, ahead = np.array([path.cells[step : step + 2] for path in paths]).T.tolist()
        actions = [
            int(Action.SEARCH if searching else Action.IDLE)
            if cell == target
            else grid.neighbours[cell].index(target)
            for searching, cell, target in zip(searches, here, ahead, strict=True)
        ]
        steps.append(([grid.positions[cell] for cell in here], actions))
    return steps
