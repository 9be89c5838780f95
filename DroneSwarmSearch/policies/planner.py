"""The planner: follows an open-loop plan for all drones, and replans after a find.

With one person, a plan for the whole episode suffices, because every search before the find has the
same outcome (`planning.plan`). With several persons, the planner improves the rest of its plan
after each find, for those still missing.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch._internal.grid import Neighbours, grid_of
from DroneSwarmSearch.drift.markov_chain import MarkovChain
from DroneSwarmSearch.planning.paths import Path
from DroneSwarmSearch.planning.plan import Plan, Target, idle_paths
from DroneSwarmSearch.policies.base import SwarmPolicy
from DroneSwarmSearch.policies.belief_tracker import BeliefTracker
from DroneSwarmSearch.policies.greedy import PosteriorGreedyPolicy
from DroneSwarmSearch.rules import Action
from DroneSwarmSearch.scenario import Cell, Scenario

__all__ = ["PlannerPolicy"]

HORIZON = 500
"""The most steps to plan at once, which bounds time and memory; longer episodes are planned in
parts."""

EARLY_BONUS = 0.1
"""How much more a find in the first step is worth than one in the last, in a rescue."""

MIN_GAIN = 5e-4
"""Improvement stops after a round that gains less, relative to the worth of a find."""

MAX_ROUNDS = 8
"""The most rounds for a new plan; few plans need all of them."""

MIN_LENGTH = 3
"""Length of the shortest path segments to improve, in steps."""

RANDOM_STARTS = 32
"""The most random initial plans. Only small searches can afford them, see `RANDOM_BUDGET`."""

RANDOM_BUDGET = 400_000
"""The largest product of random plans, drones, persons' hypotheses, steps and cells: about a
second."""

MIN_PROBABILITY = 0.05
"""Lower limit on a person's probability of being found, for the weights."""

CACHED_PLANS = 4096
"""The most plans to keep for other searches that reach the same situation."""

_PlanKey = tuple[Any, ...]
"""Step, drones' cells and missing persons at every plan made in a search. With the scenario it
determines the plan."""


