"""The forecast of a drifting person: the probability of each cell at each step.

The matrix is separable: at step t it is the outer product of one probability vector per axis.
`tables` computes these vectors, which depend only on the grid size, the start cell, the drift
and the disperse constant. They are computed in blocks of consecutive steps on demand. All
forecasts share a cache of blocks, which holds at most `CACHE_BYTES`.
"""

from __future__ import annotations

import os
from collections import Counter, OrderedDict
from threading import RLock
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch.drift.tables import Floats, Steps, tabulate

__all__ = ["ProbabilityMatrix"]

_Key = tuple[float, ...]  # the parameters of a forecast

CACHE_BYTES = 56 * 2**20
"""The limit of the cache of all forecasts together."""

_EXPANDED_SIZE = 32
"""On grids up to this size, a block keeps its flows for every cell."""

_BLOCK_STEPS = 32
_BLOCK_BYTES = 4 * 2**20

# For small matrices, one copy of several costs little more than a copy of one.
_GROUP_STEPS = 8
_GROUP_BYTES = 2**16


class Block(NamedTuple):
    """The tables of consecutive steps, shared by all environments with this forecast.

    Never pass these arrays to users. NumPy's read-only flag does not protect them, because
    other libraries (PyTorch's `as_tensor`, for example) ignore the flag.

    Attributes:
        first: the step at index 0 of everything below.
        steps: the distributions and the moves.
        right: `steps.right`, flat, in the form that scalar code reads fastest.
        left: `steps.left` in the same form.
        flows: see `flows_at`; None before the first use.
        matrices: the matrices in groups of `ProbabilityMatrix.group_steps` steps, each group
            computed on first use.
    """

    first: int
    steps: Steps
    right: memoryview
    left: memoryview
    flows: list[tuple[Floats, Floats] | None]
    matrices: list[NDArray[np.float32] | None]

    def matrices_at(self, step: int) -> NDArray[np.float32]:
        """The matrices of the group of steps that holds a step: float32, (n, N, N)."""
        probability = self.steps.probability
        count = len(probability) // len(self.matrices)
        group = (step - self.first) // count
        matrices = self.matrices[group]
        if matrices is None:
            here = probability[group * count : (group + 1) * count].astype(np.float32)
            matrices = self.matrices[group] = here[:, 1, :, None] * here[:, 0, None, :]
        return matrices

    def flows_at(self, step: int) -> tuple[Floats, Floats]:
        """The probabilities of a step's moves, as factors of a belief.

        Returns:
            The probabilities to stay, to move right and to move left, given the cell: float64,
            (3, N, N), or (3, 1, N) on large grids; and to stay, to move down and to move up,
            likewise (3, N, N) or (3, N, 1).
        """
        flows = self.flows[step - self.first]
        if flows is None:
            right, left = (
                table[step - self.first] for table in (self.steps.right, self.steps.left)
            )
            moves = np.stack([1.0 - right - left, right, left])
            along_x, along_y = moves[:, 0, None], moves[:, 1, :, None]
            size = moves.shape[-1]
            if size <= _EXPANDED_SIZE:  # NumPy broadcasts short rows slowly
                shape = (3, size, size)
                along_x, along_y = (np.broadcast_to(a, shape).copy() for a in (along_x, along_y))
            flows = self.flows[step - self.first] = along_x, along_y
        return flows


class BlockCache:
    """The most recently used blocks, within `CACHE_BYTES`.

    A forecast that would fill the whole cache keeps its earliest blocks, because every
    episode begins there.
    """

    def __init__(self) -> None:
        self._blocks: OrderedDict[tuple[_Key, int], tuple[Block, int]] = OrderedDict()
        self._bytes_by_forecast: Counter[_Key] = Counter()
        self._bytes = 0
        self.lock = RLock()

    def get(self, forecast: _Key, first: int) -> Block | None:
        """The block of a forecast that begins with a step, or None."""
        with self.lock:
            block, _ = self._blocks.get((forecast, first), (None, 0))
            if block is not None:
                self._blocks.move_to_end((forecast, first))
            return block

    def put(self, forecast: _Key, first: int, block: Block, size: int) -> None:
        """Add a block of `size` bytes, and drop the least recently used ones over the limit."""
        with self.lock:
            used = self._bytes_by_forecast.get(forecast, 0)
            if (forecast, first) in self._blocks or used + size > CACHE_BYTES:
                return
            self._blocks[forecast, first] = (block, size)
            self._bytes_by_forecast[forecast] += size
            self._bytes += size
            while self._bytes > CACHE_BYTES:
                (oldest, _), (_, freed) = self._blocks.popitem(last=False)
                self._bytes -= freed
                self._bytes_by_forecast[oldest] -= freed
                if not self._bytes_by_forecast[oldest]:
                    del self._bytes_by_forecast[oldest]


