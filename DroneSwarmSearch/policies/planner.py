"""A plan for the whole episode and all drones, made anew when it no longer holds.

With one person adrift a plan is all there is to a policy, since nothing is ever learnt but
that the search goes on (`planning.plan`). With several, a find is news: then the plan for
the rest of the episode is improved for those still missing.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch._internal.grid import Neighbours, grid_of
from DroneSwarmSearch.planning.chain import Chain
from DroneSwarmSearch.planning.paths import Path
from DroneSwarmSearch.planning.plan import Plan, Target, idle_paths
from DroneSwarmSearch.policies.belief_tracker import BeliefTracker
from DroneSwarmSearch.policies.greedy import PosteriorGreedyPolicy
from DroneSwarmSearch.policies.swarm import SwarmPolicy
from DroneSwarmSearch.rules import Action
from DroneSwarmSearch.scenario import Cell, Scenario

__all__ = ["PlannerPolicy"]

HORIZON = 500
"""Steps that are planned at most; what is beyond is planned when they are over."""

HASTE = 0.1
"""How much more a find in the first step is worth than one in the last."""

LEAST_GAIN = 5e-4
"""A round of improvements that gains less, as a share of a find's worth, is the last one."""

ROUNDS = 8
"""The most rounds for a plan made from nothing."""

SHORTEST = 3
"""Stretches of so few steps are still improved by themselves."""

STARTS = 32
"""The most plans that are begun at random, in small searches, where a plan is cheap."""

EFFORT = 400_000
"""The most that is spent on them: plans times drones times persons times steps times cells."""

LEAST_CHANCE = 0.05
"""Persons less likely to be found than this count as if they were so likely."""

PLANS_KEPT = 4096
"""Plans that are remembered for other searches that come to the same point."""

_Occasion = tuple[Any, ...]
"""When plans were made in a search, where the drones were and who was missing: with the
scenario this says all that a plan depends on."""


