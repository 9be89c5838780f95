"""Tables of the drift model: how the distribution of a person evolves along each axis.

On an axis with N cells, a person whose start is normally distributed around s with standard
deviation sd_s, whose drift is normally distributed around v with standard deviation sd_v, and
whose diffusion is r, has the target of step t: a Gaussian truncated to the grid, with

    mean      clip(s + v tau, 0, N - 1),      tau = t plus the steps adrift before step 0,
    variance  sd_s² + r tau + (sd_v tau)².

If the start has any other distribution, the target is the mixture of the Gaussians from each
cell. Persons move at most one cell per step, so the distribution function F of step t + 1 is
the target's G, clipped to what can be reached from step t:

    F_{t+1}(x) = clip(G_{t+1}(x), F_t(x - 1), F_t(x + 1)).

By Strassen's theorem (1965), a person who moves at most one cell per step can have the
distribution F_t at every t if and only if these bounds hold. The moves that achieve it are a
net flow J(x) = F_t(x) - F_{t+1}(x) across each edge, plus a symmetric exchange e(x) between
neighbouring cells, see `exchange_rate`. With the right exchange, the person's path is that of
a Brownian motion: it remembers where it has been as long as a person at sea does.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch._internal.arrays import Floats, Singles
from DroneSwarmSearch._internal.erf import erf
from DroneSwarmSearch.drift.persons import Drift

__all__ = [
    "Axes",
    "Steps",
    "dispersion_rate",
    "distribution",
    "exchange_rate",
    "joint_at_start",
    "matrices_of",
    "mixed_distribution",
    "moves",
    "moves_between",
    "reachable",
    "start_distribution",
    "start_marginals",
    "tabulate",
]

Array = NDArray[Any]
Number = TypeVar("Number", float, Array)
Starts = Sequence[Floats | None] | None


_ROUNDING = 1 / 60
"""The variance per step by rounding to cells: 1/12 at each end of some ten steps, after which a
drone may be back."""

_LARGE_SD = 1e12
"""Stands for larger standard deviations, whose squares could overflow."""


def dispersion_rate(disperse_constant: Number) -> Number:
    """The diffusion: variance gained per step and axis, in cells² per step.

    It is 0 for a constant of 0, increases with the constant, and stays below 2/3, the variance
    of a step to one of three adjacent cells at random.

    Args:
        disperse_constant: at least 0; a number or an array.
    """
    rate: Number = (2 / 3) * disperse_constant / (disperse_constant + 5)
    return rate


class Axes(NamedTuple):
    """The drift along one or more axes; an axis is the x axis or the y axis of a hypothesis.

    Attributes:
        start: mean of the start, in cells; all arrays are float64 and of one shape, (...).
        start_sd: standard deviation of the start, in cells.
        velocity: mean of the drift, in cells per step.
        velocity_sd: standard deviation of the drift, in cells per step.
        diffusion: variance gained per step, in cells².
        adrift: steps adrift before step 0.
    """

    start: Floats
    start_sd: Floats
    velocity: Floats
    velocity_sd: Floats
    diffusion: Floats
    adrift: Floats

    @classmethod
    def of(cls, drifts: Iterable[Drift]) -> Axes:
        """The axes of some hypotheses: x and y of the first, x and y of the second, and so on.

        The start of an array counts as cell 0, see `tabulate`.
        """
        axes = [axis for drift in drifts for axis in drift.axes]
        columns = (np.array([value or 0.0 for value in column]) for column in zip(*axes))  # noqa: B905
        return cls(*columns)

    def mean(self, grid_size: int, step: Array) -> Floats:
        """The means at a step; steps and axes broadcast."""
        # A drift of one grid per step already reaches the border; clipping avoids overflow.
        velocity = np.clip(self.velocity, -grid_size, grid_size)
        mean: Floats = np.clip(self.start + velocity * (step + self.adrift), 0.0, grid_size - 1)
        return mean

    def shift(self, grid_size: int, step: Array) -> Floats:
        """The cells by which the means move from a step to the next, at most 1."""
        moved = np.abs(self.mean(grid_size, step + 1.0) - self.mean(grid_size, step))
        shift: Floats = np.minimum(moved, 1.0)
        return shift


def distribution(grid_size: int, axes: Axes, step: Array) -> Floats:
    """The distribution function G of the truncated Gaussian at the right edge of every cell.

    Args:
        grid_size: cells on the axis, N.
        axes: the drift along each axis, of shape (...).
        step: completed steps, at least 0; broadcasts with the axes.

    Returns:
        float64, shape (N, ...), non-decreasing along the cells, 1 in the last cell.
    """
    mean, tau = axes.mean(grid_size, step), step + axes.adrift
    variance: Floats = axes.diffusion * tau
    if np.any(axes.start_sd) or np.any(axes.velocity_sd):
        start_sd, velocity_sd = (
            np.minimum(sd, _LARGE_SD) for sd in (axes.start_sd, axes.velocity_sd)
        )
        variance = variance + start_sd**2 + (velocity_sd * tau) ** 2
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
        reached = edges[1:] - 0.5 >= np.floor(mean + 0.5)
        cdf = np.where(spreads, cdf, reached)
    return cdf


def mixed_distribution(grid_size: int, axes: Axes, step: Array, start: Floats) -> Floats:
    """`distribution` of persons whose start cell has any distribution: a mixture of Gaussians.

    Args:
        grid_size: cells on the axis, N.
        axes: one axis; its start is ignored.
        step: as for `distribution`.
        start: the probability of each start cell, shape (N,).
    """
    mixture: Any = 0.0
    for cell in np.flatnonzero(start):
        from_cell = axes._replace(start=np.full_like(axes.start, cell))
        mixture = mixture + start[cell] * distribution(grid_size, from_cell, step)
    cdf: Floats = np.minimum(mixture, 1.0)
    cdf[-1] = 1.0
    return cdf


def reachable(cdf: Floats, target: Floats, out: Floats) -> None:
    """The distribution function nearest to a target that a person can reach in one step.

    Args:
        cdf: F of the current step, shape (N + 2, ...), padded with F(-1) = 0 and F(N) = 1.
        target: G of the next step, shape (N, ...).
        out: receives F of the next step, without padding, shape (N, ...).
    """
    np.maximum(target, cdf[:-2], out=out)
    np.minimum(out, cdf[2:], out=out)


def exchange_rate(diffusion: Array, shift: Array) -> Floats:
    """The share of the smaller of two neighbouring probabilities that changes places in a step.

    The net flow of a spreading Gaussian carries everybody away from its mean; an exchange of
    half the diffusion balances that, and leaves a Brownian motion. A person who drifts d cells
    per step in whole cells has the variance d (1 - d) anyway, which is taken off, except for
    what rounding to cells adds to a position at sea, too.

    Args:
        diffusion: variance gained per step, in cells².
        shift: d, see `Axes.shift`; broadcasts with the diffusion.
    """
    excess = diffusion + _ROUNDING - shift * (1.0 - shift)
    rate: Floats = np.clip(excess, 0.0, diffusion) * 0.5
    return rate


def moves_between(before: Floats, after: Floats, rate: Floats) -> tuple[Floats, Floats, Floats]:
    """The moves of a person whose distribution function is F now and another one step later.

    Args:
        before: F of the current step, shape (N + 2, ...), padded as for `reachable`.
        after: F of the next step, in the same form.
        rate: see `exchange_rate`, shape (...).

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
    exchange = np.minimum(probability[:-1], probability[1:])
    exchange *= rate
    np.minimum(exchange, np.minimum(stay[:-1], stay[1:]) * 0.5, out=exchange)
    to_right[1:-1] += exchange
    to_left[1:-1] += exchange
    occupied = np.where(probability > 0.0, probability, 1.0)
    return probability, to_right[1:] / occupied, to_left[:-1] / occupied


