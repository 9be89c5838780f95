"""The best mixture of drones' paths, by stochastic accelerated mirror ascent.

The method maximises the mean of a concave function over trajectories. In each iteration, it takes
tangents along a batch of trajectories, and mixes in the paths whose shares are exponential in what
they gain from all tangents so far (P. Tseng, Mathematical Programming 125:263, 2010, with the path
entropy; G. Lan, Mathematical Programming 133:365, 2012, for batches). Any mean of the tangents is
an upper bound, whose maximum over the paths is the bound; less the value, that is the duality gap.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from DroneSwarmSearch._internal.arrays import Floats
from DroneSwarmSearch.bound.memory import RememberingDrones
from DroneSwarmSearch.bound.objectives import TrajectoryObjective

BATCH = 16384  # trajectories in a batch of a sample

STEP_SIZE = 20.0  # for one drone that gains 1 from the first tangent
SLOWER = 0.03  # by which it decreases per iteration

# Half the width over which corners are rounded off, in searches.
FIRST_WIDTH = 0.2
LEAST_WIDTH = 0.05
WIDTH_HALF_LIFE = 80.0  # after this many iterations, the width is half of the first
RECENT = 3  # the mean of the tangents has weights that grow with this power of the iteration
CHECKS = 4  # how often the method compares the bound with the value, and may stop


class BestMixture(NamedTuple):
    """A mixture of paths, and a bound on all.

    Attributes:
        value: the mean of the function at the mixture.
        upper_bound: at least the mean at any mixture.
        effective: the number of trajectories for `chernoff_bound`, as batches count differently.
        sums: the sums of the tangents (see `RememberingDrones`), to start another solution from.
        tangents: the mean tangents: their values without effort, and their slopes, (2, M).
        effort: the mixture's mean number of searches of each cell in each step: (T, N, N).
    """

    value: float
    upper_bound: float
    effective: float
    sums: list[Floats]
    tangents: tuple[float, Floats]
    effort: Floats


def mirror_ascent(
    drones: RememberingDrones,
    objective: TrajectoryObjective,
    *,
    gap: float,
    iterations: int,
    batch: int = BATCH,
    sums: list[Floats] | None = None,
) -> BestMixture:
    """Maximise the mean of a function over the mixtures of drones' paths.

    Args:
        drones: their trajectories, and what mixtures collect.
        objective: the function of what is collected along a trajectory.
        gap: stop at this duality gap, as a fraction of the upper bound.
        iterations: the largest number of iterations.
        batch: trajectories in an iteration.
        sums: start from these; by default, from random paths.
    """
    ascent = _Ascent(drones, objective, batch, sums)
    check_after = -(-iterations // CHECKS)
    for iteration in range(iterations):
        ascent.iterate(iteration)
        is_last = iteration + 1 == iterations
        if (iteration + 1) % check_after == 0 or is_last:
            ascent.check()
            if ascent.upper_bound - ascent.value <= gap * ascent.upper_bound:
                break
    return ascent.result()


class _Ascent:
    """The current mixture, and the mean of all tangents so far.

    Attributes:
        value: the objective of the mean mixture, at the last check.
        upper_bound: the most that the objective of any mixture can be, at the last check.
    """

    def __init__(
        self,
        drones: RememberingDrones,
        objective: TrajectoryObjective,
        batch: int,
        sums: list[Floats] | None,
    ) -> None:
        self._drones = drones
        self._objective = objective
        count = len(drones.probabilities)
        cuts = np.linspace(0, count, -(-count // batch) + 1).astype(int).tolist()
        self._parts = [slice(first, end) for first, end in pairwise(cuts)]
        if sums is None:
            sums = drones.sums(np.zeros((2, count)))
        self._sums = sums
        self._flow = drones.soft_flow(sums)
        self._mean = self._flow.copy()
        self._smoothness = 0.0
        # The tangents, each with a weight that grows with the iteration.
        self._intercept = 0.0
        self._slopes = np.zeros((2, count))
        self._weights = np.zeros(count)  # of the trajectories
        self._total = 0.0  # of the weights of the tangents
        self.value = 0.0
        self.upper_bound = 1.0

    def iterate(self, iteration: int) -> None:
        """Take a tangent along a batch of trajectories, and mix in the paths that gain from it."""
        drones = self._drones
        part = self._parts[iteration % len(self._parts)]
        share = drones.probabilities[part] / drones.probabilities[part].sum()
        size = 2.0 / (iteration + 2.0)
        point = self._mean + np.float32(size) * (self._flow - self._mean)
        collected = drones.collected(point, part)
        width = max(FIRST_WIDTH / (1.0 + iteration / WIDTH_HALF_LIFE), LEAST_WIDTH)
        above, slope = self._objective.tangent(collected, width)
        tangent = drones.sums(slope * share, part)
        if iteration == 0:
            most = max(drones.most(tangent), 1e-9)
            self._smoothness = most / (STEP_SIZE * math.sqrt(drones.count))
        for step_sums, new in zip(self._sums, tangent, strict=True):
            step_sums += new / (size * self._smoothness * (1.0 + SLOWER * iteration))
        self._flow = drones.soft_flow(self._sums)
        self._mean += np.float32(size) * (self._flow - self._mean)

        recency = (iteration + 1.0) ** RECENT
        self._total += recency
        self._weights[part] += recency * share
        self._slopes[:, part] += recency * slope * share
        self._intercept += recency * float((above * share).sum())

    def check(self) -> None:
        """Compute the value and the bound."""
        drones = self._drones
        most = drones.most(drones.sums(self._slopes))
        self.upper_bound = min((self._intercept + most) / self._total, 1.0)
        reached = self._objective.value(drones.collected(self._mean))
        self.value = float((drones.probabilities * reached).sum())

    def result(self) -> BestMixture:
        """The mixture at the last check."""
        return BestMixture(
            value=self.value,
            upper_bound=self.upper_bound,
            effective=self._total / float(self._weights.max()),
            sums=self._sums,
            tangents=(self._intercept / self._total, self._slopes / self._total),
            effort=self._mean.sum(axis=1, dtype=np.float64),
        )
