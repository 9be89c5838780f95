"""An upper bound on the probability of success (POS) of any policy: a Lagrangian dual bound.

Until the person is found, any policy follows a random set of drone paths. A set that searches a
trajectory of the person k times finds the person there with 1 - (1 - q)^k, which is at most the
sum of the drones' credits along the trajectory (see `memory`). Let Z be the mean of this sum over
the policy's sets, N the mean number of searches, and g the concave function that joins
1 - (1 - q)^k at whole k by straight lines. By Jensen's inequality,

    P(found) <= E[min(Z, g(N))] <= max E[min(Z, g(N))]  over all mixtures of the drones' paths.

The Frank-Wolfe method (`frank_wolfe`) solves this concave problem and bounds its maximum. The
expectation is over all trajectories if there are few, otherwise over a sample: then a Chernoff
bound covers the error of the best policy's mean success on it, and a union bound (Bonferroni) over
the persons and the numbers of steps makes all bounds hold together. If q < 1, the larger function
1 - (1 - q)^s of the effort s gives another bound, without a sample; the smaller one is returned.
Finding all of several persons is at most as likely as finding the one who is hardest to find; in a
coverage mission, the bound is the mean over persons. `Person.survival` is left out: who is found
alive is found, so the bound also holds for finding alive.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.arrays import Floats
from DroneSwarmSearch.drift.model import DriftModel
from DroneSwarmSearch.planning.frank_wolfe import Solution, frank_wolfe
from DroneSwarmSearch.planning.memory import RememberingDrones
from DroneSwarmSearch.planning.objectives import MarkovChainObjective, Mixture, TrajectoryObjective
from DroneSwarmSearch.planning.paths import Path, best_paths, values_to_go
from DroneSwarmSearch.planning.trajectories import (
    Trajectories,
    chernoff_bound,
    enumerate_trajectories,
    equally_likely,
    sample_trajectories,
)
from DroneSwarmSearch.scenario import Scenario, checked_scenario

SAMPLE = 65536
"""Trajectories in a sample; with one person, sampling adds at most 0.9 percentage points."""

CONFIDENCE = 0.999
"""Probability that a sampled bound holds, for all persons and numbers of steps together."""

HORIZONS = 12
"""Numbers of steps for which the bound is computed; the others use the next larger one's."""

WORK, TRAJECTORIES_TO_MEASURE = 6e7, 8192
"""The most work for the best paths, in values to update, estimated from some trajectories."""

MOST_MEMORY, MEMORY_BEFORE = 5, 2
"""The most remembered actions, for the time limit (6 take gigabytes) and for fewer steps."""

MOST_CELLS = 2**28
"""The most cells of all trajectories in a sample, which then take about 7 GB."""

ITERATIONS, ITERATIONS_BEFORE, CHAIN_ITERATIONS = 300, 20, 40
"""The most iterations for the time limit, for fewer steps, and without trajectories."""

MOST_PATHS = 64
"""The most sets of paths to start from for fewer steps."""


@dataclass(frozen=True)
class SuccessBound:
    """An upper bound on the probability that a policy finds all persons of a search.

    For a coverage mission, the bound is on the cumulative probability of success.

    Attributes:
        by_time: the bound after 0 to L (the limit) steps: float64, shape (L + 1,), non-decreasing.
        relaxed: the relaxation's value at step L, for the person with the smallest bound; in a
            coverage mission, the mean over persons.
        gap: the duality gap at step L, which `by_time` includes.
        confidence: probability that `by_time` holds at all steps; 1 without sampled trajectories.
    """

    by_time: Floats
    relaxed: float
    gap: float
    confidence: float

    @property
    def by_limit(self) -> float:
        """The bound at the time limit."""
        return float(self.by_time[-1])


