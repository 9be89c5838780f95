"""The forecast of a drifting person: a Gaussian that moves with the drift and spreads.

The matrix is separable: at step t it is the outer product of one probability vector
per axis. On an axis with N cells, start cell s, drift v and disperse constant c the
target is a Gaussian of mean clip(s + v t, 0, N - 1) and variance (2/3) c / (c + 5) t,
truncated to the grid. Nobody moves more than one cell a step, so the distribution
function F of step t + 1 is that Gaussian's, clipped to what is reachable from step t:

    F_{t+1}(x) = clip(G_{t+1}(x), F_t(x - 1), F_t(x + 1)).

By Strassen's theorem (1965) a person who moves at most one cell a step can be
distributed as F_t at every t if and only if these bounds hold. How that person moves
is tabulated beside the forecast: net flow J(x) = F_t(x) - F_{t+1}(x) across each edge, and
a symmetric exchange of a quarter of what the net flow leaves in the two cells.

Everything depends on (N, s, v, c) alone. The tables are made in blocks of consecutive
steps when somebody asks for them, and kept for later episodes within `KEPT_BYTES`.
"""

from __future__ import annotations

import math
import os
from collections import Counter, OrderedDict
from threading import RLock
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.erf import erf

__all__ = ["ProbabilityMatrix", "dispersion_rate"]

Floats = NDArray[np.float64]
Array = NDArray[Any]
Number = TypeVar("Number", float, Array)
_Key = tuple[float, ...]  # the parameters of a forecast

KEPT_BYTES = 56 * 2**20
"""TabulatedForecasts of all forecasts together that are kept for later, in bytes."""

_BLOCK_STEPS = 32
_BLOCK_BYTES = 4 * 2**20

# A copy of one small matrix costs mostly the call, a copy of several little more.
_HANDED_STEPS = 8
_HANDED_BYTES = 2**16


def _power_of_two(number: int) -> int:
    """The largest power of two that is no larger than a number; at least 1."""
    return 1 << (max(1, number).bit_length() - 1)


def dispersion_rate(disperse_constant: Number) -> Number:
    """Variance gained per step and axis, in cells² per step.

    Takes arrays too. Zero for a constant of 0, growing with it, and bounded by 2/3: the variance of
    somebody who picks one of three neighbouring cells at random.
    """
    rate: Number = (2 / 3) * disperse_constant / (disperse_constant + 5)
    return rate


def gaussian_cdf(
    grid_size: int, start: Array, drift: Array, disperse_constant: Array, step: Array
) -> Floats:
    """The truncated Gaussian's distribution function at the right edge of every cell.

    Args:
        grid_size: cells on the axis, N.
        start: start cell. This and the following broadcast to one shape, (...).
        drift: cells per step.
        disperse_constant: see `dispersion_rate`.
        step: completed steps, >= 1.

    Returns:
        float64, shape (N, ...), non-decreasing along the cells, 1 in the last.
    """
    last = grid_size - 1
    # Beyond one grid per step the mean is at the border anyway, and nothing overflows.
    mean = np.clip(start + np.clip(drift, -grid_size, grid_size) * step, 0.0, last)
    variance: Floats = dispersion_rate(disperse_constant) * step
    spreads = variance > 0.0
    deviation = np.sqrt(np.where(spreads, variance, 1.0))
    edges = np.arange(-0.5, grid_size).reshape(-1, *(1,) * np.broadcast(mean, deviation).ndim)
    # Phi itself is (1 + erf) / 2; the constants cancel below.
    phi = erf((edges - mean) / (deviation * math.sqrt(2)))
    below = phi[:1]
    cdf: Floats = (phi[1:] - below) / (phi[-1:] - below)
    if np.less(cdf[1:], cdf[:-1]).any():  # rounding could do that; to look is much cheaper
        np.maximum.accumulate(cdf, axis=0, out=cdf)
    if not np.all(spreads):
        reached = edges[1:] - 0.5 >= np.rint(mean)
        cdf = np.where(spreads, cdf, reached)
    return cdf


def point_mass(grid_size: int, start: Array) -> Floats:
    """F_0 of known start cells.

    Args:
        grid_size: cells on the axis, N.
        start: the start cells, shape (...).

    Returns:
        float64, shape (N + 2, ...): F with F(-1) = 0 in front and F(N) = 1 behind.
    """
    cells = np.arange(-1, grid_size + 1).reshape(-1, *(1,) * start.ndim)
    return (cells >= start).astype(np.float64)


def reachable(cdf: Floats, target: Floats, out: Floats) -> None:
    """The distribution nearest to a target that somebody who moves one cell a step can reach.

    Args:
        cdf: F of the present step, shape (N + 2, ...), padded as in `point_mass`.
        target: the Gaussian's G of the next step, shape (N, ...).
        out: receives F of the next step, without padding, shape (N, ...).
    """
    np.maximum(target, cdf[:-2], out=out)
    np.minimum(out, cdf[2:], out=out)


