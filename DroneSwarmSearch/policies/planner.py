"""The planner: follows an open-loop plan for all drones, and replans after a find.

With one person, a plan for the whole episode suffices, because every search before the find has the
same outcome (`planning.plan`). With several persons, the planner makes a new plan after each find,
for those still missing.
"""

from __future__ import annotations

import copy
import sys
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch._internal.grid import Neighbours, grid_of
from DroneSwarmSearch._internal.progress import Progress
from DroneSwarmSearch.planning.exact import branch_and_bound
from DroneSwarmSearch.planning.passes import Target
from DroneSwarmSearch.planning.paths import Path
from DroneSwarmSearch.planning.plan import Plan, Report, idle_paths
from DroneSwarmSearch.policies.base import SwarmPolicy
from DroneSwarmSearch.policies.belief_tracker import BeliefTracker
from DroneSwarmSearch.policies.greedy import ForecastGreedyPolicy, PosteriorGreedyPolicy
from DroneSwarmSearch.policies.shared_plans import HORIZON, PlanMemory, SharedPlans
from DroneSwarmSearch.rules import Action
from DroneSwarmSearch.scenario import Cell, Scenario

__all__ = ["PlannerPolicy"]

EARLY_BONUS = 0.01
"""How much more a find in the first step is worth than one in the last. Of several plans, the one
with the largest probability of success by the limit is chosen, without the bonus."""

MIN_GAIN = 5e-4
"""Improvement of an initial plan stops after a round that gains less."""

MAX_ROUNDS = 8
"""The most rounds for an initial plan; few plans need all of them."""

MIN_LENGTH = 3
"""Length of the shortest path segments to improve, in steps."""

WORK, WORK_AFTER_FIND = 2.5e8, 2e6
"""The most work for a first plan, to improve the best initial plan and explore from it, and for
exploring after a find: about ten seconds, and a tenth of one. An evaluation plans after a find in
almost every step."""

MAX_LENGTH_AFTER_FIND = 24
"""Length of the longest path segments to improve after a find."""

EXPLORED_ROUNDS = 500
"""Exploring takes at most as much work as this many rounds of improvement."""

RANDOM_STARTS = 32
"""The most random initial plans. Only small searches can afford them, see `RANDOM_BUDGET`."""

RANDOM_BUDGET = 400_000
"""The largest product of random plans, drones, persons' hypotheses, steps and cells: about a
second."""

EXACT_ACTIONS = 16
"""The most actions of all drones together for which branch and bound follows."""

EXACT_NODES, EXACT_NODES_AFTER_FIND = 50_000, 500
"""The most partial plans that branch and bound extends: a few seconds."""

ROUNDING = 1e-9
"""Plans whose success differs by less are equally good."""

FEW_DRONES = 4
"""The most drones for which idle drones are an initial plan, too."""

INTERVALS, INTERVALS_AFTER_FIND = 15, 4
"""With several persons: how many times in an episode the drones are assumed to notice finds."""

REVISIONS = 3
"""With several persons: how many times the first plan is improved, each time for revised worths
of the finds."""

Floats = NDArray[np.float64]