def success_bound(
    scenario: Scenario,
    drones_positions: object,
    *,
    memory: int | None = None,
    sample: int = SAMPLE,
    gap: float = 0.004,
    horizons: int = HORIZONS,
) -> SuccessBound:
    """Bound the probability of success of every policy from above.

    Args:
        scenario: the search.
        drones_positions: every drone's start cell (x, y).
        memory: the number of actions K that drones remember, at most 5: more give a tighter bound
            and take longer. By default, as many as a fixed amount of work allows.
        sample: trajectories to draw for each person with too many to enumerate; times the time
            limit, at most 2**28.
        gap: the duality gap at which to stop, as a fraction of the bound.
        horizons: numbers of steps for which to solve the relaxation.

    Raises:
        TypeError: an argument has the wrong type.
        ValueError: an argument is out of its limits.
    """
    limit = checked_scenario(scenario).timestep_limit
    starts = scenario.drone_cells(drones_positions)
    checks.integer("sample", sample, 1, max(MOST_CELLS // limit, 1))
    checks.integer("horizons", horizons, 1)
    checks.real("gap", gap, 0)
    if memory is not None:
        checks.integer("memory", memory, 0, MOST_MEMORY)
    horizons = min(horizons, limit)
    ends = sorted({math.ceil(limit * k / horizons) for k in range(1, horizons + 1)}, reverse=True)
    persons = scenario.situation
    models = dict(zip(persons, scenario.forecasts(), strict=True))  # equal persons share a bound
    enumerated = [enumerate_trajectories(model, limit) for model in models.values()]
    sampled_bounds = len(ends) * enumerated.count(None)
    failure = (1.0 - CONFIDENCE) / max(1, sampled_bounds)
    curves, solutions = [], []
    for (person, model), every in zip(models.items(), enumerated, strict=True):
        relaxation = _Relaxation(
            model,
            person.probability_of_detection,
            starts,
            every or sample_trajectories(model, limit, sample),
            None if every else failure,
            gap,
        )
        curve, solution = relaxation.curve(ends, memory)
        curves.append(curve)
        solutions.append(solution)
    confidence = CONFIDENCE if sampled_bounds else 1.0
    values, gaps = [each.value for each in solutions], [each.gap for each in solutions]
    if scenario.mission == "coverage":
        shares = [persons.count(person) / len(persons) for person in models]
        by_time, relaxed, mean_gap = (
            np.average(each, axis=0, weights=shares) for each in (curves, values, gaps)
        )
        return SuccessBound(by_time, float(relaxed), float(mean_gap), confidence)
    hardest = min(range(len(curves)), key=lambda number: curves[number][-1])
    return SuccessBound(np.min(curves, axis=0), values[hardest], gaps[hardest], confidence)


def drone_paths(starts: Sequence[int], gains: Floats) -> tuple[float, Floats]:
    """The most that the drones can gain, and their searches of each cell; both (n, N, N)."""
    values, effort = values_to_go(gains, np.zeros(gains.shape[1:])), np.zeros_like(gains)
    which = np.zeros(len(starts), np.int64)
    cells, searches = best_paths(gains[:, None], values[:, None], np.array(starts), which)
    for path in zip(cells.T, searches.T, strict=True):
        _add_searches(effort, Path(*path))
    return float(values[0].reshape(-1)[list(starts)].sum()), effort


def _add_searches(effort: Floats, path: Path, share: float = 1.0) -> None:
    effort.reshape(len(effort), -1)[path.searches, path.cells[:-1][path.searches]] += share


def _filled(bounds: Mapping[int, float]) -> Floats:
    """The bound after every number of steps, from those for some, the largest one included."""
    curve = np.full(max(bounds) + 1, np.inf)
    curve[0] = 0.0
    curve[list(bounds)] = list(bounds.values())
    # More time never hurts, so a bound for more steps holds for fewer.
    return np.minimum.accumulate(curve[::-1])[::-1]


@dataclass
class _Relaxation:
    """The relaxation for one person.

    Attributes:
        detection: the probability of detection, q.
        starts: every drone's first cell, y * N + x.
        trajectories: all of the person's, or a sample.
        failure: the probability that a sampled bound may fail; None for all trajectories.
        gap: the duality gap at which to stop, as a fraction of the bound.
    """

    model: DriftModel
    detection: float
    starts: Sequence[int]
    trajectories: Trajectories
    failure: float | None
    gap: float

    def curve(self, ends: Sequence[int], memory: int | None) -> tuple[Floats, Solution]:
        """The bound after each number of steps, and the solution for the first of `ends`."""
        some = self.trajectories
        if memory is None:
            part = equally_likely(some.cells[:, :TRAJECTORIES_TO_MEASURE])
            memory = 0
            while memory < MOST_MEMORY and self._drones(part, memory + 1).work <= WORK:
                memory += 1
        objective = TrajectoryObjective(self._drones(some, memory))
        solution = self._solve(objective, ITERATIONS)
        bounds = {ends[0]: self._bound(solution, ends[0], objective.mixture)}
        # Fewer trajectories, remembered actions and iterations suffice for the curve's shape.
        if self.failure is not None:
            some = equally_likely(some.cells[:, : math.ceil(some.cells.shape[1] / 2)])
            self.trajectories = some
        drones = self._drones(some, min(memory, MEMORY_BEFORE))
        largest = sorted(objective.mixture, key=lambda each: -each[0])[:MOST_PATHS]
        total = sum(share for share, _ in largest)
        for end in ends[1:]:
            shorter = [
                (
                    share / total,
                    [Path(path.cells[: end + 1], path.searches[:end]) for path in paths],
                )
                for share, paths in largest
            ]
            objective = TrajectoryObjective(drones.until(end), shorter)
            relaxed = self._solve(objective, ITERATIONS_BEFORE)
            bounds[end] = self._bound(relaxed, end, objective.mixture)
        return _filled(bounds), solution

    def _drones(self, trajectories: Trajectories, memory: int) -> RememberingDrones:
        size = self.model.grid_size
        return RememberingDrones(trajectories, size, self.detection, self.starts, memory)

    def _solve(self, objective: TrajectoryObjective, iterations: int) -> Solution:
        """Maximise E[min(Z, g(N))]."""
        return frank_wolfe(
            objective,
            objective.drones,
            gap=self.gap,
            iterations=iterations,
            upper_bound=1.0,
        )

    def _bound(self, solution: Solution, steps: int, mixture: Mixture) -> float:
        """The bound for a number of steps: the smaller one of both relaxations."""
        bound = solution.upper_bound
        if self.failure is not None:
            bound = chernoff_bound(bound, self.trajectories.cells.shape[1], 1.0 - self.failure)
        if not 0.0 < self.detection < 1.0:
            return bound
        rate, size = -math.log1p(-self.detection), self.model.grid_size
        effort = np.zeros((steps, size, size))
        for share, paths in mixture:
            for path in paths:
                _add_searches(effort, path, share)
        objective = MarkovChainObjective(self.model, rate, effort)
        oracle = partial(drone_paths, self.starts)
        return frank_wolfe(
            objective, oracle, gap=self.gap, iterations=CHAIN_ITERATIONS, upper_bound=bound
        ).upper_bound
