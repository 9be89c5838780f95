"""The forecast of a drifting person: the probability of each cell at each step.

The matrix is the mean of one matrix for each hypothesis about the person's drift, by weight.
The matrix of a hypothesis is separable: at step t it is the outer product of one probability
vector per axis. Only if the start is an array, the matrices of all hypotheses are carried along
by the moves of each step. `tables` computes the vectors and the moves, in blocks of consecutive
steps on demand. All forecasts share a cache of blocks, which holds at most `CACHE_BYTES`.
"""

from __future__ import annotations

import os
from collections import Counter, OrderedDict
from collections.abc import Hashable, Sequence
from functools import cached_property
from threading import RLock
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch.drift.belief import after_drift, over_hypotheses
from DroneSwarmSearch.drift.persons import Drift, Person
from DroneSwarmSearch.drift.tables import Axes, Floats, Steps, start_marginals, tabulate

__all__ = ["ProbabilityMatrix", "belief_shape", "joint_at_start", "matrices_of"]

_Key = tuple[Hashable, ...]  # the parameters of a forecast

CACHE_BYTES = 56 * 2**20
"""The limit of the cache of all forecasts together. Memory stops growing there, however long an
episode is."""

_EXPANDED_SIZE = 32
"""On grids up to this size, a block keeps its flows for every cell."""

_BLOCK_STEPS = 32
_BLOCK_BYTES = 4 * 2**20

# For small matrices, one copy of several costs little more than a copy of one.
_GROUP_STEPS = 8
_GROUP_BYTES = 2**16


def matrices_of(factors: Floats) -> NDArray[np.float32]:
    """The matrices of separable hypotheses: float32, shape (..., N, N), indexed [..., y, x].

    Args:
        factors: float64, shape (..., M, 2, N): each hypothesis' probabilities of columns, and
            of rows times its weight.
    """
    rounded = factors.astype(np.float32)
    x, y = rounded[..., 0, None, :], rounded[..., 1, :, None]
    matrices: NDArray[np.float32] = y[..., 0, :, :] * x[..., 0, :, :]
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


class Block(NamedTuple):
    """The tables of consecutive steps, shared by all environments with this forecast.

    Never pass these arrays to users. NumPy's read-only flag does not protect them, because
    other libraries (PyTorch's `as_tensor`, for example) ignore the flag.

    Attributes:
        first: the step at index 0 of everything below.
        steps: the distributions and the moves; axes in the order of `Axes.of`.
        factors: see `matrices_of`: float64, shape (n, M, 2, N).
        joint: the probability of each hypothesis and cell: float64, shape (n + 1, M, N, N),
            one step more than the rest; None if all hypotheses are separable.
        right: `steps.right`, flat, in the form that scalar code reads fastest.
        left: `steps.left` in the same form.
        flows: see `flows_at`; None before the first use.
        matrices: the matrices in groups of `ProbabilityMatrix.group_steps` steps, each group
            computed on first use.
    """

    first: int
    steps: Steps
    factors: Floats
    joint: Floats | None
    right: memoryview
    left: memoryview
    flows: list[tuple[Floats, Floats] | None]
    matrices: list[NDArray[np.float32] | None]

    def matrices_at(self, step: int) -> NDArray[np.float32]:
        """The matrices of the group of steps that holds a step: float32, (n, N, N)."""
        count = len(self.factors) // len(self.matrices)
        group = (step - self.first) // count
        matrices = self.matrices[group]
        if matrices is None:
            here = slice(group * count, (group + 1) * count)
            if self.joint is None:
                matrices = matrices_of(self.factors[here])
            else:
                joint = self.joint[here].swapaxes(0, 1)
                matrices = over_hypotheses(joint).astype(np.float32)
            self.matrices[group] = matrices
        return matrices

    def moves_at(self, step: int) -> tuple[Floats, Floats, Floats, Floats]:
        """See `ProbabilityMatrix.moves`; views."""
        index, shape = step - self.first, self.factors.shape[1:]
        right, left = self.steps.right[index].reshape(shape), self.steps.left[index].reshape(shape)
        return right[:, 0], left[:, 0], right[:, 1], left[:, 1]

    def flows_at(self, step: int) -> tuple[Floats, Floats]:
        """The probabilities of a step's moves, as factors of a belief.

        Returns:
            The probabilities to stay, to move right and to move left, given hypothesis and
            cell; and to stay, to move down and to move up. Float64; the first axis is the
            move, and the others broadcast with a belief of `belief_shape`.
        """
        flows = self.flows[step - self.first]
        if flows is None:
            right, left, down, up = self.moves_at(step)
            along_x = np.stack([1.0 - right - left, right, left])[:, :, None, :]
            along_y = np.stack([1.0 - down - up, down, up])[:, :, :, None]
            hypotheses, size = right.shape
            shape = belief_shape(hypotheses, size)
            if len(shape) == 1:
                full = (3, hypotheses, size, size)
                along_x, along_y = (
                    np.broadcast_to(moves, full).reshape(3, -1) for moves in (along_x, along_y)
                )
            flows = self.flows[step - self.first] = along_x, along_y
        return flows


