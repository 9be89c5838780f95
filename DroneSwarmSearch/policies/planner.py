"""The planner: follows an open-loop plan (`planning.plan`), and replans after a find."""

from __future__ import annotations

import numpy as np

from DroneSwarmSearch._internal.progress import progress
from DroneSwarmSearch.planning.passes import Target
from DroneSwarmSearch.planning.paths import Path
from DroneSwarmSearch.planning.plan import Plan, Report, idle_paths
from DroneSwarmSearch.policies.belief_tracker import BeliefTracker
from DroneSwarmSearch.policies.greedy import ForecastGreedyPolicy, PosteriorGreedyPolicy
from DroneSwarmSearch.policies.planned import (
    HORIZON,
    PlannedPolicy,
    PlannedStep,
    searching_in_flight,
)
from DroneSwarmSearch.rules import Action
from DroneSwarmSearch.scenario import Cell, Scenario

EARLY_BONUS = 0.01
"""How much more a find in the first step is worth than one in the last, in the choice of paths; of
several plans, the one with the largest probability of success wins, without the bonus."""

MIN_GAIN, MAX_ROUNDS = 5e-4, 8
"""Improvement of an initial plan stops after a round that gains less, or after so many."""

MIN_LENGTH = 3
"""Length of the shortest path segments to improve, in steps."""

WORK, WORK_AFTER_FIND = 2.5e8, 2e6
"""The most work for a first plan, to improve the best initial plan and explore from it, and for a
plan after a find: about ten seconds, and a tenth of one."""

MAX_LENGTH_AFTER_FIND = 24
"""Length of the longest path segments to improve after a find."""

MAX_LENGTH_IN_FLIGHT = 48
"""Length of the longest path segments to improve for drones that search in flight."""

EXPLORED_ROUNDS = 500
"""Exploring takes at most as much work as this many rounds of improvement."""

RANDOM_STARTS, RANDOM_BUDGET = 32, 400_000
"""The most random initial plans, and the largest product of their number, drones, hypotheses, steps
and cells: about a second. Only small searches can afford them."""

FEW_DRONES = 4
"""The most drones for which idle drones are an initial plan, too."""


