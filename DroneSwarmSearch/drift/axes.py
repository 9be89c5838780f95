"""Tables of the drift model: how the distribution of a person evolves along each axis.

On an axis with N cells, a person whose start is normally distributed around s with standard
deviation sd_s, whose drift is normally distributed around v with standard deviation sd_v, and
whose diffusion is r, has the target of step t: a Gaussian truncated to the grid, with

    mean      clip(s + v tau, 0, N - 1),      tau = t plus the steps adrift before step 0,
    variance  sd_s² + r tau + (sd_v tau)².

If the drift varies in time, sums over the first tau steps replace v tau and sd_v tau.

If the start has any other distribution, the target is the mixture of the Gaussians from each
cell. Persons move at most one cell per step, so the distribution function F of step t + 1 is
the target's G, clipped to what can be reached from step t:

    F_{t+1}(x) = clip(G_{t+1}(x), F_t(x - 1), F_t(x + 1)).

By Strassen's theorem (1965), a person who moves at most one cell per step can have the
distribution F_t at every t if and only if these bounds hold. The moves that achieve it are a
net flow J(x) = F_t(x) - F_{t+1}(x) across each edge, plus a symmetric exchange between
neighbouring cells, which makes the path a Brownian motion, see `_exchange_rate`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch._internal.arrays import Floats, Singles
from DroneSwarmSearch._internal.erf import erf
from DroneSwarmSearch.persons.hypotheses import Drift, Hypotheses, displaced, rate_at

Array = NDArray[Any]
Number = TypeVar("Number", float, Array)

_ROUNDING = 1 / 60
"""The variance per step by rounding to cells: 1/12 at each end of some ten steps, after which a
drone may be back."""

_ABSENT = Drift((0, 0))
"""Stands for the hypotheses that a person has fewer than others; its weight is 0."""


def dispersion_rate(disperse_constant: Number) -> Number:
    """The diffusion, in cells² per step, of a constant of at least 0: a number or an array.

    It increases from 0 to 2/3, the variance of a step to one of three adjacent cells at random.
    """
    rate: Number = (2 / 3) * disperse_constant / (disperse_constant + 5)
    return rate


class Axes(NamedTuple):
    """The drift along A axes, x and y of each hypothesis in turn: float64 arrays of shape (A,).

    If the drift varies along one of them, velocities have the shape (T, A), see `displaced`.
    """

    start: Floats
    start_sd: Floats
    velocity: Floats
    velocity_sd: Floats
    diffusion: Floats
    adrift: Floats

    @classmethod
    def of(cls, drifts: Sequence[Drift]) -> Axes:
        """The axes of some hypotheses; an array starts in cell 0."""
        starts = [(0.0, 0.0) if drift.prior is not None else drift.start for drift in drifts]
        deviations = [drift.start_sd for drift in drifts]
        constants = [(drift.diffusion, drift.adrift) for drift in drifts]
        return cls(
            np.array(starts, np.float64).reshape(-1),
            np.array(deviations, np.float64).reshape(-1),
            _rates([drift.vector for drift in drifts]),
            _rates([drift.vector_sd for drift in drifts]),
            *np.repeat(np.array(constants, np.float64), 2, axis=0).T,
        )

    def mean(self, grid_size: int, step: Array) -> Floats:
        """The means at a step; steps and axes broadcast."""
        # A drift of one grid per step already reaches the border; clipping avoids overflow.
        velocity = np.clip(self.velocity, -grid_size, grid_size)
        moved = displaced(velocity, step + self.adrift)
        mean: Floats = np.clip(self.start + moved, 0.0, grid_size - 1)
        return mean

    def shift(self, grid_size: int, step: Array) -> Floats:
        """The cells by which the means move from a step to the next, at most 1."""
        moved = np.abs(self.mean(grid_size, step + 1.0) - self.mean(grid_size, step))
        shift: Floats = np.minimum(moved, 1.0)
        return shift


def _rates(values: Sequence[Any]) -> Floats:
    """Rates along x and y of some hypotheses: (A,), or (T, A) with NaN after the last of each."""
    series = [np.reshape(value, (-1, 2)) for value in values]
    table = np.full((max(map(len, series)), 2 * len(series)), np.nan)
    for axis, rates in enumerate(series):
        table[: len(rates), 2 * axis : 2 * axis + 2] = rates
    return table[0] if len(table) == 1 else table


def distribution(grid_size: int, axes: Axes, step: Array) -> Floats:
    """The distribution function G of the truncated Gaussian at the right edge of every cell.

    It has the shape (N, ...), where steps and axes broadcast to (...), never decreases, and is 1
    in the last cell.
    """
    mean = axes.mean(grid_size, step)
    tau = step + axes.adrift
    by_drift = displaced(axes.velocity_sd, tau)
    variance: Floats = axes.diffusion * tau + axes.start_sd**2 + by_drift**2
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


def _mixed_distribution(grid_size: int, axis: Axes, step: Array, start: Floats) -> Floats:
    """`distribution` along an axis from any distribution of start cells: a mixture."""
    mixture: Any = 0.0
    for cell in np.flatnonzero(start):
        from_cell = axis._replace(start=np.full_like(axis.start, cell))
        mixture = mixture + start[cell] * distribution(grid_size, from_cell, step)
    cdf: Floats = np.minimum(mixture, 1.0)
    cdf[-1] = 1.0
    return cdf


def _exchange_rate(diffusion: Array, shift: Array) -> Floats:
    """The share of the smaller of two neighbouring probabilities that changes places in a step.

    The net flow of a spreading Gaussian carries everybody away from its mean; an exchange of
    half the diffusion balances that, and leaves a Brownian motion. A person who drifts d cells
    per step in whole cells has the variance d (1 - d) anyway, which is taken off, except for
    what rounding to cells adds to a position at sea, too.
    """
    excess = diffusion + _ROUNDING - shift * (1.0 - shift)
    rate: Floats = np.clip(excess, 0.0, diffusion) * 0.5
    return rate


def _moves_between(before: Floats, after: Floats, rate: Floats) -> tuple[Floats, Floats, Floats]:
    """The moves between F now and F a step later, padded with F(-1) = 0 and F(N) = 1: (N + 2, ...).

    Returns the probability of each cell, and given the cell, of a move to the next higher and to
    the next lower one: (N, ...) each.
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
    """The forecasts of K persons with M hypotheses each over n consecutive steps.

    Attributes:
        factors: each hypothesis' probabilities of the columns, and of the rows times its weight:
            (n, K, M, 2, N).
        moves: see `all_moves`: (3, n, K, M, 2, N).
        joint: the probability of each state: (n + 1, K, M, N, N); None if no start is an array.
            Only persons with such a start have the last step.
        cdf: F of the step after the last along each axis, padded; the next steps follow from it.
    """

    factors: Floats
    moves: Floats
    joint: Floats | None
    cdf: Floats