class PlannerPolicy(SwarmPolicy):
    """Plans the paths of all drones together, regardless of the matrix shown.

    The first plan of a scenario takes seconds on a large grid; searches that begin in the same
    way share it. On a terminal, a bar on stderr shows the progress after two seconds. Plans follow
    from the planner's own beliefs (`BeliefTracker`), so they do not depend on whether the
    environment shows posteriors.

    With one person, a plan maximises the probability of success by the limit, and among nearly
    equal plans prefers early finds (``EARLY_BONUS``). It is never worse than the paths of
    `PosteriorGreedyPolicy` and `ForecastGreedyPolicy`. Small searches are solved by branch and
    bound.

    With several persons, a plan only lasts until the next find. It maximises an estimate of the
    probability of finding everybody in the end: a find in some step is worth the probability that
    a greedy swarm finds the others from there. In a coverage mission, a plan maximises the
    probability of success: the mean over persons, at any time.
    """

    def __init__(self, scenario: Scenario) -> None:
        super().__init__(scenario)
        self._neighbours, self._positions = grid_of(scenario.grid_size)
        self._is_rescue = scenario.mission == "rescue"
        self._greedy = PosteriorGreedyPolicy(scenario)
        self._forecast_greedy = ForecastGreedyPolicy(scenario)
        self._plans: SharedPlans[list[Path]] = SharedPlans()
        self._has_bar = True

    def prepare(self, drones_positions: object, report: Report | None = None) -> None:
        """Make the first plan now, so that copies and pickles of the policy include it.

        Args:
            drones_positions: every drone's start cell (x, y).
            report: called from time to time with the completed fraction of the work; the policy
                then never shows a progress bar of its own.

        Raises:
            TypeError: they are not cells.
            ValueError: their number differs from that of the drones, one is off the grid, or two
                are equal.
        """
        starts = self.scenario.drone_cells(drones_positions)
        self._has_bar = self._has_bar and report is None
        self._replan(self.begin(), [self._positions[cell] for cell in starts], report)

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

    def _replan(self, memory: _PlanMemory, cells: list[Cell], report: Report | None = None) -> None:
        """Give a search a plan from its current step on."""

        def make() -> list[Path]:
            with Progress("planning", 1.0, self._has_bar and sys.stderr.isatty()) as bar:
                return self._plan(memory, self._cell_numbers(cells), report or bar)

        self._plans.give(memory, cells, make)

    def _plan(self, memory: _PlanMemory, starts: list[int], report: Report) -> list[Path]:
        """The paths of a new plan."""
        tracker, step = memory.tracker, memory.tracker.step
        steps = min(max(self.scenario.timestep_limit - step, 1), HORIZON)
        initial = [self._greedy_paths(self._greedy, tracker, starts, steps)]
        if self._is_rescue and len(tracker.missing) > 1:
            return self._for_all(tracker, initial[0], report)
        initial.append(self._greedy_paths(self._forecast_greedy, tracker, starts, steps))
        rest = memory.rest(starts)
        if rest is not None and len(rest[0].searches) == steps:
            initial.append(rest)
        return self._for_one(tracker, initial, report)

    def _targets(self, tracker: BeliefTracker, steps: int) -> list[Target]:
        """The missing persons, with the same worth of every find."""
        models, detections = tracker.forecasts, self.scenario.detections
        worth = np.ones(steps)
        return [
            Target(models[person], detections[person], tracker.joint(person), worth)
            for person in tracker.missing
        ]

    def _for_one(
        self, tracker: BeliefTracker, initial: list[list[Path]], report: Report
    ) -> list[Path]:
        """A plan with a large probability of success, at least that of all initial ones.

        In a coverage mission, this is the mean over persons.
        """
        step, steps = tracker.step, len(initial[0][0].searches)
        by_limit = self._targets(tracker, steps)
        targets = self._targets(tracker, steps)
        if self._is_rescue:
            for target in targets:
                target.worth = 1.0 + EARLY_BONUS * (1.0 - np.arange(steps) / steps)

        def success(paths: list[Path]) -> float:
            return Plan(by_limit, step, paths).value()

        rng, best = np.random.default_rng(0), max(initial, key=success)
        if step % HORIZON:
            plan = Plan(targets, step, best)
            self._improve(plan, rng, WORK_AFTER_FIND, report, MAX_LENGTH_AFTER_FIND)
        else:
            plan = self._improved_from_many(targets, step, initial, rng, report)
        best = max(plan.paths, best, key=success)
        starts = [int(path.cells[0]) for path in best]
        if len(targets) == 1 and len(starts) * steps <= EXACT_ACTIONS:
            (target,) = by_limit
            optimum = branch_and_bound(
                target.chain,
                target.detection,
                target.belief,
                range(step, step + steps),
                starts,
                known=success(best) + ROUNDING,
                nodes=EXACT_NODES_AFTER_FIND if step else EXACT_NODES,
            )
            if optimum.paths is not None:
                return optimum.paths
        return best

    def _improved_from_many(
        self,
        targets: list[Target],
        step: int,
        initial: list[list[Path]],
        rng: np.random.Generator,
        report: Report,
    ) -> Plan:
        """The best improved plan of several initial ones."""
        steps = len(targets[0].worth)
        starts = [int(path.cells[0]) for path in initial[0]]
        idle = idle_paths(starts, steps)
        if len(starts) <= FEW_DRONES:
            initial = [*initial, idle]
        hypotheses = sum(len(target.belief) for target in targets)
        size = len(starts) * hypotheses * steps * self.scenario.grid_size**2
        perturbed = min(RANDOM_STARTS, RANDOM_BUDGET // size)
        count, best = len(initial) + perturbed, None
        for number, paths in enumerate([*initial, *[idle] * perturbed]):
            plan = Plan(targets, step, paths)  # large, so only two exist at a time
            if number >= len(initial):
                plan.perturb(rng)
            plan.improve(
                min_length=MIN_LENGTH,
                min_gain=MIN_GAIN,
                max_rounds=MAX_ROUNDS,
                report=_part(report, number / count / 2, (number + 1) / count / 2),
            )
            if best is None or plan.value() > best.value():
                best = plan
        assert best is not None
        work = min(WORK - best.work, EXPLORED_ROUNDS * best.round_work)
        best.explore(rng, work, report=_part(report, 0.5, 1.0))
        return best

    def _improve(
        self,
        plan: Plan,
        rng: np.random.Generator,
        work: float,
        report: Report,
        max_length: int | None = None,
    ) -> None:
        """Improve a plan and explore from it."""
        plan.improve(
            min_length=MIN_LENGTH,
            min_gain=MIN_GAIN,
            max_rounds=MAX_ROUNDS,
            max_length=max_length,
            report=_part(report, 0.0, 0.5),
        )
        work = min(work, EXPLORED_ROUNDS * plan.round_work)
        plan.explore(rng, work, report=_part(report, 0.5, 1.0))

    def _for_all(self, tracker: BeliefTracker, greedy: list[Path], report: Report) -> list[Path]:
        """A plan until the next find, with a large probability of finding all in the end."""
        step, steps = tracker.step, len(greedy[0].searches)
        if step % HORIZON:
            intervals, revisions = INTERVALS_AFTER_FIND, 1
            work, max_length = WORK_AFTER_FIND, MAX_LENGTH_AFTER_FIND
        else:
            intervals, revisions = INTERVALS, REVISIONS
            work, max_length = WORK / REVISIONS, steps
        stride = -(-steps // intervals)
        best, (targets, success) = greedy, self._worth_of_finds(tracker, greedy, stride)
        rng = np.random.default_rng(0)
        for number in range(revisions):
            plan = Plan(targets, step, best)
            part = _part(report, number / revisions, (number + 1) / revisions)
            self._improve(plan, rng, work, part, max_length)
            targets, new_success = self._worth_of_finds(tracker, plan.paths, stride)
            if new_success <= success:
                break
            best, success = plan.paths, new_success
        return best

    def _worth_of_finds(
        self, tracker: BeliefTracker, paths: list[Path], stride: int
    ) -> tuple[list[Target], float]:
        """What it is worth to find each person in each step of a plan.

        As if the drones noticed finds only every few steps, and then followed a greedy swarm.

        Args:
            tracker: of the plan's first step.
            paths: the plan.
            stride: the number of these steps.

        Returns:
            The targets, and an estimate of the probability of finding all persons. The worths
            are its derivatives, so that a plan of more value finds all more often.
        """
        steps = len(paths[0].searches)
        targets = self._targets(tracker, steps)
        plan = Plan(targets, tracker.step, paths)
        found, masses = plan.found(), plan.masses()
        twin, persons = copy.deepcopy(tracker), range(len(targets))
        for target in targets:
            target.worth = np.zeros(steps)
            target.unfound = np.zeros((steps + 1, *target.belief.shape))
        total = 0.0
        for begin in range(0, steps, stride):
            end = min(begin + stride, steps)
            self._fly(twin, paths, begin, end)
            within = [float(each[begin:end].sum()) for each in found]
            for first in persons:  # the one found in this interval
                others = [person for person in persons if person != first]
                later = self._found_later(twin, first, paths, end, steps)
                chances = {
                    person: within[person] / 2 + float(np.vdot(masses[person][end], values))
                    for person, values in zip(others, later, strict=True)
                }
                product = float(np.prod(list(chances.values())))
                total += within[first] * product
                targets[first].worth[begin:end] += product
                for person, values in zip(others, later, strict=True):
                    rest = within[first] * float(
                        np.prod([chances[other] for other in others if other != person])
                    )
                    targets[person].worth[begin:end] += rest / 2
                    unfound = targets[person].unfound
                    assert unfound is not None
                    unfound[end] += rest * values
        return targets, total

    def _fly(self, tracker: BeliefTracker, paths: list[Path], begin: int, end: int) -> None:
        """Update the beliefs for the steps of a plan without a find."""
        for step in range(begin, end):
            cells = [self._positions[int(path.cells[step])] for path in paths]
            actions = [Action.SEARCH if path.searches[step] else Action.IDLE for path in paths]
            tracker.update(cells, actions)

    def _found_later(
        self, tracker: BeliefTracker, first: int, paths: list[Path], step: int, steps: int
    ) -> list[Floats]:
        """The probability that a greedy swarm finds each other person, by the person's cell.

        Args:
            tracker: the beliefs at this step.
            first: the place of the person found among the missing ones.
            paths: the plan.
            step: the step of the plan.
            steps: the number of steps in the plan.
        """
        missing = tracker.missing
        twin = copy.deepcopy(tracker)
        twin.missing = tuple(person for person in missing if person != missing[first])
        if step == steps:
            return [np.zeros_like(twin.joint(person)) for person in twin.missing]
        starts = [int(path.cells[step]) for path in paths]
        onward = self._greedy_paths(self._greedy, twin, starts, steps - step)
        targets = self._targets(twin, steps - step)
        return Plan(targets, twin.step, onward).values()

    def _greedy_paths(
        self,
        greedy: PosteriorGreedyPolicy,
        tracker: BeliefTracker,
        starts: list[int],
        steps: int,
    ) -> list[Path]:
        """The paths of a greedy swarm that finds nobody, as an initial plan."""
        tracker = copy.deepcopy(tracker)
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


def _part(report: Report, begin: float, end: float) -> Report:
    """The report of a part of the work: from one fraction of the whole to another."""
    return lambda fraction: report(begin + fraction * (end - begin))


@dataclass
class _PlanMemory(PlanMemory[list[Path]]):
    """A search and its plan, one path for each drone."""

    def is_valid(self, cells: list[int]) -> bool:
        """Whether the plan covers this step, with these drones' cells and missing persons."""
        return self.tracker.missing == self.missing and self.rest(cells) is not None

    def rest(self, cells: list[int]) -> list[Path] | None:
        """The rest of the plan; None if there is none, or a drone is not where it should be."""
        done = self.tracker.step - self.first
        if self.plan is None or done >= len(self.plan[0].searches):
            return None
        if any(path.cells[done] != cell for path, cell in zip(self.plan, cells, strict=True)):
            return None
        return [Path(path.cells[done:], path.searches[done:]) for path in self.plan]

    def actions(self, neighbours: Neighbours) -> list[int]:
        """The drones' actions in this step."""
        assert self.plan is not None
        done, actions = self.tracker.step - self.first, []
        for path in self.plan:
            here, ahead = path.cells[done : done + 2].tolist()
            if here == ahead:
                actions.append(int(Action.SEARCH if path.searches[done] else Action.IDLE))
            else:
                actions.append(neighbours[here].index(ahead))
        return actions
