"""An upper bound on the probability of success (POS) of any policy: a Lagrangian dual bound.

Any policy, randomised or not, searches along a random set of drone paths while the person is
missing. Let e[t](c) be the mean number of searches of cell c in step t, and s the sum of e
along a trajectory of the person. If s is an integer, the policy finds a fraction 1 - (1 - q)^s of
the persons on that trajectory. Let g be the smallest concave function with these values; it
joins them by straight lines and is min(s, 1) for q = 1. By Jensen's inequality no policy finds
the person with a probability above E[g(s)], hence none exceeds

    max E[g(s)]  over all mixtures e of the drones' paths.

This is a concave problem over a convex set. The best path for given gains is a dynamic
programme (`paths`), so the Frank-Wolfe method (`frank_wolfe`) solves it and bounds its maximum.

The expectation is over all trajectories if there are few, otherwise over a sample. The maximum
over a sample is at least the sample's value at the true optimum; a Chernoff bound covers the
error of that value. A union bound (Bonferroni) over the persons and the numbers of steps makes
all the sampled bounds hold together with probability `CONFIDENCE`.

If q < 1, the larger function 1 - (1 - q)^s gives another bound, without a sample, because it is
a product along the trajectory. The smaller bound is returned. Finding all of several persons is at
most as likely as finding the one who is hardest to find. In a coverage mission, the probability of
success is the mean over persons, and so is its bound.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch.drift.markov_chain import MarkovChain
from DroneSwarmSearch.drift.probability_matrix import ProbabilityMatrix
from DroneSwarmSearch.planning.frank_wolfe import Effort, Oracle, Solution, frank_wolfe
from DroneSwarmSearch.planning.objectives import MarkovChainObjective, TrajectoryObjective
from DroneSwarmSearch.planning.paths import best_path, values_to_go
from DroneSwarmSearch.planning.trajectories import (
    Trajectories,
    chernoff_bound,
    enumerate_trajectories,
    sample_trajectories,
)
from DroneSwarmSearch.scenario import Scenario, checked_scenario

__all__ = ["SuccessBound", "drone_paths", "success_bound"]

Floats = NDArray[np.float64]

SAMPLE = 32768
"""Trajectories in a sample; with one person, sampling adds at most 1.2 percentage points."""

CONFIDENCE = 0.999
"""Probability that a sampled bound holds, for all persons and numbers of steps together."""

HORIZONS = 12
"""Numbers of steps for which the relaxation is solved; the others use the next larger one's
bound."""

ITERATIONS = 600
"""The most iterations for the time limit itself."""

ITERATIONS_BEFORE = 60
"""The most iterations for fewer steps, which only shape the curve."""


@dataclass(frozen=True)
class SuccessBound:
    """An upper bound on the probability that a policy finds all persons of a search.

    For a coverage mission, the bound is on the cumulative probability of success.

    Attributes:
        by_time: the bound after each number of completed steps, 0 to the time limit L:
            float64, shape (L + 1,), non-decreasing.
        relaxed: the value that the relaxation reaches by step L, for the person with the
            smallest bound; in a coverage mission, the mean over persons.
        gap: the duality gap at step L, which `by_time` includes.
        confidence: probability that `by_time` holds at all steps together; 1 if no
            trajectories were sampled.
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
    sample: int = SAMPLE,
    gap: float = 0.008,
    horizons: int = HORIZONS,
    report: Callable[[float], None] = lambda fraction: None,
) -> SuccessBound:
    """Bound the probability of success of every policy from above.

    Args:
        scenario: the search.
        drones_positions: every drone's start cell (x, y).
        sample: trajectories to draw for each person with too many to enumerate.
        gap: the duality gap at which to stop, as a fraction of the bound.
        horizons: numbers of steps for which to solve the relaxation.
        report: called from time to time with the completed fraction of the work.

    Returns:
        The bound for every number of steps, and its confidence.

    Raises:
        TypeError: an argument has the wrong type.
        ValueError: an argument is out of its limits.
    """
    limit = checked_scenario(scenario).timestep_limit
    oracle = drone_paths(scenario.drone_cells(drones_positions))
    checks.integer("sample", sample, 1)
    checks.integer("horizons", horizons, 1)
    checks.real("gap", gap, 0)
    ends = sorted({math.ceil(limit * k / horizons) for k in range(1, horizons + 1)})
    # Equal persons share one bound.
    counts = Counter(scenario.situation)
    forecasts = dict(zip(scenario.situation, scenario.forecasts(), strict=True))
    persons = [
        _Person(forecast, person.probability_of_detection, enumerate_trajectories(forecast, limit))
        for person, forecast in forecasts.items()
    ]
    sampled_bounds = len(ends) * sum(person.enumerated is None for person in persons)
    failure = (1.0 - CONFIDENCE) / max(1, sampled_bounds)
    curves, solutions = [], []
    for number, person in enumerate(persons):
        trajectories = person.enumerated or sample_trajectories(person.forecast, limit, sample)
        chain = MarkovChain(person.forecast)
        curve = np.full(limit + 1, np.inf)
        curve[0] = 0.0
        for end in ends:
            solution = _over_trajectories(person, trajectories, end, oracle, gap)
            curve[end] = solution.upper_bound
            if person.enumerated is None:
                curve[end] = chernoff_bound(solution.upper_bound, sample, 1.0 - failure)
            if 0.0 < person.detection < 1.0:
                curve[end] = _over_chain(person, chain, end, oracle, gap, curve[end])
            # The work grows with the square of the number of steps.
            report((number + end * (end + 1) / (limit * (limit + 1))) / len(persons))
        # More time never hurts, so a bound for more steps holds for fewer.
        curves.append(np.minimum.accumulate(curve[::-1])[::-1])
        solutions.append(solution)
    confidence = CONFIDENCE if sampled_bounds else 1.0
    values, gaps = [each.value for each in solutions], [each.gap for each in solutions]
    if scenario.mission == "coverage":
        shares = [counts[person] / counts.total() for person in forecasts]
        by_time, relaxed, mean_gap = (
            np.average(each, axis=0, weights=shares) for each in (curves, values, gaps)
        )
        return SuccessBound(by_time, float(relaxed), float(mean_gap), confidence)
    hardest = min(range(len(persons)), key=lambda number: curves[number][-1])
    return SuccessBound(np.min(curves, axis=0), values[hardest], gaps[hardest], confidence)