def tabulate(
    grid_size: int,
    persons: Sequence[Hypotheses],
    first: int,
    count: int,
    previous: Steps | None,
    hypotheses: int = 1,
) -> Steps:
    """Follow the Gaussians for `count` steps as closely as a person moving one cell per step can.

    `previous` are the steps before the first, None if that is 0; `hypotheses` is the least M, and
    persons with fewer have some of weight 0.
    """
    most = max(hypotheses, *(len(person.drifts) for person in persons))
    drifts, weights = _padded(persons, most)
    axes = Axes.of(drifts)
    priors = {n: drift.prior for n, drift in enumerate(drifts) if drift.prior is not None}
    steps = np.arange(first, first + count, dtype=np.float64)[:, None]
    followed, shift = _followed(grid_size, axes, priors, steps, previous)
    rate = _exchange_rate(axes.diffusion, shift)
    tables = _moves_between(followed[:, :-1], followed[:, 1:], rate)
    shape = (count, len(persons), most, 2, grid_size)
    factors, higher, lower = (
        np.ascontiguousarray(np.moveaxis(table, 0, -1)).reshape(shape) for table in tables
    )
    factors[..., 1, :] *= weights[:, :, None]
    moves = all_moves(higher, lower)
    joint = None
    if priors:
        joint = _carried(factors, moves, priors, weights, previous)
    return Steps(factors, moves, joint, followed[:, -1].copy())


def _padded(persons: Sequence[Hypotheses], most: int) -> tuple[list[Drift], Floats]:
    """`most` hypotheses of each person in turn, some of them absent, and their weights, (K, M)."""
    drifts: list[Drift] = []
    weights = np.zeros((len(persons), most))
    for row, person in zip(weights, persons, strict=True):
        drifts += [*person.drifts, *[_ABSENT] * (most - len(person.drifts))]
        row[: len(person.weights)] = person.weights
    return drifts, weights