class Steps(NamedTuple):
    """The distributions and moves over n consecutive steps, along one or more axes.

    Attributes:
        probability: float64, shape (n, axes, N): the probability of each column or row.
        right: float64, shape (n, axes, N): the probability of a move to the next higher
            column or row, given the column or row.
        left: the same to the next lower one.
        cdf: float64, shape (N + 2, axes): F of the step after the last, padded as for
            `reachable`, from which the next steps are computed.
    """

    probability: Floats
    right: Floats
    left: Floats
    cdf: Floats


def start_distribution(grid_size: int, axes: Axes, starts: Starts = None) -> Floats:
    """The distribution functions F_0, padded as for `reachable`: shape (N + 2, axes).

    Args:
        grid_size: cells on each axis, N.
        axes: the drift along each axis, of shape (axes,) or (axes, rows).
        starts: see `tabulate`.
    """
    cdf = np.ones((grid_size + 2, *axes.start.shape))
    cdf[0] = 0.0
    cdf[1:-1] = distribution(grid_size, axes, np.array(0.0))
    for axis, start in enumerate(starts or ()):
        if start is not None:
            cdf[1:-2, axis] = np.minimum(start.cumsum()[:-1], 1.0)
    return cdf


def start_marginals(priors: Iterable[Floats | None]) -> Starts:
    """The starts in the form that `tabulate` takes.

    Args:
        priors: for each hypothesis, the start if it is an array, shape (N, N), or None.
    """
    marginals: list[Floats | None] = []
    for prior in priors:
        marginals += (None, None) if prior is None else (prior.sum(axis=0), prior.sum(axis=1))
    return marginals if any(start is not None for start in marginals) else None


