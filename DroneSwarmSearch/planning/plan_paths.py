"""Plans for all drones of a scenario: `plan_paths`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.arrays import Floats
from DroneSwarmSearch._internal.progress import progress
from DroneSwarmSearch.core.scenario import Scenario, checked_scenario
from DroneSwarmSearch.paths.best_paths import DronePath, path_beside_others
from DroneSwarmSearch.paths.joint_plan import JointPlan
from DroneSwarmSearch.paths.passes import Target

SECONDS = 120.0  # the default work for a plan

EARLY_BONUS = 0.01
"""How much more a find in the first step is worth than one in the last, in the choice of paths; of
several plans, the one with the largest probability of success wins, without the bonus."""


@dataclass(frozen=True)
class PathPlan:
    """Paths of all drones, and what they find.

    Attributes:
        paths: one for each drone; no two drones are ever in one cell, unless they may pass.
        by_time: the probability of success after 0 to L (the limit) steps: float64, shape (L + 1,),
            non-decreasing. With several persons, the probability that all are found; in the
            coverage mission, the mean.
    """

    paths: tuple[DronePath, ...]
    by_time: Floats


@dataclass(frozen=True)
class Known:
    """What is known of a search when a plan for its next steps is made.

    Attributes:
        scenario: the search.
        first: the plan's first step.
        steps: how many steps it has.
        missing: the numbers of the persons to find.
        beliefs: where each of them is, in the states of the drift model.
    """

    scenario: Scenario
    first: int
    steps: int
    missing: Sequence[int]
    beliefs: Sequence[Floats]

    @property
    def is_for_everyone(self) -> bool:
        """Whether the plan must find several persons; else, the mean over the persons counts."""
        return self.scenario.mission == "rescue" and len(self.missing) > 1

    def alive(self) -> Floats:
        """The relative probability that each person is alive in each step: (persons, steps)."""
        ahead = range(self.first, self.first + self.steps)
        persons = [self.scenario.persons_to_find[number] for number in self.missing]
        alive = np.array([[person.alive(step) for step in ahead] for person in persons])
        alive /= alive.max() or 1.0
        return alive

    def targets(self) -> list[Target]:
        """The persons to find; early finds are worth a little more."""
        bonus = EARLY_BONUS if self.scenario.mission == "rescue" else 0.0
        worth = 1.0 + bonus * (1.0 - np.arange(self.steps) / self.steps)
        forecasts = self.scenario.forecasts()
        detections = self.scenario.detections
        return [
            Target(forecasts[number], detections[number], belief, worth * alive)
            for number, belief, alive in zip(self.missing, self.beliefs, self.alive(), strict=True)
        ]

    def found(self, paths: Sequence[DronePath]) -> Floats:
        """The probability that paths find each person alive in each step: (persons, steps)."""
        return self.alive() * np.array(self.plan(self.targets(), paths).found())

    def plan(self, targets: Sequence[Target], paths: Sequence[DronePath]) -> JointPlan:
        """A plan for some targets, with the rules of the search."""
        return JointPlan(
            targets,
            self.first,
            paths,
            in_flight=self.scenario.search_in_flight,
            crash=self.scenario.crash,
        )

    def success_by_time(self, paths: Sequence[DronePath]) -> Floats:
        """The probability of success of paths after each step: (steps,)."""
        if not self.is_for_everyone:
            mean: Floats = self.found(paths).cumsum(axis=1).mean(axis=0)
            return mean
        total = np.zeros(self.steps)
        for weight, known in self._independent():
            total += weight * known.found(paths).cumsum(axis=1).prod(axis=0)
        return total

    def success(self, paths: Sequence[DronePath]) -> float:
        """The probability of success of paths."""
        if not self.is_for_everyone:
            return float(np.mean(self.found(paths).sum(axis=1)))
        given = [(weight, known.found(paths)) for weight, known in self._independent()]
        return sum(weight * float(np.prod(found.sum(axis=1))) for weight, found in given)

    def _independent(self) -> list[tuple[float, Known]]:
        """Cases in which persons drift independently, and their probabilities.

        Persons who drift together do so given the hypothesis, which is the layer of their mass.
        """
        if not self.scenario.shared_drift:
            return [(1.0, self)]
        cases = []
        for layer, weight in enumerate(self.beliefs[0].sum(axis=(1, 2)).tolist()):
            if weight > 0.0:
                given = [np.zeros_like(belief) for belief in self.beliefs]
                for alone, belief in zip(given, self.beliefs, strict=True):
                    alone[layer] = belief[layer] / belief[layer].sum()
                cases.append((weight, replace(self, beliefs=given)))
        return cases


def plan_paths(
    scenario: Scenario, drones_positions: object, *, seconds: float = SECONDS
) -> PathPlan:
    """Plan the paths of all drones together, for a search that finds nobody before they end.

    The policy "planner" follows such plans, and begins with the paths of other policies.

    Args:
        scenario: the search.
        drones_positions: every drone's start cell (x, y).
        seconds: the work to improve the plan, in seconds of CPU time on an idle core. The work is
            counted, not timed, so that a plan does not depend on the computer.

    Raises:
        TypeError: an argument has the wrong type.
        ValueError: an argument is out of its limits.
    """
    scenario = checked_scenario(scenario)
    starts = scenario.drone_cells(drones_positions)
    work = checks.real("seconds", seconds, 0.0)
    persons = range(len(scenario.persons_to_find))
    known = Known(
        scenario=scenario,
        first=0,
        steps=scenario.timestep_limit,
        missing=persons,
        beliefs=[model.joint(0) for model in scenario.forecasts()],
    )
    with progress("planning", 1.0) as on_progress:
        paths = improved(known, [_one_by_one(known, starts)], work, on_progress)
    return PathPlan(tuple(paths), np.append(0.0, known.success_by_time(paths)))


def improved(
    known: Known,
    initial: Sequence[list[DronePath]],
    seconds: float,
    on_progress: Callable[[float], object],
) -> list[DronePath]:
    """The paths of a plan that is at least as successful as all initial ones.

    Args:
        known: what is known of the search.
        initial: the drones' paths in some plans.
        seconds: the work to improve the best of these.
        on_progress: called with the share of the work that is done.
    """
    best = max(initial, key=known.success)
    targets = known.targets()
    if known.is_for_everyone:  # the gradient of the logarithm of the product
        found_by_best = known.plan(targets, best).found()
        for target, found in zip(targets, found_by_best, strict=True):
            target.worth /= found.sum() or 1.0
    plan = known.plan(targets, best)
    plan.anneal(seconds, np.random.default_rng(0), on_progress)
    return max([plan.paths, best], key=known.success)


def _one_by_one(known: Known, starts: Sequence[int]) -> list[DronePath]:
    """Paths that gain as much as possible, each given those before it."""
    paths: list[DronePath] = []
    waiting = [
        DronePath(np.full(known.steps + 1, start), np.zeros(known.steps, np.bool_))
        for start in starts
    ]
    for number, start in enumerate(starts):
        # The drones that have no path yet stand in their start cells for now.
        plan = known.plan(known.targets(), [*paths, *waiting[number:]])
        path = path_beside_others(
            plan.gains(),
            start,
            before=paths,
            waiting=starts[number + 1 :],
            crash=known.scenario.crash,
            in_flight=known.scenario.search_in_flight,
        )
        paths.append(path)
    return paths