def belief_shape(hypotheses: int, size: int) -> tuple[int, ...]:
    """The shape in which a belief drifts fastest: flat on small grids, else (M, N, N)."""
    # NumPy broadcasts short rows slowly.
    whole = (hypotheses, size, size)
    return (hypotheses * size**2,) if size <= _EXPANDED_SIZE else whole


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
    parameters::

        matrix = ProbabilityMatrix(20, Drift((8, 8), vector=(0.2, 0.1), diffusion=0.1)).at(30)

    Args:
        grid_size: cells along each side of the square grid, N.
        person: the person: a `Person`, or its `Drift` if there is only one.

    Attributes:
        weights: the probability of each hypothesis at step 0: float64, shape (M,).
        block_steps: the steps in each block of tables, a power of two; blocks begin at its
            multiples.
        group_steps: the steps whose matrices are computed together, also a power of two.

    Raises:
        TypeError: an argument is of the wrong type.
        ValueError: an argument is out of its limits.
    """

    def __init__(self, grid_size: int, person: Person | Drift) -> None:
        size = checks.integer("grid_size", grid_size, 2)
        if isinstance(person, Drift):
            person = Person((person,))
        if not isinstance(person, Person):
            raise TypeError(f"person must be a Person or a Drift, got {person!r}")
        person.check_grid(size)
        checks.fits("a matrix", 4 * size**2 * len(person.drifts), grid_size=size)
        self._parameters = (size, person)
        drifts = person.drifts
        self._key = (size, person.key)
        self.weights = np.array(person.weights)
        self._separable = all(drift.prior is None for drift in drifts)
        self.block_steps = min(_BLOCK_STEPS, _power_of_two(_BLOCK_BYTES // self._step_bytes()))
        self.group_steps = min(_GROUP_STEPS, _power_of_two(_GROUP_BYTES // (4 * size**2)))
        self.group_steps = min(self.group_steps, self.block_steps)
        self._initial = self._block = self._get_block(0, None)

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), self._parameters

    def is_same(self, other: ProbabilityMatrix) -> bool:
        """Whether another forecast is equal to this one at every step."""
        return self._key == other._key

    @property
    def grid_size(self) -> int:
        """Cells along each side of the grid."""
        return self._parameters[0]

    @property
    def person(self) -> Person:
        """The person."""
        return self._parameters[1]

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
        return over_hypotheses(self.joint(step))

    def joint(self, step: int) -> Floats:
        """The probability of each hypothesis and cell at a step: float64, shape (M, N, N)."""
        size = self.grid_size
        joint = np.empty((len(self.weights), size, size))
        self.write_joint(step, joint)
        return joint

    def write_joint(self, step: int, out: Floats) -> None:
        """`joint` into a given array."""
        block = self.block(step)
        if block.joint is None:
            x, y = block.factors[step - block.first].swapaxes(0, 1)
            np.multiply(y[:, :, None], x[:, None, :], out)
        else:
            out[...] = block.joint[step - block.first]

    def marginals(self, step: int) -> tuple[Floats, Floats]:
        """The probability of each column and of each row at a step: float64, shape (N,)."""
        block = self.block(step)
        x, y = block.factors[step - block.first].swapaxes(0, 1)
        return self.weights @ x, y.sum(axis=0)

    def moves(self, step: int) -> tuple[Floats, Floats, Floats, Floats]:
        """The probabilities of a person's moves from a step to the next.

        Returns:
            float64, shape (M, N), given the hypothesis and the column or row: to the right
            and to the left for each column, then down and up for each row.
        """
        right, left, down, up = (moves.copy() for moves in self.block(step).moves_at(step))
        return right, left, down, up

    @property
    def known_start(self) -> int | None:
        """The person's cell at step 0, y * N + x, if it is certain and the only hypothesis."""
        person = self.person
        if len(person.drifts) > 1 or not person.drifts[0].starts_in_known_cell:
            return None
        x, y = person.drifts[0].start
        return int(y) * self.grid_size + int(x)

    @cached_property
    def start_cumulative(self) -> Floats:
        """The cumulative distribution of `joint(0)`, flat: float64, shape (M * N * N,).

        It exceeds 1 from the last cell with a positive probability on, so that every uniform
        below 1 falls into a cell with one.
        """
        joint = self.joint(0).reshape(-1)
        cumulative = joint.cumsum()
        cumulative[joint.nonzero()[0][-1] :] = 2.0
        return cumulative

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
        size, hypotheses = self.grid_size, len(self.weights)
        flows = 6 * 8 * size * (size if size <= _EXPANDED_SIZE else 1)
        joint = 0 if self._separable else 8 * size**2
        return 4 * size**2 + hypotheses * (2 * size * 4 * 8 + flows + joint) + 512

    def _get_block(self, first: int, previous: Block | None) -> Block:
        block = _cache.get(self._key, first)
        if block is None:
            block = self._make_block(first, previous)
            _cache.put(self._key, first, block, self._step_bytes() * self.block_steps)
        return block

    def _make_block(self, first: int, previous: Block | None) -> Block:
        size, person = self._parameters
        count, hypotheses = self.block_steps, len(person.drifts)
        steps = tabulate(
            size,
            Axes.of(person.drifts),
            start_marginals(drift.prior for drift in person.drifts),
            first=first,
            count=count,
            cdf=None if previous is None else previous.steps.cdf,
        )
        factors = steps.probability.reshape(count, hypotheses, 2, size)
        if hypotheses > 1:
            factors = factors.copy()
            factors[:, :, 1] *= self.weights[:, None]
        block = Block(
            first=first,
            steps=steps,
            factors=factors,
            joint=None if self._separable else np.empty((count + 1, hypotheses, size, size)),
            right=steps.right.reshape(-1).data,
            left=steps.left.reshape(-1).data,
            flows=[None] * count,
            matrices=[None] * (count // self.group_steps),
        )
        if block.joint is not None:
            if previous is None:
                priors = [drift.prior for drift in person.drifts]
                block.joint[0] = joint_at_start(factors[0], self.weights, priors)
            else:
                assert previous.joint is not None
                block.joint[0] = previous.joint[-1]
            for index in range(count):
                moves = block.moves_at(first + index)
                block.joint[index + 1] = after_drift(block.joint[index], *moves)
        return block


def _power_of_two(number: int) -> int:
    """The largest power of two that is at most a number; at least 1."""
    return 1 << (max(1, number).bit_length() - 1)
