"""Trajectories of a person: all of them if there are few, otherwise a sample."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch._internal.streams import numbers, stream_keys
from DroneSwarmSearch.drift.markov_chain import move_probabilities
from DroneSwarmSearch.drift.person import moves
from DroneSwarmSearch.drift.probability_matrix import ProbabilityMatrix

__all__ = ["Trajectories", "chernoff_bound", "enumerate_trajectories", "sample_trajectories"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

MOST_ENUMERATED = 65536
"""The most trajectories to enumerate: of the order of a sample, so at a similar cost."""


class Trajectories(NamedTuple):
    """Trajectories of a person, with their probabilities.

    Attributes:
        cells: int64, shape (T, K): the person's cell at every step, y * N + x.
        probabilities: float64, shape (K,), sum to 1.
    """

    cells: Ints
    probabilities: Floats

    def until(self, steps: int) -> Trajectories:
        """The first steps of all trajectories."""
        return Trajectories(self.cells[:steps], self.probabilities)


def enumerate_trajectories(forecast: ProbabilityMatrix, steps: int) -> Trajectories | None:
    """All trajectories over a number of steps; None if there are more than `MOST_ENUMERATED`.

    Each belongs to one hypothesis.
    """
    size = forecast.grid_size
    joint = forecast.joint(0).reshape(-1)
    (starts,) = joint.nonzero()
    if len(starts) > MOST_ENUMERATED:
        return None
    hypotheses, first = np.divmod(starts, size**2)
    cells, probabilities = first[None], joint[starts]
    for step in range(steps - 1):
        right, left, down, up = forecast.moves(step)
        y_now, x_now = np.divmod(cells[-1], size)
        along_x = move_probabilities(right, left)[:, hypotheses, x_now]
        along_y = move_probabilities(down, up)[:, hypotheses, y_now]
        onward = probabilities * along_y[:, None] * along_x  # [dy + 1, dx + 1, trajectory]
        dy, dx, trajectory = onward.nonzero()
        if len(trajectory) > MOST_ENUMERATED:
            return None
        ahead = cells[-1, trajectory] + (dy - 1) * size + dx - 1
        cells = np.vstack([cells[:, trajectory], ahead])
        hypotheses, probabilities = hypotheses[trajectory], onward[dy, dx, trajectory]
    return Trajectories(cells, probabilities)


def sample_trajectories(forecast: ProbabilityMatrix, steps: int, count: int) -> Trajectories:
    """Independent, equally likely trajectories over a number of steps; always the same."""
    size = forecast.grid_size
    key, _, _, start_key = stream_keys(0)
    draws = numbers(start_key, np.arange(count, dtype=np.uint64))
    starts = forecast.start_cumulative.searchsorted(draws, side="right")
    hypotheses, first = np.divmod(starts, size**2)
    y, x = np.divmod(first, size)
    cells = np.empty((steps, count), np.int64)
    for step in range(steps):
        cells[step] = y * size + x
        right, left, down, up = forecast.moves(step)
        places = np.arange(2 * step * count, 2 * (step + 1) * count, dtype=np.uint64)
        u, v = numbers(key, places).reshape(2, count)
        at_x, at_y = (hypotheses, x), (hypotheses, y)
        x = x + moves(u, right[at_x], right[at_x] + left[at_x])
        y = y + moves(v, down[at_y], down[at_y] + up[at_y])
    return Trajectories(cells, np.full(count, 1 / count))


def chernoff_bound(mean: float, count: int, confidence: float) -> float:
    """An upper confidence bound on the expectation of a quantity in [0, 1].

    The largest p with count * kl(mean, p) <= -ln(1 - confidence), where kl is the relative
    entropy of two Bernoulli distributions (H. Chernoff, Annals of Mathematical Statistics
    23:493, 1952; W. Hoeffding, Journal of the American Statistical Association 58:13, 1963).

    Args:
        mean: the mean of the sample.
        count: independent draws in the sample.
        confidence: probability that the bound holds.
    """
    if mean >= 1.0:
        return 1.0
    allowed = -math.log1p(-confidence) / count
    low, high = max(mean, 0.0), 1.0
    for _ in range(60):
        p = (low + high) / 2
        entropy = (1 - mean) * math.log((1 - mean) / (1 - p)) if p < 1.0 else math.inf
        if mean > 0.0:
            entropy += mean * math.log(mean / p)
        low, high = (p, high) if entropy <= allowed else (low, p)
    return high