_cache = BlockCache()

if hasattr(os, "register_at_fork"):
    # A child process must not inherit the lock from a thread that it does not have.
    os.register_at_fork(
        before=_cache.lock.acquire,
        after_in_parent=_cache.lock.release,
        after_in_child=_cache.lock.release,
    )


class ProbabilityMatrix:
    """The forecast of a drifting person: the probability of each cell at each step.

    Objects with equal parameters share their tables. Copies and pickles hold only the
    parameters.

    Args:
        grid_size: cells along each side of the square grid, N.
        start: the person's cell at step 0, (x, y).
        vector: drift in cells per step, (x, y); y increases downward. The person drifts at
            most one cell per step along each axis.
        disperse_constant: how quickly the person may stray, see `dispersion_rate`.

    Attributes:
        block_steps: the steps in each block of tables, a power of two; blocks begin at its
            multiples.
        group_steps: the steps whose matrices are computed together, also a power of two.

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
        self.group_steps = min(_GROUP_STEPS, _power_of_two(_GROUP_BYTES // (4 * size**2)))
        self._initial = self._block = self._get_block(0, None)

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), self._parameters

    @property
    def parameters(self) -> tuple[int, tuple[int, int], tuple[float, float], float]:
        """The constructor's arguments."""
        return self._parameters

    @property
    def grid_size(self) -> int:
        """Cells along each side of the grid."""
        return self._parameters[0]

    def at(self, step: int) -> NDArray[np.float32]:
        """The matrix at a step.

        Args:
            step: completed steps, at least 0.

        Returns:
            float32, shape (grid_size, grid_size), indexed [y, x], sums to 1; a new array.

        Raises:
            TypeError: the step is not an integer.
            ValueError: the step is negative.
        """
        matrices = self.block(step).matrices_at(step)
        matrix: NDArray[np.float32] = matrices[step % self.group_steps]
        return matrix.copy()

    def exact(self, step: int) -> Floats:
        """The matrix at a step in double precision: float64, shape (N, N), indexed [y, x]."""
        x, y = self.marginals(step)
        return np.multiply.outer(y, x)

    def marginals(self, step: int) -> tuple[Floats, Floats]:
        """The probability of each column and of each row at a step: float64, shape (N,)."""
        block = self.block(step)
        x, y = block.steps.probability[step - block.first].copy()
        return x, y

    def moves(self, step: int) -> tuple[Floats, Floats, Floats, Floats]:
        """The probabilities of a person's moves from a step to the next, given the cell.

        Returns:
            float64, shape (N,): to the right and to the left for each column, then down and
            up for each row.
        """
        block = self.block(step)
        index = step - block.first
        right, down = block.steps.right[index].copy()
        left, up = block.steps.left[index].copy()
        return right, left, down, up

    def block(self, step: int) -> Block:
        """The shared tables that hold a step; fast if steps are in ascending order."""
        if type(step) is not int:
            step = checks.integer("step", step, 0)
        block = self._block
        if step < block.first:
            checks.integer("step", step, 0)
            block = self._initial
        while step >= block.first + self.block_steps:
            block = self._get_block(block.first + self.block_steps, block)
        self._block = block
        return block

    def _step_bytes(self) -> int:
        """Approximate memory of one step in a block."""
        size = self.grid_size
        flows = 6 * 8 * size * (size if size <= _EXPANDED_SIZE else 1)
        return 4 * size**2 + 2 * size * 3 * 8 + flows + 512

    def _get_block(self, first: int, previous: Block | None) -> Block:
        block = _cache.get(self._key, first)
        if block is None:
            cdf = None if previous is None else previous.steps.cdf
            steps = tabulate(*self._parameters, first=first, count=self.block_steps, cdf=cdf)
            block = Block(
                first=first,
                steps=steps,
                right=steps.right.reshape(-1).data,
                left=steps.left.reshape(-1).data,
                flows=[None] * self.block_steps,
                matrices=[None] * (self.block_steps // self.group_steps),
            )
            _cache.put(self._key, first, block, self._step_bytes() * self.block_steps)
        return block


def _power_of_two(number: int) -> int:
    """The largest power of two that is at most a number; at least 1."""
    return 1 << (max(1, number).bit_length() - 1)
