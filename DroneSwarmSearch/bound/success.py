"""An upper bound on the probability of success (POS) of any policy: a Lagrangian dual bound.

Until the person is found, any policy follows a random set of drone paths. A set that searches a
trajectory of the person k times finds the person there with 1 - (1 - q)^k, which is at most the
sum of the drones' credits along the trajectory (see `memory`). Let Z be the mean of this sum over
the policy's sets, N the mean number of searches, and g the concave function that joins
1 - (1 - q)^k at whole k by straight lines. By Jensen's inequality,

    P(found) <= E[min(Z, g(N))] <= max E[min(Z, g(N))]  over all mixtures of the drones' paths.

Mirror ascent (`mirror_ascent`) finds tangents of this concave function: for weights u in [0, 1] of
the trajectories, min(Z, g) <= 1 - u + u Z, and likewise for g. Any tangents bound the maximum by
their values without effort, plus the most that the drones' best paths gain from them. So the
tangents may come from drones with little memory, and the bound from drones with more.

The expectation is over all trajectories if there are few, otherwise over a sample: then a Chernoff
bound covers the error of the best policy's mean success on it, and a union bound (Bonferroni) over
the persons and the numbers of steps makes all bounds hold together. If q < 1, the larger function
1 - (1 - q)^s of the effort s gives another bound, without a sample; the smaller one is returned.

Finding all of several persons is at most as likely as the product of their bounds. Let m be where
the missing persons may be, m' the same after an action, f_i the probability that it finds person i,
and V the largest probability of finding all persons in the steps left. They drift and are found
independently, so by induction over the steps left, with V_i for a search for person i alone,

    V(m) = max over actions of the sum over sets R of persons of prod_{i not in R} f_i V_R(m')
        <= max over actions of prod_i (f_i + V_i(m'_i)) <= prod_i V_i(m_i).

Persons who drift together (`Scenario.shared_drift`) are independent given the hypothesis k. A
policy that is told k before the first step can ignore it, so no policy finds more than the best one
that is told; its success given k is at most the bound for a search in which k is certain. The bound
is therefore the mean of these bounds over the hypotheses.

The bound lets drones share cells, so it holds whatever happens to those that meet. For drones that
search in flight, see `flying`.

In a coverage mission, the bound is the mean over persons. `Person.survival` is left out: who is
found alive is found, so the bound also holds for finding alive.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.arrays import Floats
from DroneSwarmSearch.bound.flying import FlyingDrones
from DroneSwarmSearch.bound.frank_wolfe import frank_wolfe
from DroneSwarmSearch.bound.memory import RememberingDrones
from DroneSwarmSearch.bound.mirror_ascent import CHECKS, BestMixture, mirror_ascent
from DroneSwarmSearch.bound.objectives import MarkovChainObjective, TrajectoryObjective
from DroneSwarmSearch.bound.trajectories import (
    Trajectories,
    chernoff_bound,
    enumerate_trajectories,
    equally_likely,
    sample_trajectories,
)
from DroneSwarmSearch.core.scenario import Scenario, checked_scenario
from DroneSwarmSearch.drift.model import DriftModel
from DroneSwarmSearch.paths.best_paths import best_paths, cells_looked_at, values_to_go

SAMPLE = 2**18
"""Trajectories in a sample; with one person, sampling adds at most 0.4 percentage points."""

CONFIDENCE = 0.999
"""Probability that a sampled bound holds, for all persons and numbers of steps together."""

BEFORE = 0.1  # the share of the failure probability that is for fewer steps than the time limit

HORIZONS = 12
"""Numbers of steps for which the bound is computed; the others use the next larger one's."""

WORK = 8e6  # the most work in an iteration
MOST_WORK = 5e8  # the most work for the final bound
TRAJECTORIES_TO_MEASURE = 8192  # from which work is estimated