class PlannerPolicy(PlannedPolicy):
    """Plans the paths of all drones together, from its own beliefs (`BeliefTracker`).

    The first plan of a scenario takes seconds on a large grid; searches that begin in the same
    way share it. With tqdm installed, a bar shows the progress.

    A plan maximises the probability of success by the limit, with several persons its mean over
    those who are missing, and among nearly equal plans prefers early finds (``EARLY_BONUS``). Of
    persons with `survival`, it is the probability of finding them alive. With one person, a plan is
    never worse than the paths of `PosteriorGreedyPolicy` and `ForecastGreedyPolicy`. With several,
    it only lasts until the next find.

    Args:
        scenario: the parameters of every search to steer.
        in_flight: whether drones search in even steps and move in odd ones, which stands for
            drones that search while they fly and cross a cell in two steps.
    """

    def __init__(self, scenario: Scenario, *, in_flight: bool = False) -> None:
        super().__init__(scenario)
        self._in_flight = in_flight
        self._initial: list[PosteriorGreedyPolicy] = [PosteriorGreedyPolicy(scenario)]
        if not in_flight:  # where it finds no more, and takes minutes on large grids
            self._initial.append(ForecastGreedyPolicy(scenario))

    def prepare(self, drones_positions: object) -> None:
        """Make the first plan now, so that copies and pickles of the policy include it."""
        starts = self.scenario.drone_cells(drones_positions)
        self._replan(self.begin(), [self._positions[cell] for cell in starts])

    def plan(self, tracker: BeliefTracker, cells: list[Cell]) -> list[PlannedStep]:
        acts = [
            searching_in_flight(policy.actions) if self._in_flight else policy.actions
            for policy in self._initial
        ]
        initial = [self._paths(self.simulated(act, tracker, cells)[0]) for act in acts]
        with progress("planning", 1.0) as bar:
            return self._steps(self._improved(tracker, initial, bar))

    def _improved(
        self, tracker: BeliefTracker, initial: list[list[Path]], report: Report
    ) -> list[Path]:
        """The paths of a plan at least as successful as all initial ones."""
        step, steps = tracker.step, self.horizon(tracker)
        bonus = EARLY_BONUS if self.scenario.mission == "rescue" else 0.0
        worth = 1.0 + bonus * (1.0 - np.arange(steps) / steps)
        forecasts, detections = tracker.forecasts, self.scenario.detections
        missing, ahead = tracker.missing, range(step, step + steps)
        alive = np.array([[*map(self.scenario.situation[each].alive, ahead)] for each in missing])
        alive /= alive[:, 0].max() or 1.0  # relative, so that MIN_GAIN means the same
        targets = [
            Target(forecasts[person], detections[person], tracker.joint(person), worth * survival)
            for person, survival in zip(missing, alive, strict=True)
        ]

        def success(paths: list[Path]) -> float:
            return sum(float(each.sum()) for each in alive * Plan(targets, step, paths).found())

        best_initial = max(initial, key=success)
        idle = idle_paths([int(path.cells[0]) for path in best_initial], steps)
        work, max_length, perturbed = WORK_AFTER_FIND, MAX_LENGTH_AFTER_FIND, 0
        if step % HORIZON:
            initial = [best_initial]
        else:
            work, max_length = WORK, steps
            if self._in_flight:
                max_length = MAX_LENGTH_IN_FLIGHT
            elif len(idle) <= FEW_DRONES:
                initial = [*initial, idle]
            size = len(idle) * steps * sum(target.belief.size for target in targets)
            perturbed = min(RANDOM_STARTS, RANDOM_BUDGET // size)
        count, best = len(initial) + perturbed, None
        rng = np.random.default_rng(0)
        for number, paths in enumerate([*initial, *[idle] * perturbed]):

            def report_part(part: float, number: int = number) -> None:
                report((number + part) / count / 2)

            # Large, so only two exist at a time.
            plan = Plan(targets, step, paths, in_flight=self._in_flight)
            if number >= len(initial):
                plan.perturb(rng)
            plan.improve(
                min_length=MIN_LENGTH,
                min_gain=MIN_GAIN,
                max_rounds=MAX_ROUNDS,
                max_length=max_length,
                report=report_part,
            )
            if best is None or plan.value() > best.value():
                best = plan
        assert best is not None
        work = min(work - best.work, EXPLORED_ROUNDS * best.round_work)
        best.explore(rng, work, report=lambda part: report(0.5 + part / 2))
        return max(best.paths, best_initial, key=success)

    def _paths(self, steps: list[PlannedStep]) -> list[Path]:
        """Every drone's path in a plan."""
        size = self.scenario.grid_size
        cells = [[y * size + x for x, y in here] for here, _ in steps]
        last = zip(cells[-1], steps[-1][1], strict=True)
        cells.append([self._neighbours[cell][action] for cell, action in last])
        searches = [[action == Action.SEARCH for action in actions] for _, actions in steps]
        return [
            Path(*arrays) for arrays in zip(np.array(cells).T, np.array(searches).T, strict=True)
        ]

    def _steps(self, paths: list[Path]) -> list[PlannedStep]:
        """The plan along every drone's path."""
        steps: list[PlannedStep] = []
        for step, searches in enumerate(zip(*(path.searches for path in paths), strict=True)):
            here, ahead = np.array([path.cells[step : step + 2] for path in paths]).T.tolist()
            actions = [
                int(Action.SEARCH if searching else Action.IDLE)
                if cell == target
                else self._neighbours[cell].index(target)
                for searching, cell, target in zip(searches, here, ahead, strict=True)
            ]
            steps.append(([self._positions[cell] for cell in here], actions))
        return steps