class PlannerPolicy(SwarmPolicy):
    """Plans the paths of all drones together, regardless of the matrix shown.

    The first plan of a scenario takes seconds on a large grid; searches that begin in the same
    way share it. Plans follow from the planner's own beliefs (`BeliefTracker`), so they do not
    depend on whether the environment shows posteriors.

    A plan maximises the probability of finding each person in time, with a slight preference for
    early finds (``EARLY_BONUS``). With several persons each is weighted by the inverse of their
    probability of being found, which is the gradient direction of the product of all. In a coverage
    mission, a plan maximises the probability of success: the mean over persons, at any time.
    """

    def __init__(self, scenario: Scenario) -> None:
        super().__init__(scenario)
        self._neighbours, self._positions = grid_of(scenario.grid_size)
        self._is_rescue = scenario.mission == "rescue"
        self._chains: dict[int, list[MarkovChain]] = {}  # for the latest `HORIZON` steps
        self._plans: dict[_PlanKey, list[Path]] = {}

    def prepare(self, drones_positions: object) -> None:
        """Make the first plan now, so that copies and pickles of the policy include it.

        Args:
            drones_positions: every drone's start cell (x, y).

        Raises:
            TypeError: they are not cells.
            ValueError: their number differs from that of the drones, one is off the grid, or two
                are equal.
        """
        starts = self.scenario.drone_cells(drones_positions)
        self._replan(self.begin(), [self._positions[cell] for cell in starts])

    def begin(self) -> _PlanMemory:
        return _PlanMemory(BeliefTracker(self.scenario))

    def choose(
        self, memory: _PlanMemory, cells: list[Cell], matrix: NDArray[np.float32]
    ) -> list[int]:
        memory.tracker.observe(matrix)
        if not memory.is_valid(self._cell_numbers(cells)):
            self._replan(memory, cells)
        actions = memory.actions(self._neighbours)
        memory.tracker.update(cells, actions)
        return actions

    def _cell_numbers(self, cells: Sequence[Cell]) -> list[int]:
        return [y * self.scenario.grid_size + x for x, y in cells]

    def _replan(self, memory: _PlanMemory, cells: list[Cell]) -> None:
        """Give a search a plan from its present step on."""
        tracker = memory.tracker
        key = (*memory.key, tracker.step, tuple(cells), tracker.missing)
        paths = self._plans.get(key)
        if paths is None:
            if len(self._plans) == CACHED_PLANS:
                self._plans.clear()
            self._plans[key] = paths = self._plan(memory, self._cell_numbers(cells))
        memory.key, memory.paths = key, paths
        memory.first, memory.missing = tracker.step, tracker.missing

    def _plan(self, memory: _PlanMemory, starts: list[int]) -> list[Path]:
        """The paths of a new plan, improved from the rest of the old one if that is possible."""
        tracker, step = memory.tracker, memory.tracker.step
        steps = min(max(self.scenario.timestep_limit - step, 1), HORIZON)
        part = step // HORIZON
        if part not in self._chains:  # release the matrices of other parts
            self._chains = {part: [MarkovChain(forecast) for forecast in tracker.forecasts]}
        chains, detections = self._chains[part], self.scenario.detections
        targets = [
            Target(chains[person], detections[person], tracker.joint(person))
            for person in tracker.missing
        ]
        bonus = EARLY_BONUS if self._is_rescue else 0.0
        worth = 1.0 + bonus * (1.0 - np.arange(steps) / steps)

        def plan_of(paths: list[Path]) -> Plan:
            return Plan(targets, worth, step, paths)

        rest = memory.rest(starts)
        if rest is not None and len(rest[0].searches) == steps:
            plan = plan_of(rest)
            self._set_weights(plan)
            plan.improve(min_length=MIN_LENGTH, min_gain=MIN_GAIN, max_rounds=1)
            return plan.paths
        greedy = plan_of(self._greedy_paths(tracker, starts, steps))
        self._set_weights(greedy)
        plans, idle = [greedy], plan_of(idle_paths(starts, steps))
        if len(targets) == 1:  # several persons take long enough with one plan
            plans.append(idle)
        hypotheses = sum(len(target.belief) for target in targets)
        work = len(starts) * hypotheses * steps * self.scenario.grid_size**2
        rng = np.random.default_rng(0)
        for _ in range(min(RANDOM_STARTS, RANDOM_BUDGET // work)):
            plans.append(plan_of(idle.paths))
            plans[-1].perturb(rng)
        for plan in plans:
            plan.improve(min_length=MIN_LENGTH, min_gain=MIN_GAIN, max_rounds=MAX_ROUNDS)
        return max(plans, key=Plan.value).paths

    def _greedy_paths(self, tracker: BeliefTracker, starts: list[int], steps: int) -> list[Path]:
        """The paths of a greedy swarm that finds nobody, as an initial plan."""
        greedy, tracker = PosteriorGreedyPolicy(self.scenario), copy.deepcopy(tracker)
        cells, searches = [starts], []
        for _ in range(steps):
            positions = [self._positions[cell] for cell in cells[-1]]
            actions = greedy.choose(tracker, positions, tracker.matrix())
            cells.append(
                [
                    self._neighbours[cell][action]
                    for cell, action in zip(cells[-1], actions, strict=True)
                ]
            )
            searches.append([action == Action.SEARCH for action in actions])
        return [
            Path(*arrays) for arrays in zip(np.array(cells).T, np.array(searches).T, strict=True)
        ]

    def _set_weights(self, plan: Plan) -> None:
        """Weight every person by the inverse of the plan's probability of finding them."""
        if len(plan.targets) == 1 or not self._is_rescue:
            return
        probabilities = np.maximum(plan.success_probabilities(), MIN_PROBABILITY)
        weights = (1.0 / probabilities) / np.mean(1.0 / probabilities)
        for target, weight in zip(plan.targets, weights.tolist(), strict=True):
            target.weight = weight


@dataclass
class _PlanMemory:
    """A search and its plan.

    Attributes:
        tracker: the beliefs.
        paths: the plan, one path for each drone; shared between searches, never changed.
        first: the step in which the plan was made.
        missing: the persons missing at that step.
        key: the plan's key in the cache.
    """

    tracker: BeliefTracker
    paths: list[Path] | None = None
    first: int = 0
    missing: tuple[int, ...] = ()
    key: _PlanKey = ()

    def __deepcopy__(self, memo: dict[int, Any]) -> _PlanMemory:
        return replace(self, tracker=copy.deepcopy(self.tracker, memo))

    def is_valid(self, cells: list[int]) -> bool:
        """Whether the plan covers this step, with these drones' cells and missing persons."""
        return self.tracker.missing == self.missing and self.rest(cells) is not None

    def rest(self, cells: list[int]) -> list[Path] | None:
        """The rest of the plan; None if there is none, or a drone is not where it should be."""
        done = self.tracker.step - self.first
        if self.paths is None or done >= len(self.paths[0].searches):
            return None
        if any(path.cells[done] != cell for path, cell in zip(self.paths, cells, strict=True)):
            return None
        return [Path(path.cells[done:], path.searches[done:]) for path in self.paths]

    def actions(self, neighbours: Neighbours) -> list[int]:
        """The drones' actions in this step."""
        assert self.paths is not None
        done, actions = self.tracker.step - self.first, []
        for path in self.paths:
            here, ahead = path.cells[done : done + 2].tolist()
            if here == ahead:
                actions.append(int(Action.SEARCH if path.searches[done] else Action.IDLE))
            else:
                actions.append(neighbours[here].index(ahead))
        return actions