MOST_MEMORY = 5  # the most remembered actions; 6 take gigabytes
MOST_CELLS = 2**28  # the most cells of all trajectories in a sample, which then take about 7 GB

# The most iterations.
ITERATIONS = 800  # for the time limit
ITERATIONS_BEFORE = 12  # for fewer steps
CHAIN_ITERATIONS = 40  # without trajectories


@dataclass(frozen=True)
class SuccessBound:
    """An upper bound on the probability that a policy finds all persons of a search.

    For a coverage mission, the bound is on the cumulative probability of success.

    Attributes:
        by_time: the bound after 0 to L (the limit) steps: float64, shape (L + 1,), non-decreasing.
        relaxed: the relaxation's value at step L; with several persons, the product of their
            values, or in a coverage mission, the mean.
        gap: the duality gap at step L. The bound is at most the sum of both and the sampling
            error, and may be lower, as it may be that of drones with more memory.
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
    gap: float = 0.005,
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

    options = _Options(
        memory=memory, sample=sample, gap=gap, ends=_ends(limit, min(horizons, limit))
    )
    cases = scenario.by_hypothesis()
    failure = (1.0 - CONFIDENCE) / len(cases)
    bounds = [_bound(known, starts, options, failure) for _, known in cases]
    weights = [weight for weight, _ in cases]

    def mean(values: Sequence[Any]) -> Any:
        return np.average(values, axis=0, weights=weights)

    certain = all(bound.confidence == 1.0 for bound in bounds)
    return SuccessBound(
        by_time=mean([bound.by_time for bound in bounds]),
        relaxed=float(mean([bound.relaxed for bound in bounds])),
        gap=float(mean([bound.gap for bound in bounds])),
        confidence=1.0 if certain else CONFIDENCE,
    )


class _Options(NamedTuple):
    """How much work a bound may take, see `success_bound`; `ends` are the numbers of steps."""

    memory: int | None
    sample: int
    gap: float
    ends: list[int]


def _bound(
    scenario: Scenario, starts: list[int], options: _Options, may_fail: float
) -> SuccessBound:
    """The bound for persons who drift on their own, which fails with some probability."""
    limit = scenario.timestep_limit
    persons = scenario.persons_to_find
    models = dict(zip(persons, scenario.forecasts(), strict=True))  # equal persons share a bound
    enumerated = [enumerate_trajectories(model, limit) for model in models.values()]
    sampled = enumerated.count(None)
    failure = may_fail / max(1, sampled)
    curves = []
    solutions = []
    for (person, model), every in zip(models.items(), enumerated, strict=True):
        relaxation = _Relaxation(
            model=model,
            detection=person.probability_of_detection,
            starts=starts,
            trajectories=every or sample_trajectories(model, limit, options.sample),
            failure=None if every else failure,
            gap=options.gap,
            in_flight=scenario.search_in_flight,
        )
        curve, solution = relaxation.curve(options.ends, options.memory)
        curves.append(curve)
        solutions.append(solution)

    counts = [persons.count(person) for person in models]
    value = _of_all([solution.value for solution in solutions], counts, scenario.mission)
    upper = _of_all([solution.upper_bound for solution in solutions], counts, scenario.mission)
    return SuccessBound(
        by_time=_of_all(curves, counts, scenario.mission),
        relaxed=float(value),
        gap=float(upper - value),
        confidence=1.0 - may_fail if sampled else 1.0,
    )


def _of_all(by_person: Sequence[Any], counts: Sequence[int], mission: str) -> Any:
    """The bound for all persons, given that for each different one, and how often each occurs.

    It is the mean in a coverage mission, otherwise the product.
    """
    if mission == "coverage":
        return np.average(by_person, axis=0, weights=counts)
    return np.prod(np.array(by_person).T ** np.array(counts), axis=-1)


def _ends(limit: int, horizons: int) -> list[int]:
    """The numbers of steps for which the relaxation is solved, the largest first."""
    ends = {math.ceil(limit * k / horizons) for k in range(1, horizons + 1)}
    return sorted(ends, reverse=True)


def drone_paths(
    starts: Sequence[int], gains: Floats, in_flight: bool = False
) -> tuple[float, Floats]:
    """The most that the drones can gain, and their searches of each cell; both (n, N, N)."""
    values = values_to_go(gains, np.zeros(gains.shape[1:]), in_flight=in_flight)
    effort = np.zeros_like(gains)
    which = np.zeros(len(starts), np.int64)
    cells, searches = best_paths(
        gains[:, None], values[:, :, None], np.array(starts), which, in_flight=in_flight
    )
    step, drone = searches.nonzero()
    looked_at = cells_looked_at(cells, in_flight)
    np.add.at(effort.reshape(len(effort), -1), (step, looked_at[step, drone]), 1.0)
    return float(values[0, 0].reshape(-1)[list(starts)].sum()), effort


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
        in_flight: whether drones search in flight.
    """

    model: DriftModel
    detection: float
    starts: Sequence[int]
    trajectories: Trajectories
    failure: float | None
    gap: float
    in_flight: bool

    def curve(self, ends: Sequence[int], memory: int | None) -> tuple[Floats, BestMixture]:
        """The bound after each number of steps, and the solution for the first of `ends`."""
        drones = self._drones(WORK, memory)
        solution = self._solve(drones, ITERATIONS)
        upper_bound = solution.upper_bound
        if memory is None:
            deeper = self._drones(MOST_WORK)
            intercept, slopes = solution.tangents
            upper_bound = min(upper_bound, intercept + deeper.most(deeper.sums(slopes)))
        before = BEFORE / max(len(ends) - 1, 1)
        bounds = {ends[0]: self._certain(upper_bound, solution, 1.0 - BEFORE)}
        sums = solution.sums
        for end in ends[1:]:
            sums = [total / 2.0 for total in sums[:end]]
            relaxed = self._solve(drones.until(end), ITERATIONS_BEFORE, sums)
            bounds[end] = self._certain(relaxed.upper_bound, relaxed, before)
        return _filled(bounds), solution

    def _drones(self, work: float, memory: int | None = None) -> RememberingDrones:
        """Drones with some memory; by default, with as much as an amount of work allows."""
        others = self.model.grid_size, self.detection, self.starts
        kind = FlyingDrones if self.in_flight else RememberingDrones
        if memory is None:
            part = equally_likely(self.trajectories.cells[:, :TRAJECTORIES_TO_MEASURE])
            memory = 0
            while memory < MOST_MEMORY:
                if kind(part, *others, memory + 1).work > work:
                    break
                memory += 1
        return kind(self.trajectories, *others, memory)

    def _solve(
        self, drones: RememberingDrones, iterations: int, sums: list[Floats] | None = None
    ) -> BestMixture:
        """Maximise E[min(Z, g(N))]."""
        objective = TrajectoryObjective(self.detection)
        batch = {} if self.failure else {"batch": len(drones.probabilities)}
        return mirror_ascent(
            drones, objective, gap=self.gap, iterations=iterations, sums=sums, **batch
        )

    def _certain(self, upper_bound: float, solution: BestMixture, share: float) -> float:
        """Add the sampling error, given a share of the failure probability.

        How batches count depends on when the method stops, so the bound must hold at all checks.
        """
        if self.failure is None:
            return upper_bound
        failure = share * self.failure / CHECKS
        upper_bound = chernoff_bound(upper_bound, solution.effective, 1.0 - failure)
        if self.detection in (0.0, 1.0):
            return upper_bound
        rate = -math.log1p(-self.detection)
        return frank_wolfe(
            MarkovChainObjective(self.model, rate, solution.effort),
            partial(drone_paths, self.starts, in_flight=self.in_flight),
            gap=self.gap,
            iterations=CHAIN_ITERATIONS,
            upper_bound=upper_bound,
        ).upper_bound
