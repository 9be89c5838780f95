"""Policies that plan until a find: no search before it changes what is known in any other way."""

from __future__ import annotations

import copy
from abc import abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch.grid import grid_of
from DroneSwarmSearch.policies.base import SwarmPolicy
from DroneSwarmSearch.policies.belief_tracker import BeliefTracker
from DroneSwarmSearch.rules import Action
from DroneSwarmSearch.scenario import Cell, Scenario

__all__ = ["PlannedPolicy", "PlannedSearch", "PlannedStep", "Report"]

HORIZON = 500
"""The most steps to plan at once, which bounds time and memory."""

CACHED_PLANS = 4096
"""The most plans to keep for other searches that reach the same situation."""

PlannedStep = tuple[list[Cell], list[int]]
"""Every drone's cell, and its action there."""

Report = Callable[[float], None]
"""Is called from time to time with the completed fraction of some work."""


@dataclass
class PlannedSearch:
    """A search and its plan.

    Attributes:
        tracker: the beliefs.
        plan: the steps of the plan; shared between searches, never changed.
        first: the step in which the plan begins.
        missing: the persons missing at that step.
        situations: step, drones' cells and missing persons at every plan made in this search. With
            the scenario, they determine the plan.
    """

    tracker: BeliefTracker
    plan: list[PlannedStep] = field(default_factory=list)
    first: int = 0
    missing: tuple[int, ...] = ()
    situations: tuple[Any, ...] = ()

    def __deepcopy__(self, memo: dict[int, Any]) -> PlannedSearch:
        return replace(self, tracker=copy.deepcopy(self.tracker, memo))

    def actions(self, cells: list[Cell]) -> list[int] | None:
        """The plan's actions in this step; None if it is over, or was made for something else."""
        done = self.tracker.step - self.first
        if self.tracker.missing != self.missing or done >= len(self.plan):
            return None
        expected, actions = self.plan[done]
        return actions if expected == cells else None


class PlannedPolicy(SwarmPolicy):
    """A policy that makes a plan at the start, after a find, and where a drone is displaced.

    Searches that begin in the same way share a plan. Subclasses implement `plan`.
    """

    def __init__(self, scenario: Scenario) -> None:
        super().__init__(scenario)
        self._tracker = BeliefTracker(scenario)
        self._neighbours, self._positions = grid_of(scenario.grid_size)
        self._plans: dict[tuple[Any, ...], list[PlannedStep]] = {}

    @abstractmethod
    def plan(
        self, tracker: BeliefTracker, cells: list[Cell], report: Report | None
    ) -> list[PlannedStep]:
        """A plan for the next steps, see `horizon`.

        Args:
            tracker: the beliefs now; do not update it.
            cells: every drone's (x, y).
            report: as for `PlannerPolicy.prepare`.
        """

    def begin(self) -> PlannedSearch:
        return PlannedSearch(copy.deepcopy(self._tracker))

    def choose(
        self, memory: PlannedSearch, cells: list[Cell], matrix: NDArray[np.float32]
    ) -> Sequence[int]:
        memory.tracker.observe(matrix)
        actions = memory.actions(cells)
        if actions is None:
            self._replan(memory, cells)
            actions = memory.plan[0][1]
        memory.tracker.update(cells, actions)
        return actions

    def _replan(
        self, memory: PlannedSearch, cells: list[Cell], report: Report | None = None
    ) -> None:
        """Give a search a plan from its current step on."""
        tracker = memory.tracker
        situations = (*memory.situations, tracker.step, tuple(cells), tracker.missing)
        if situations not in self._plans:
            plan = self.plan(tracker, cells, report)
            if len(self._plans) == CACHED_PLANS:
                self._plans.clear()
            self._plans[situations] = plan
        memory.plan, memory.situations = self._plans[situations], situations
        memory.first, memory.missing = tracker.step, tracker.missing

    def horizon(self, tracker: BeliefTracker) -> int:
        """The number of steps to plan: until the time limit, or `HORIZON`."""
        return min(max(self.scenario.timestep_limit - tracker.step, 1), HORIZON)

    def simulated(
        self,
        act: Callable[[BeliefTracker, list[Cell]], Sequence[int]],
        tracker: BeliefTracker,
        cells: list[Cell],
    ) -> tuple[list[PlannedStep], NDArray[np.float64]]:
        """The next steps of a swarm that finds nobody.

        Args:
            act: the drones' actions, given the beliefs and their cells.
            tracker: the beliefs now; not updated.
            cells: every drone's (x, y).

        Returns:
            The steps, see `horizon`, and the probability that they find each missing person.
        """
        tracker, unfound = copy.deepcopy(tracker), np.ones(len(tracker.missing))
        steps: list[PlannedStep] = []
        for _ in range(self.horizon(tracker)):
            actions = [*map(int, act(tracker, cells))]
            steps.append((cells, actions))
            numbers = [y * self.scenario.grid_size + x for x, y in cells]
            moved = [*zip(numbers, actions, strict=True)]
            searched = [cell for cell, action in moved if action == Action.SEARCH]
            if searched:
                chances = [tracker.chance_of_find(each, searched) for each in tracker.missing]
                unfound *= 1.0 - np.array(chances)
            tracker.update(cells, actions)
            cells = [self._positions[self._neighbours[cell][action]] for cell, action in moved]
        return steps, 1.0 - unfound