class PlannerPolicy(SwarmPolicy):
    """Plans the paths of all drones together, whatever matrix is shown.

    The first plan of a scenario takes seconds on a large grid; searches that begin in the
    same way share it. Plans are made from what the swarm knows itself (`BeliefTracker`), so
    they are the same whether the environment shows posteriors or not.

    Plans maximise the chance to find each person in time, and among such plans prefer the
    early finds (``HASTE``). Of several persons each counts in inverse proportion to its
    chance: this is where the product of the chances, of finding all of them, grows most.

    Args:
        scenario: the parameters of every search that the policy is going to steer.

    Raises:
        TypeError: `scenario` is no `Scenario`.
    """

    def __init__(self, scenario: Scenario) -> None:
        super().__init__(scenario)
        self._forecasts = scenario.forecasts()
        self._neighbours, self._positions = grid_of(scenario.grid_size)
        self._chains: dict[tuple[int, int], Chain] = {}
        self._chains_begin = -1
        self._plans: dict[_Occasion, list[Path]] = {}

    def prepare(self, drones_positions: object) -> None:
        """Make the first plan now, so that copies and pickles of the policy carry it.

        Args:
            drones_positions: every drone's cell (x, y) at the beginning of the episode.

        Raises:
            TypeError: they are no cells.
            ValueError: they are not as many as the drones, off the grid, or two are alike.
        """
        starts = self.scenario.drone_cells(drones_positions)
        self._renew(self.begin(), [self._positions[cell] for cell in starts])

    def begin(self) -> _Memory:
        return _Memory(BeliefTracker(self.scenario))

    def choose(self, memory: _Memory, cells: list[Cell], matrix: NDArray[np.float32]) -> list[int]:
        memory.knowledge.observe(matrix)
        if not memory.holds(self._numbers(cells)):
            self._renew(memory, cells)
        actions = memory.actions(self._neighbours)
        memory.knowledge.acted(cells, actions)
        return actions

    def _numbers(self, cells: Sequence[Cell]) -> list[int]:
        return [y * self.scenario.grid_size + x for x, y in cells]

    def _renew(self, memory: _Memory, cells: list[Cell]) -> None:
        """Give a search a plan from its present step on."""
        knowledge = memory.knowledge
        occasion = (*memory.occasion, knowledge.step, tuple(cells), knowledge.missing)
        paths = self._plans.get(occasion)
        if paths is None:
            if len(self._plans) == PLANS_KEPT:
                self._plans.clear()
            self._plans[occasion] = paths = self._plan(memory, self._numbers(cells))
        memory.occasion, memory.paths = occasion, paths
        memory.since, memory.missing = knowledge.step, knowledge.missing

    def _plan(self, memory: _Memory, starts: list[int]) -> list[Path]:
        knowledge, step = memory.knowledge, memory.knowledge.step
        steps = min(max(self.scenario.timestep_limit - step, 1), HORIZON)
        targets = [
            Target(self._chain(person, step, steps), knowledge.belief(person))
            for person in knowledge.missing
        ]
        worth = 1.0 + HASTE * (1.0 - np.arange(steps) / steps)

        def begun(paths: list[Path]) -> Plan:
            return Plan(targets, worth, step, paths)

        rest = memory.rest(starts)
        if rest is not None and len(rest[0].searches) == steps:
            plan = begun(rest)
            _weigh(plan)
            plan.improve(shortest=steps, least=LEAST_GAIN, rounds=1)
            return plan.paths
        greedy = begun(self._greedy_paths(knowledge, starts, steps))
        _weigh(greedy)
        plans, idle = [greedy], begun(idle_paths(starts, steps))
        if len(targets) == 1:  # for several, one plan takes long enough
            plans.append(idle)
        work = len(starts) * len(targets) * steps * self.scenario.grid_size**2
        rng = np.random.default_rng(0)
        for _ in range(min(STARTS, EFFORT // work)):
            plans.append(begun(idle.paths))
            plans[-1].scatter(rng)
        for plan in plans:
            plan.improve(shortest=SHORTEST, least=LEAST_GAIN, rounds=ROUNDS)
        return max(plans, key=Plan.value).paths

    def _greedy_paths(self, knowledge: BeliefTracker, starts: list[int], steps: int) -> list[Path]:
        """The paths of a greedy swarm that finds nobody: a plan like any other to begin with."""
        greedy, known = PosteriorGreedyPolicy(self.scenario), copy.deepcopy(knowledge)
        ways, searches = [starts], []
        for _ in range(steps):
            cells = [self._positions[cell] for cell in ways[-1]]
            actions = greedy.choose(known, cells, known.shown())
            ways.append(
                [
                    self._neighbours[cell][action]
                    for cell, action in zip(ways[-1], actions, strict=True)
                ]
            )
            searches.append([action == Action.SEARCH for action in actions])
        return [
            Path(np.array(way), np.array(searched))
            for way, searched in zip(
                zip(*ways, strict=True), zip(*searches, strict=True), strict=True
            )
        ]

    def _chain(self, person: int, step: int, steps: int) -> Chain:
        """A person's chain over the steps of a plan."""
        begin = step // HORIZON * HORIZON
        end = max(min(begin + 2 * HORIZON, self.scenario.timestep_limit), step + steps)
        if begin != self._chains_begin:
            self._chains.clear()
            self._chains_begin = begin
        chain = self._chains.get((person, end))
        if chain is None:
            chain = Chain(self._forecasts[person], self.scenario.detections[person], begin, end)
            self._chains[person, end] = chain
        return chain

    def __getstate__(self) -> dict[str, Any]:
        # Chains are quickly made anew and large.
        return {**self.__dict__, "_chains": {}, "_chains_begin": -1}


def _weigh(plan: Plan) -> None:
    """Let each person count in inverse proportion to the chance that the plan gives it."""
    if len(plan.targets) == 1:
        return
    chances = np.maximum(plan.chances(), LEAST_CHANCE)
    weights = (1.0 / chances) / np.mean(1.0 / chances)
    for target, weight in zip(plan.targets, weights.tolist(), strict=True):
        target.weight = weight


@dataclass
class _Memory:
    """A search under a plan.

    Attributes:
        knowledge: what is known in it.
        paths: of the drones, from step `since` on; shared between searches, never changed.
        since: the step in which the plan was made.
        missing: who was missing then.
        occasion: all occasions on which plans were made.
    """

    knowledge: BeliefTracker
    paths: list[Path] | None = None
    since: int = 0
    missing: tuple[int, ...] = ()
    occasion: _Occasion = ()

    def __deepcopy__(self, memo: dict[int, Any]) -> _Memory:
        return replace(self, knowledge=copy.deepcopy(self.knowledge, memo))

    @property
    def _place(self) -> int:
        return self.knowledge.step - self.since

    def holds(self, cells: list[int]) -> bool:
        """Whether there is a plan for this step, and the drones and the persons are as it says."""
        return self.knowledge.missing == self.missing and self.rest(cells) is not None

    def rest(self, cells: list[int]) -> list[Path] | None:
        """What is left of the plan, if the drones are where it says."""
        place = self._place
        if self.paths is None or place >= len(self.paths[0].searches):
            return None
        if any(path.cells[place] != cell for path, cell in zip(self.paths, cells, strict=True)):
            return None
        return [Path(path.cells[place:], path.searches[place:]) for path in self.paths]

    def actions(self, neighbours: Neighbours) -> list[int]:
        """What the plan says that the drones do in this step."""
        assert self.paths is not None
        place, actions = self._place, []
        for path in self.paths:
            here, there = path.cells[place : place + 2].tolist()
            if here == there:
                actions.append(int(Action.SEARCH if path.searches[place] else Action.IDLE))
            else:
                actions.append(neighbours[here].index(there))
        return actions
