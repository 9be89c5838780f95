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

STEP_SIZE, SLOWER = 20.0, 0.03
"""The step size for one drone that gains 1 from the first tangent; its decrease per iteration."""

WIDTHS = 0.2, 0.05
"""Half the width over which corners are rounded off, in searches: first and least."""

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
    probabilities = drones.probabilities
    count = len(probabilities)
    cuts = np.linspace(0, count, -(-count // batch) + 1).astype(int).tolist()
    parts = [slice(*cut) for cut in pairwise(cuts)]
    if sums is None:
        sums = drones.sums(np.zeros((2, count)))
    flow = drones.soft_flow(sums)
    mean = flow.copy()
    weights, slopes, intercept, total = np.zeros(count), np.zeros((2, count)), 0.0, 0.0
    value, upper_bound, smoothness = 0.0, 1.0, 0.0
    for iteration in range(iterations):
        part = parts[iteration % len(parts)]
        share = probabilities[part] / probabilities[part].sum()
        size = 2.0 / (iteration + 2.0)
        point = mean + np.float32(size) * (flow - mean)
        collected = drones.collected(point, part)
        width = max(WIDTHS[0] / (1.0 + iteration / WIDTH_HALF_LIFE), WIDTHS[1])
        above, slope = objective.tangent(collected, width)
        tangent = drones.sums(slope * share, part)
        if not iteration:
            smoothness = max(drones.most(tangent), 1e-9) / (STEP_SIZE * math.sqrt(drones.count))
        for step_sums, new in zip(sums, tangent, strict=True):
            step_sums += new / (size * smoothness * (1.0 + SLOWER * iteration))
        flow = drones.soft_flow(sums)
        mean += np.float32(size) * (flow - mean)
        recency = (iteration + 1.0) ** RECENT
        total += recency
        weights[part] += recency * share
        slopes[:, part] += recency * slope * share
        intercept += recency * float((above * share).sum())
        if (iteration + 1) % -(-iterations // CHECKS) == 0 or iteration + 1 == iterations:
            upper_bound = min((intercept + drones.most(drones.sums(slopes))) / total, 1.0)
            value = float((probabilities * objective.value(drones.collected(mean))).sum())
            if upper_bound - value <= gap * upper_bound:
                break
    tangents = intercept / total, slopes / total
    effective, effort = total / float(weights.max()), mean.sum(axis=1, dtype=np.float64)
    return BestMixture(value, upper_bound, effective, sums, tangents, effort)