def tabulate(
    grid_size: int,
    axes: Axes,
    starts: Starts = None,
    *,
    first: int,
    count: int,
    cdf: Floats | None,
) -> Steps:
    """Follow the Gaussians as closely as a person moving one cell per step can.

    Args:
        grid_size: cells on each axis, N.
        axes: the drift along each axis, of shape (axes,).
        starts: for each axis, None, or the probability of each start cell, shape (N,), which
            takes the place of the axis' start.
        first: the first step.
        count: the number of steps.
        cdf: `Steps.cdf` of the preceding steps; None if `first` is 0.

    Returns:
        The tables of these steps.
    """
    steps = np.arange(first, first + count, dtype=np.float64)[:, None]
    targets = distribution(grid_size, axes, steps + 1.0)  # (N, steps, axes)
    shift = axes.shift(grid_size, steps)
    for axis, start in enumerate(starts or ()):
        if start is not None:
            one = Axes(*(values[[axis]] for values in axes))
            targets[..., [axis]] = mixed_distribution(grid_size, one, steps + 1.0, start)
            shift[:, axis] = min(abs(axes.velocity[axis]), 1.0)
    followed = np.ones((grid_size + 2, count + 1, len(axes.start)))
    followed[0] = 0.0
    followed[:, 0] = start_distribution(grid_size, axes, starts) if cdf is None else cdf
    for step in range(count):
        reachable(followed[:, step], targets[:, step], out=followed[1:-1, step + 1])
    rate = exchange_rate(axes.diffusion, shift)
    tables = moves_between(followed[:, :-1], followed[:, 1:], rate)
    probability, right, left = (np.ascontiguousarray(np.moveaxis(t, 0, -1)) for t in tables)
    return Steps(probability, right, left, followed[:, -1].copy())


def matrices_of(factors: Floats) -> Singles:
    """The matrices of separable hypotheses: float32, shape (..., N, N), indexed [..., y, x].

    Args:
        factors: float64, shape (..., M, 2, N): each hypothesis' probabilities of columns, and
            of rows times its weight.
    """
    rounded = factors.astype(np.float32)
    x, y = rounded[..., 0, None, :], rounded[..., 1, :, None]
    matrices: Singles = y[..., 0, :, :] * x[..., 0, :, :]
    for hypothesis in range(1, factors.shape[-3]):
        matrices += y[..., hypothesis, :, :] * x[..., hypothesis, :, :]
    return matrices


def joint_at_start(factors: Floats, weights: Floats, priors: Sequence[Floats | None]) -> Floats:
    """The probability of each hypothesis and cell at step 0: float64, shape (M, N, N).

    Args:
        factors: as for `matrices_of`: shape (M, 2, N).
        weights: the probability of each hypothesis, shape (M,).
        priors: each hypothesis' start if it is an array, shape (N, N).
    """
    x, y = factors.swapaxes(0, 1)
    joint: Floats = y[:, :, None] * x[:, None, :]
    for hypothesis, prior in enumerate(priors):
        if prior is not None:
            joint[hypothesis] = weights[hypothesis] * prior
    return joint


def moves(draws: NDArray[Any], higher: NDArray[Any], either: NDArray[Any]) -> NDArray[np.int8]:
    """The moves of many persons along an axis in one step: int8, +1, -1 or 0.

    Args:
        draws: a uniform draw from [0, 1) for each person; or, if the probabilities are
            multiplied by 2**53 too, the integer 2**53 times the draw.
        higher: the probability of +1 at each person's coordinate, of the same shape.
        either: the probability of +1 or -1, their sum.
    """
    move: NDArray[np.int8] = np.less(draws, higher).view(np.int8)
    move += move
    move -= np.less(draws, either).view(np.int8)  # 2 a - (a or b)
    return move
