"""Trajectories of a person: all of them if there are few, otherwise a sample."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from DroneSwarmSearch._internal.arrays import Floats, Ints
from DroneSwarmSearch._internal.streams import stream_keys, uniforms
from DroneSwarmSearch.drift.model import DriftModel

MOST_ENUMERATED = 65536
"""The most trajectories to enumerate: of the order of a sample, so at a similar cost."""


class Trajectories(NamedTuple):
    """A person's cells y * N + x at every step, int64, (T, M), and their probabilities, (M,)."""

    cells: Ints
    probabilities: Floats


def equally_likely(cells: Ints) -> Trajectories:
    """The trajectories of a sample."""
    return Trajectories(cells, np.full(cells.shape[1], 1 / cells.shape[1]))


def enumerate_trajectories(model: DriftModel, steps: int) -> Trajectories | None:
    """All trajectories of states over some steps; None for more than `MOST_ENUMERATED`."""
    start = model.joint(0).reshape(-1)
    (states,) = start.nonzero()
    if len(states) > MOST_ENUMERATED:
        return None
    cells = model.cells(states)[None]
    probabilities = start[states]
    for step in range(steps - 1):
        trajectory, states, probabilities = model.branches(states, probabilities, step)
        if len(trajectory) > MOST_ENUMERATED:
            return None
        cells = np.vstack([cells[:, trajectory], model.cells(states)])
    return Trajectories(cells, probabilities)


def sample_trajectories(model: DriftModel, steps: int, count: int) -> Trajectories:
    """Independent, equally likely trajectories over a number of steps; always the same."""
    key, _, _, start_key = stream_keys(0)
    states = model.start(uniforms(start_key, np.arange(count, dtype=np.uint64)))
    cells = np.empty((steps, count), np.int64)
    for step in range(steps):
        cells[step] = model.cells(states)
        indices = np.arange(2 * step * count, 2 * (step + 1) * count, dtype=np.uint64)
        states = model.moved(states, step, *uniforms(key, indices).reshape(2, count))
    return equally_likely(cells)


def chernoff_bound(mean: float, count: float, confidence: float) -> float:
    """An upper confidence bound on the expectation of a quantity in [0, 1], from a sample's mean.

    The largest p with count * kl(mean, p) <= -ln(1 - confidence), where kl is the relative
    entropy of two Bernoulli distributions (H. Chernoff, Annals of Mathematical Statistics
    23:493, 1952; W. Hoeffding, Journal of the American Statistical Association 58:13, 1963). For a
    weighted mean, the count is 1 / (the largest weight), as ln E[exp(s X)] is convex in s.
    """
    if mean >= 1.0:
        return 1.0
    allowed = -math.log1p(-confidence) / count
    low = max(mean, 0.0)
    high = 1.0
    for _ in range(60):
        p = (low + high) / 2
        entropy = (1 - mean) * math.log((1 - mean) / (1 - p)) if p < 1.0 else math.inf
        if mean > 0.0:
            entropy += mean * math.log(mean / p)
        if entropy <= allowed:
            low = p
        else:
            high = p
    return high