def _followed(
    grid_size: int, axes: Axes, priors: dict[int, Floats], steps: Floats, previous: Steps | None
) -> tuple[Floats, Floats]:
    """F before and after each step, padded: (N + 2, n + 1, A); and `Axes.shift` of each, (n, A)."""
    targets = distribution(grid_size, axes, steps + 1.0)
    shift = axes.shift(grid_size, steps)
    followed = np.ones((grid_size + 2, len(steps) + 1, len(axes.start)))
    followed[0] = 0.0
    followed[1:-1, 0] = distribution(grid_size, axes, np.array(0.0))
    starts = {2 * n + axis: prior.sum(axis=axis) for n, prior in priors.items() for axis in (0, 1)}
    for axis, start in starts.items():
        one = Axes(*(values[..., [axis]] for values in axes))
        targets[..., [axis]] = _mixed_distribution(grid_size, one, steps + 1.0, start)
        rates = np.atleast_2d(one.velocity)
        shift[:, [axis]] = np.minimum(np.abs(rates[rate_at(rates, steps)[1]]), 1.0)
        followed[1:-2, 0, axis] = np.minimum(start.cumsum()[:-1], 1.0)
    if previous is not None:
        followed[:, 0] = previous.cdf
    for step in range(len(steps)):  # the nearest to the target that can be reached
        after = followed[1:-1, step + 1]
        np.maximum(targets[:, step], followed[:-2, step], out=after)
        np.minimum(after, followed[2:, step], out=after)
    return followed, shift


def _carried(
    factors: Floats,
    moves: Floats,
    priors: dict[int, Floats],
    weights: Floats,
    previous: Steps | None,
) -> Floats:
    """`Steps.joint`: matrices from arrays are carried along by the moves of each step."""
    count, persons, most, _, size = factors.shape
    joint = np.empty((count + 1, persons, most, size, size))
    joint[:-1] = joint_of(factors)
    for number, prior in priors.items():
        joint[0, number // most, number % most] = weights.flat[number] * prior
    drift = Drifter(joint.shape[2:])
    for person in {number // most for number in priors}:
        if previous is not None and previous.joint is not None:
            joint[0, person] = previous.joint[-1, person]
        for step in range(count):
            joint[step + 1, person] = drift(joint[step, person], moves[:, step, person])
    return joint


def joint_of(factors: Floats) -> Floats:
    """The probability of each state: shape (..., M, N, N), see `Steps.factors`."""
    joint: Floats = factors[..., 1, :, None] * factors[..., 0, None, :]
    return joint


def matrices_of(factors: Floats) -> Singles:
    """The matrices of separable hypotheses: float32, shape (..., N, N), see `Steps.factors`."""
    parts = np.moveaxis(factors.astype(np.float32), -3, 0)
    matrices: Singles = parts[0, ..., 1, :, None] * parts[0, ..., 0, None, :]
    for part in parts[1:]:
        matrices += part[..., 1, :, None] * part[..., 0, None, :]
    return matrices


def all_moves(higher: Array, lower: Array) -> Array:
    """The probabilities of staying, and of moves to the next higher and to the next lower cell."""
    return np.stack([1.0 - higher - lower, higher, lower])


class Drifter:
    """Lets a mass of the shape (M, N, N) drift by a step, in scratch arrays that it keeps."""

    def __init__(self, state_shape: tuple[int, ...]) -> None:
        self._shape = state_shape
        self._axes = []
        for distance in (1, state_shape[-1]):
            # Nobody leaves the grid, so nothing wraps around from one row or hypothesis to the
            # next, and the arrays can be shifted as one run of memory.
            terms = np.empty((3, *state_shape))
            cells, higher, lower = terms.reshape(3, -1)
            to_higher = cells[distance:], higher[:-distance], cells[distance:]
            to_lower = cells[:-distance], lower[distance:], cells[:-distance]
            self._axes.append((terms, to_higher, to_lower))

    def __reduce__(self) -> tuple[object, ...]:  # the views must be those of the copy
        return type(self), (self._shape,)

    def __call__(self, mass: Floats, moves: Floats) -> Floats:
        """The mass one step later, of the same sum; `moves` are `all_moves`, (3, M, 2, N)."""
        along_axes = moves[:, :, 0, None], moves[:, :, 1, :, None]
        for along, (terms, to_higher, to_lower) in zip(along_axes, self._axes, strict=True):
            np.multiply(along, mass, terms)
            np.add(*to_higher)
            np.add(*to_lower)
            mass = terms[0]
        return mass.copy()


def moves_of(draws: Array, higher: Array, either: Array) -> NDArray[np.int8]:
    """The moves of persons along an axis in a step, +1, -1 or 0, from draws in [0, 1).

    Given are the probabilities of +1, and of +1 or -1, at each person's coordinate.
    """
    move: NDArray[np.int8] = np.less(draws, higher).view(np.int8)
    move += move
    move -= np.less(draws, either).view(np.int8)  # 2 a - (a or b)
    return move
