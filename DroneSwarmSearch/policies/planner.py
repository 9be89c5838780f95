"""The planner: follows an open-loop plan (`paths.joint_plan`), and replans after a find."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.cells import cell_number
from DroneSwarmSearch._internal.progress import progress
from DroneSwarmSearch.core.grid import Cell
from DroneSwarmSearch.core.moves import moved, searched
from DroneSwarmSearch.core.rules import Action
from DroneSwarmSearch.core.scenario import Scenario
from DroneSwarmSearch.paths.best_paths import DronePath
from DroneSwarmSearch.planning.plan_paths import SECONDS, Known, improved
from DroneSwarmSearch.policies.base import SwarmPolicy
from DroneSwarmSearch.policies.belief_tracker import BeliefTracker
from DroneSwarmSearch.policies.greedy import (
    ForecastGreedyPolicy,
    GreedyPolicy,
    PosteriorGreedyPolicy,
)
from DroneSwarmSearch.policies.imitation import ImitationPolicy
from DroneSwarmSearch.policies.open_loop import (
    HORIZON,
    Act,
    OpenLoopPolicy,
    PlanStep,
    steps_of,
)
from DroneSwarmSearch.policies.patterns import (
    CreepingLinePolicy,
    ExpandingSquarePolicy,
    ParallelSweepPolicy,
    SectorSearchPolicy,
)

AFTER_FIND = 0.005  # the work for a plan after a find, as a fraction of that for the first plan

INITIAL = (
    GreedyPolicy,
    ParallelSweepPolicy,
    CreepingLinePolicy,
    ExpandingSquarePolicy,
    SectorSearchPolicy,
)
"""Policies whose paths are initial plans before the first step, besides those after a find."""


class PlannerPolicy(OpenLoopPolicy):
    """Plans the paths of all drones together, from its own beliefs (`BeliefTracker`).

    The first plan of a scenario takes about as long as `seconds` says, and the paths of the other
    policies that it begins with; searches that begin in the same way share it. With tqdm
    installed, a bar shows the progress. The work is counted, not timed, so that a plan does not
    depend on the computer.

    A plan maximises the probability of success by the limit, and among nearly equal plans prefers
    early finds. Of persons with `survival`, it is the probability of finding them
    alive. With one person and up to ``HORIZON`` steps, a plan is never worse than the paths of any
    other policy. With several persons, a plan lasts until the next find. Then the next one begins
    with the rest of the old one.

    Args:
        scenario: the parameters of every search to steer.
        seconds: the work to improve a plan, in seconds of CPU time on an idle core; a busy one
            takes up to twice as long.

    Raises:
        TypeError: `scenario` is not a `Scenario`, or `seconds` is not a number.
        ValueError: `seconds` is negative.
    """

    def __init__(self, scenario: Scenario, *, seconds: float = SECONDS) -> None:
        super().__init__(scenario)
        self._seconds = checks.real("seconds", seconds, 0.0)
        self._acts: list[Act] = [
            PosteriorGreedyPolicy(scenario).actions,
            ForecastGreedyPolicy(scenario).actions,
        ]
        self._network = ImitationPolicy(scenario)

    def prepare(self, drones_positions: object) -> None:
        """Make the first plan now, so that copies and pickles of the policy include it."""
        starts = self.scenario.drone_cells(drones_positions)
        self._replan(self.begin(), [self._grid.positions[cell] for cell in starts])

    def plan(
        self, tracker: BeliefTracker, cells: list[Cell], rest: Sequence[PlanStep] = ()
    ) -> list[PlanStep]:
        initial = [self._paths(steps) for steps in self._initial(tracker, cells)]
        if rest and len(rest) == len(initial[0][0].searches):
            initial.append(self._paths(rest))
        seconds = self._seconds
        if tracker.step % HORIZON:
            seconds *= AFTER_FIND
        with progress("planning", 1.0) as on_progress:
            paths = improved(self._known(tracker), initial, seconds, on_progress)
        return steps_of(paths, self._grid)

    def _initial(self, tracker: BeliefTracker, cells: list[Cell]) -> list[list[PlanStep]]:
        """The paths of other policies."""
        acts = [*self._acts]
        if tracker.step == 0:
            acts += [_acting(kind(self.scenario)) for kind in INITIAL]
        plans = [self.simulated(act, tracker, cells)[0] for act in acts]
        return [*plans, self._network.plan(tracker, cells)]

    def _known(self, tracker: BeliefTracker) -> Known:
        """What the tracker knows, for a plan from now on."""
        return Known(
            scenario=self.scenario,
            first=tracker.step,
            steps=self.horizon(tracker),
            missing=tracker.missing,
            beliefs=[tracker.joint(person) for person in tracker.missing],
        )

    def _paths(self, steps: Sequence[PlanStep]) -> list[DronePath]:
        """Every drone's path in a plan."""
        size = self.scenario.grid_size
        cells = [[cell_number(x, y, size) for x, y in here] for here, _ in steps]
        cells.append(moved(self.scenario, cells[-1], steps[-1][1]))
        in_flight = self.scenario.search_in_flight
        searches = [
            [in_flight or action == Action.SEARCH for action in actions] for _, actions in steps
        ]
        return [
            DronePath(*arrays)
            for arrays in zip(np.array(cells).T, np.array(searches).T, strict=True)
        ]


def _acting(policy: SwarmPolicy) -> Act:
    """Choose the actions of a policy, from the first step of a search on."""
    memory = policy.begin()
    scenario = policy.scenario
    latest: list[int] = []

    def act(tracker: BeliefTracker, cells: list[Cell]) -> list[int]:
        if latest:
            numbers = [cell_number(x, y, scenario.grid_size) for x, y in cells]
            policy.learn(memory, searched(scenario, numbers, latest), latest)
        latest[:] = map(int, policy.choose(memory, cells, tracker.matrix()))
        return [*latest]

    return act