def drone_paths(starts: Sequence[int]) -> Oracle:
    """The oracle for one path of each drone.

    Args:
        starts: every drone's first cell, y * N + x.
    """

    def oracle(gains: Floats) -> tuple[float, Effort]:
        values = values_to_go(gains, np.zeros(gains.shape[1:]))
        cells_in_grid = gains[0].size
        searches = []
        for start in starts:
            path = best_path(gains, values, start)
            steps = path.searches.nonzero()[0]
            searches.append(steps * cells_in_grid + path.cells[steps])
        gained = float(values[0].reshape(-1)[list(starts)].sum())
        indices = np.concatenate(searches)
        return gained, Effort(indices, np.ones(len(indices)))

    return oracle


class _Person(NamedTuple):
    """A person to find.

    Attributes:
        forecast: the person's.
        detection: the probability of detection, q.
        enumerated: all trajectories; None if there are too many.
    """

    forecast: ProbabilityMatrix
    detection: float
    enumerated: Trajectories | None


def _over_trajectories(
    person: _Person, trajectories: Trajectories, steps: int, oracle: Oracle, gap: float
) -> Solution:
    """Maximise E[g(s)] over trajectories of a given number of steps."""
    at_limit = steps == len(trajectories.cells)
    return frank_wolfe(
        TrajectoryObjective(trajectories.until(steps), person.forecast.grid_size, person.detection),
        oracle,
        gap=gap,
        iterations=ITERATIONS if at_limit else ITERATIONS_BEFORE,
        upper_bound=1.0,
    )


def _over_chain(
    person: _Person, chain: MarkovChain, steps: int, oracle: Oracle, gap: float, known: float
) -> float:
    """Maximise E[1 - (1 - q)^s] over a given number of steps, up to the known bound."""
    rate, size = -math.log1p(-person.detection), person.forecast.grid_size
    return frank_wolfe(
        MarkovChainObjective(chain, person.forecast.joint(0), rate, np.zeros(steps * size**2)),
        oracle,
        gap=gap,
        iterations=ITERATIONS_BEFORE,
        upper_bound=known,
    ).upper_bound
