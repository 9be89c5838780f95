"""Tables of the drift model: how the distribution of a person evolves along each axis.

On an axis with N cells, start cell s, drift v and disperse constant c, the target at step t is
a Gaussian with mean clip(s + v t, 0, N - 1) and variance (2/3) c / (c + 5) t, truncated to the
grid. Persons move at most one cell per step, so the distribution function F of step t + 1 is
the Gaussian's G, clipped to what can be reached from step t:

    F_{t+1}(x) = clip(G_{t+1}(x), F_t(x - 1), F_t(x + 1)).

By Strassen's theorem (1965), a person who moves at most one cell per step can have the
distribution F_t at every t if and only if these bounds hold. The moves that achieve it are a
net flow J(x) = F_t(x) - F_{t+1}(x) across each edge, plus a symmetric exchange between
neighbouring cells of a quarter of the smaller probability that the net flow leaves in them.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from DroneSwarmSearch._internal.erf import erf

__all__ = [
    "Steps",
    "dispersion_rate",
    "gaussian_cdf",
    "moves_between",
    "point_mass",
    "reachable",
    "tabulate",
]

Floats = NDArray[np.float64]
Array = NDArray[Any]
Number = TypeVar("Number", float, Array)


def dispersion_rate(disperse_constant: Number) -> Number:
    """The diffusion: variance gained per step and axis, in cells² per step.

    It is 0 for a constant of 0, increases with the constant, and stays below 2/3, the variance
    of a step to one of three adjacent cells at random.

    Args:
        disperse_constant: at least 0; a number or an array.
    """
    rate: Number = (2 / 3) * disperse_constant / (disperse_constant + 5)
    return rate


def gaussian_cdf(
    grid_size: int, start: Array, drift: Array, disperse_constant: Array, step: Array
) -> Floats:
    """The distribution function G of the truncated Gaussian at the right edge of every cell.

    Args:
        grid_size: cells on the axis, N.
        start: start cell. This and the following arguments broadcast to one shape, (...).
        drift: cells per step.
        disperse_constant: see `dispersion_rate`.
        step: completed steps, >= 1.

    Returns:
        float64, shape (N, ...), non-decreasing along the cells, 1 in the last cell.
    """
    last = grid_size - 1
    # A drift of one grid per step already reaches the border; clipping avoids overflow.
    mean = np.clip(start + np.clip(drift, -grid_size, grid_size) * step, 0.0, last)
    variance: Floats = dispersion_rate(disperse_constant) * step
    spreads = variance > 0.0
    deviation = np.sqrt(np.where(spreads, variance, 1.0))
    edges = np.arange(-0.5, grid_size).reshape(-1, *(1,) * np.broadcast(mean, deviation).ndim)
    # Phi is (1 + erf) / 2; the constants cancel.
    phi = erf((edges - mean) / (deviation * math.sqrt(2)))
    below = phi[:1]
    cdf: Floats = (phi[1:] - below) / (phi[-1:] - below)
    if np.less(cdf[1:], cdf[:-1]).any():  # due to rounding; rare
        np.maximum.accumulate(cdf, axis=0, out=cdf)
    if not np.all(spreads):
        reached = edges[1:] - 0.5 >= np.rint(mean)
        cdf = np.where(spreads, cdf, reached)
    return cdf


def point_mass(grid_size: int, start: Array) -> Floats:
    """The distribution functions F_0 of known start cells.

    Args:
        grid_size: cells on the axis, N.
        start: the start cells, shape (...).

    Returns:
        float64, shape (N + 2, ...): F, padded with F(-1) = 0 and F(N) = 1.
    """
    cells = np.arange(-1, grid_size + 1).reshape(-1, *(1,) * start.ndim)
    return (cells >= start).astype(np.float64)


def reachable(cdf: Floats, target: Floats, out: Floats) -> None:
    """The distribution function nearest to a target that a person can reach in one step.

    Args:
        cdf: F of the current step, shape (N + 2, ...), padded as in `point_mass`.
        target: the Gaussian's G of the next step, shape (N, ...).
        out: receives F of the next step, without padding, shape (N, ...).
    """
    np.maximum(target, cdf[:-2], out=out)
    np.minimum(out, cdf[2:], out=out)


def moves_between(before: Floats, after: Floats) -> tuple[Floats, Floats, Floats]:
    """The moves of a person whose distribution function is F now and another one step later.

    Args:
        before: F of the current step, shape (N + 2, ...), padded as in `point_mass`.
        after: F of the next step, in the same form.

    Returns:
        float64, shape (N, ...) each: the probability of each cell; the probability of a move
        to the next higher cell, given the cell; the same to the next lower cell.
    """
    probability = np.diff(before[:-1], axis=0)
    # The net flow across the edges from -1|0 to N-1|N; it is 0 at the outer ones.
    net = before[:-1] - after[:-1]
    to_right = np.maximum(net, 0.0)
    to_left = to_right - net
    stay = np.maximum(probability - to_right[1:] - to_left[:-1], 0.0)
    exchange = np.minimum(stay[:-1], stay[1:]) * 0.25
    to_right[1:-1] += exchange
    to_left[1:-1] += exchange
    occupied = np.where(probability > 0.0, probability, 1.0)
    return probability, to_right[1:] / occupied, to_left[:-1] / occupied


class Steps(NamedTuple):
    """The distributions and moves over n consecutive steps, along one or more axes.

    An axis is the x axis or the y axis of a forecast.

    Attributes:
        probability: float64, shape (n, axes, N): the probability of each column or row.
        right: float64, shape (n, axes, N): the probability of a move to the next higher
            column or row, given the column or row.
        left: the same to the next lower one.
        cdf: float64, shape (N + 2, axes): F of the step after the last, padded as in
            `point_mass`, from which the next steps are computed.
    """

    probability: Floats
    right: Floats
    left: Floats
    cdf: Floats


def follow(first_cdf: Floats, targets: Floats) -> Steps:
    """Follow the Gaussians as closely as a person moving one cell per step can.

    Args:
        first_cdf: F of the first step, shape (N + 2, axes), padded as in `point_mass`.
        targets: the Gaussians' G of the following steps, shape (N, n, axes).

    Returns:
        The n steps that begin with the first.
    """
    cells, n, axes = targets.shape
    cdf = np.empty((cells + 2, n + 1, axes))
    cdf[:, 0] = first_cdf
    cdf[0] = 0.0
    cdf[-1] = 1.0
    for step in range(n):
        reachable(cdf[:, step], targets[:, step], out=cdf[1:-1, step + 1])
    tables = moves_between(cdf[:, :-1], cdf[:, 1:])
    probability, right, left = (np.ascontiguousarray(np.moveaxis(t, 0, -1)) for t in tables)
    return Steps(probability, right, left, cdf[:, -1].copy())


def tabulate(
    grid_size: int,
    start: ArrayLike,
    drift: ArrayLike,
    disperse_constant: ArrayLike,
    *,
    first: int,
    count: int,
    cdf: Floats | None,
) -> Steps:
    """Compute the tables of consecutive steps along one or more axes.

    Args:
        grid_size: cells on each axis, N.
        start: start cell on each axis, shape (axes,).
        drift: cells per step along each axis, shape (axes,).
        disperse_constant: see `dispersion_rate`; a number, or shape (axes,).
        first: the first step.
        count: the number of steps.
        cdf: `Steps.cdf` of the preceding steps; None if `first` is 0.
    """
    cells, constants = np.asarray(start), np.asarray(disperse_constant, np.float64)
    ahead = np.arange(first + 1.0, first + count + 1)[:, None]
    targets = gaussian_cdf(grid_size, cells, np.asarray(drift), constants, ahead)
    return follow(point_mass(grid_size, cells) if cdf is None else cdf, targets)