def moves_between(before: Floats, after: Floats) -> tuple[Floats, Floats, Floats]:
    """How a person moves that is distributed by one F now and by another one step later.

    Args:
        before: F of the present step, shape (N + 2, ...), padded as in `point_mass`.
        after: F of the next step, likewise.

    Returns:
        float64, shape (N, ...) each: the chance of every cell; the chance to move to the
        next higher cell, given the present one; the same for the next lower.
    """
    probability = np.diff(before[:-1], axis=0)
    # Across the edge between x and x + 1, from -1|0 to N-1|N; nothing crosses the outer ones.
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
    """The forecast and the person's moves over consecutive steps, along some axes.

    An axis is the x or the y axis of a forecast; forecasts have two each, x first.

    Attributes:
        probability: float64, shape (n, axes, N): the chance of each column or row.
        right: float64, shape (n, axes, N): the chance to move to the next higher column
            or row, given the present one.
        left: the same for the next lower.
        cdf: float64, shape (N + 2, axes): F of the step after the last, padded as in
            `point_mass`; the next steps start from it.
    """

    probability: Floats
    right: Floats
    left: Floats
    cdf: Floats


def follow(first_cdf: Floats, targets: Floats) -> Steps:
    """Follow Gaussians as closely as somebody can who moves one cell a step.

    Args:
        first_cdf: F of the first step, shape (N + 2, axes), padded as in `point_mass`.
        targets: the Gaussians' G of the steps after it, shape (N, n, axes).

    Returns:
        The n steps from the first on.
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
    """The tables of consecutive steps along some axes.

    Args:
        grid_size: cells on each axis, N.
        start: start cell on each axis, shape (axes,).
        drift: cells per step along each axis, shape (axes,).
        disperse_constant: see `dispersion_rate`; a number, or shape (axes,).
        first: the first step wanted.
        count: how many steps.
        cdf: `Steps.cdf` of the steps before; None where `first` is 0.
    """
    cells, constants = np.asarray(start), np.asarray(disperse_constant, np.float64)
    ahead = np.arange(first + 1.0, first + count + 1)[:, None]
    targets = gaussian_cdf(grid_size, cells, np.asarray(drift), constants, ahead)
    return follow(point_mass(grid_size, cells) if cdf is None else cdf, targets)


class Block(NamedTuple):
    """Some consecutive steps of a forecast: tables that every environment with this forecast reads.

    Nothing in here may reach users. NumPy's read-only flag does not protect it, because
    other libraries (PyTorch's `as_tensor`, for example) ignore the flag.

    Attributes:
        first: the step that index 0 of everything below stands for.
        steps: the forecast and the moves as arrays.
        marginals: the probabilities in single precision, float32, shape (n, 2, N).
        right: `right` of the steps, flat, in the form that scalar code reads fastest.
        left: their `left` likewise.
        matrices: the matrices, in portions of `ProbabilityMatrix.handed_steps` steps, each
            made when it is first needed.
    """

    first: int
    steps: Steps
    marginals: NDArray[np.float32]
    right: memoryview
    left: memoryview
    matrices: list[NDArray[np.float32] | None]

    def matrices_from(self, step: int) -> NDArray[np.float32]:
        """The matrices of some steps from a multiple of their number on: float32, (n, N, N)."""
        count = len(self.marginals) // len(self.matrices)
        place = (step - self.first) // count
        matrices = self.matrices[place]
        if matrices is None:
            x, y = self.marginals[place * count : (place + 1) * count].swapaxes(0, 1)
            matrices = self.matrices[place] = y[:, :, None] * x[:, None, :]
        return matrices


class _Kept:
    """The blocks kept for later, least recently used first, within `KEPT_BYTES`.

    A forecast that would fill all of it keeps its earliest blocks: every episode begins there.
    """

    def __init__(self) -> None:
        self._blocks: OrderedDict[tuple[_Key, int], tuple[Block, int]] = OrderedDict()
        self._of_forecast: Counter[_Key] = Counter()  # bytes
        self._bytes = 0
        self.lock = RLock()

    def get(self, forecast: _Key, first: int) -> Block | None:
        with self.lock:
            block, _ = self._blocks.get((forecast, first), (None, 0))
            if block is not None:
                self._blocks.move_to_end((forecast, first))
            return block

    def put(self, forecast: _Key, first: int, block: Block, size: int) -> None:
        with self.lock:
            if (forecast, first) in self._blocks or self._of_forecast.get(
                forecast, 0
            ) + size > KEPT_BYTES:
                return
            self._blocks[forecast, first] = (block, size)
            self._of_forecast[forecast] += size
            self._bytes += size
            while self._bytes > KEPT_BYTES:
                (oldest, _), (_, freed) = self._blocks.popitem(last=False)
                self._bytes -= freed
                self._of_forecast[oldest] -= freed
                if not self._of_forecast[oldest]:
                    del self._of_forecast[oldest]


_kept = _Kept()

if hasattr(os, "register_at_fork"):
    # A child process must not inherit the lock from a thread that it does not have.
    os.register_at_fork(
        before=_kept.lock.acquire,
        after_in_parent=_kept.lock.release,
        after_in_child=_kept.lock.release,
    )


class ProbabilityMatrix:
    """Where a drifting person is, step by step.

    Two objects with the same parameters share their tables. Copies and pickles carry
    the parameters alone.

    Attributes:
        block_steps: the steps in each block of tables, a power of two; blocks begin at
            its multiples.
        handed_steps: the steps whose matrices are copied at once for whoever is shown
            them, likewise.

    Args:
        grid_size: cells along each side of the square grid, N.
        start: the person's cell at step 0, (x, y).
        vector: drift in cells per step, (x, y); y grows downward. What exceeds one cell
            per step drifts one cell per step.
        disperse_constant: how quickly the person may stray, see `dispersion_rate`.

    Raises:
        TypeError: an argument is of the wrong type.
        ValueError: an argument is out of its limits.
    """

    def __init__(
        self,
        grid_size: int,
        start: tuple[int, int],
        vector: tuple[float, float],
        disperse_constant: float,
    ) -> None:
        size = checks.integer("grid_size", grid_size, 2)
        checks.fits("a matrix", 4 * size**2, grid_size=size)
        cell = checks.cell("start", start, size)
        drift = checks.pair("vector", vector)
        constant = checks.real("disperse_constant", disperse_constant, 0)
        self._parameters = (size, cell, drift, constant)
        self._key = (size, *cell, *drift, constant)
        self.block_steps = min(_BLOCK_STEPS, _power_of_two(_BLOCK_BYTES // self._step_bytes()))
        self.handed_steps = min(_HANDED_STEPS, _power_of_two(_HANDED_BYTES // (4 * size**2)))
        self._initial = self._block = self._make_block(0, None)

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), self._parameters

    @property
    def parameters(self) -> tuple[int, tuple[int, int], tuple[float, float], float]:
        """The arguments it was made with."""
        return self._parameters

    @property
    def grid_size(self) -> int:
        """Cells along each side of the grid."""
        return self._parameters[0]

    def at(self, step: int) -> NDArray[np.float32]:
        """The matrix at a step.

        Args:
            step: completed steps, >= 0.

        Returns:
            float32, shape (grid_size, grid_size), indexed [y, x], sums to 1; a new array.

        Raises:
            TypeError: the step is no integer.
            ValueError: the step is negative.
        """
        matrices = self.block(step).matrices_from(step)
        matrix: NDArray[np.float32] = matrices[step % self.handed_steps]
        return matrix.copy()

    def block(self, step: int) -> Block:
        """The shared tables that hold a step, for the library itself.

        Going on from step to step is cheap.
        """
        if type(step) is not int:
            step = checks.integer("step", step, 0)
        block = self._block
        if step < block.first:
            checks.integer("step", step, 0)
            block = self._initial
        while step >= block.first + self.block_steps:
            block = self._make_block(block.first + self.block_steps, block)
        self._block = block
        return block

    def marginals(self, step: int) -> tuple[Floats, Floats]:
        """The chances of each column and of each row at a step: float64, shape (N,) each."""
        block = self.block(step)
        x, y = block.steps.probability[step - block.first].copy()
        return x, y

    def exact(self, step: int) -> Floats:
        """The matrix at a step in double precision: float64, shape (N, N), indexed [y, x]."""
        x, y = self.marginals(step)
        return np.multiply.outer(y, x)

    def moves(self, step: int) -> tuple[Floats, Floats, Floats, Floats]:
        """The chances of a person's move from a step to the next, given its cell.

        Returns:
            float64, shape (N,) each: to the right and to the left for every column, then
            down and up for every row.
        """
        block = self.block(step)
        index = step - block.first
        right, down = block.steps.right[index].copy()
        left, up = block.steps.left[index].copy()
        return right, left, down, up

    def _step_bytes(self) -> int:
        grid_size = self.grid_size
        matrix = 4 * grid_size**2
        tables = 2 * grid_size * (3 * 8 + 4)
        return matrix + tables + 512

    def _make_block(self, first: int, before: Block | None) -> Block:
        block = _kept.get(self._key, first)
        if block is None:
            cdf = None if before is None else before.steps.cdf
            steps = tabulate(*self._parameters, first=first, count=self.block_steps, cdf=cdf)
            block = Block(
                first=first,
                steps=steps,
                marginals=steps.probability.astype(np.float32),
                right=steps.right.reshape(-1).data,
                left=steps.left.reshape(-1).data,
                matrices=[None] * (self.block_steps // self.handed_steps),
            )
            _kept.put(self._key, first, block, self._step_bytes() * self.block_steps)
        return block
