"""The drift model of a `Person`: a mixture of hypotheses, each drifting along x and y on its own.

A state is a hypothesis and a cell; mass is indexed [..., hypothesis, y, x]. The matrix of a
hypothesis is separable: at step t it is the outer product of one probability vector per axis.
Only if the start of one is an array, the matrices of all hypotheses are carried along by the
moves of each step. `tables` computes the vectors and the moves, in blocks of consecutive steps
on demand.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import numpy as np

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.arrays import Floats, Ints, Singles
from DroneSwarmSearch.drift.belief import Scratch, drifted, over_hypotheses, scratch_of
from DroneSwarmSearch.drift.forecast_tables import ForecastTables
from DroneSwarmSearch.drift.model import DriftModel
from DroneSwarmSearch.drift.persons import Drift, Person
from DroneSwarmSearch.drift.tables import (
    Axes,
    joint_at_start,
    matrices_of,
    moves,
    start_marginals,
    tabulate,
)

__all__ = ["ProbabilityMatrix"]

CACHE_BYTES = 16 * 2**20
"""The largest tables that a forecast keeps. Memory stops growing there, however long an episode
is; later tables are made again in each episode."""

_BLOCK_STEPS = 32
_BLOCK_BYTES = 4 * 2**20

_MATRICES_BYTES = 2**28
"""The largest transition matrices that a forecast keeps."""


class _Block(NamedTuple):
    """The tables of n consecutive steps, shared by all forecasts with the same parameters.

    Never pass these arrays to users. NumPy's read-only flag does not protect them, because
    other libraries (PyTorch's `as_tensor`, for example) ignore the flag.

    Attributes:
        first: the step at index 0 of everything below.
        factors: see `matrices_of`: float64, shape (n, M, 2, N).
        moves: the probabilities to stay, to move to the next higher column or row, and to the
            next lower one: float64, shape (3, n, M, 2, N).
        cdf: see `tables.Steps`.
        joint: the probability of each state: float64, shape (n + 1, M, N, N), one step more
            than the rest; None if all hypotheses are separable.
        matrices: the matrix of each step, computed on first use.
    """

    first: int
    factors: Floats
    moves: Floats
    cdf: Floats
    joint: Floats | None
    matrices: list[Singles | None]


@lru_cache(maxsize=16)
def _kept_blocks(key: Hashable) -> dict[int, _Block]:
    """The first blocks of a forecast, by number, which all forecasts with this key share."""
    return {}


class ProbabilityMatrix(DriftModel):
    """The forecast of a drifting person: the probability of each cell at each step.

    Objects with equal parameters share their tables. Copies and pickles hold only the
    parameters::

        matrix = ProbabilityMatrix(20, Drift((8, 8), vector=(0.2, 0.1), diffusion=0.1)).at(30)

    Args:
        grid_size: cells along each side of the square grid, N.
        person: the person: a `Person`, or its `Drift` if there is only one.

    Attributes:
        weights: the probability of each hypothesis at step 0: float64, shape (M,).

    Raises:
        TypeError: an argument is of the wrong type.
        ValueError: an argument is out of its limits.
    """

    def __init__(self, grid_size: int, person: Person | Drift) -> None:
        self.grid_size = size = checks.integer("grid_size", grid_size, 2)
        if isinstance(person, Drift):
            person = Person((person,))
        if not isinstance(person, Person):
            raise TypeError(f"person must be a Person or a Drift, got {person!r}")
        person.check_grid(size)
        hypotheses = len(person.drifts)
        checks.fits("a matrix", 4 * size**2 * hypotheses, grid_size=size)
        self.person = person
        self.key = size, person.key
        self.weights = np.array(person.weights)
        self._separable = all(drift.prior is None for drift in person.drifts)
        joint = 0 if self._separable else 8 * size**2
        self._step_bytes = 4 * size**2 + hypotheses * (8 * 8 * size + joint) + 512
        self._block_steps = min(max(_BLOCK_BYTES // self._step_bytes, 1), _BLOCK_STEPS)
        self._matrices: dict[int, Floats] = {}  # along x and y, by step
        self._block: _Block | None = None  # used last

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), (self.grid_size, self.person)

    # The forecast.

    def matrix(self, step: int) -> Singles:
        block = self._block_of(step)
        index = step - block.first
        matrix = block.matrices[index]
        if matrix is None:
            if block.joint is None:
                matrix = matrices_of(block.factors[index])
            else:
                matrix = over_hypotheses(block.joint[index]).astype(np.float32)
            block.matrices[index] = matrix
        return matrix

    def joint(self, step: int) -> Floats:
        """The probability of each hypothesis and cell at a step: float64, shape (M, N, N)."""
        block = self._block_of(step)
        if block.joint is not None:
            joint: Floats = block.joint[step - block.first].copy()
        else:
            x, y = block.factors[step - block.first].swapaxes(0, 1)
            joint = y[:, :, None] * x[:, None, :]
        return joint

    def marginals(self, step: int) -> tuple[Floats, Floats]:
        """The probability of each column and of each row at a step: float64, shape (N,)."""
        block = self._block_of(step)
        x, y = block.factors[step - block.first].swapaxes(0, 1)
        return self.weights @ x, y.sum(axis=0)

    def moves(self, step: int) -> tuple[Floats, Floats, Floats, Floats]:
        """The probabilities of a person's moves from a step to the next.

        Returns:
            float64, shape (M, N), given the hypothesis and the column or row: to the right
            and to the left for each column, then down and up for each row.
        """
        _, higher, lower = self._moves(step)
        right, left, down, up = (
            moves[:, axis].copy() for axis in (0, 1) for moves in (higher, lower)
        )
        return right, left, down, up

    # The steps of a distribution.

    def forward(self, mass: Floats, step: int) -> Floats:
        along_x, along_y = self.matrices(step)
        moved: Floats = along_y.swapaxes(-1, -2) @ mass @ along_x
        return moved

    def backward(self, value: Floats, step: int) -> Floats:
        along_x, along_y = self.matrices(step)
        expected: Floats = along_y @ value @ along_x.swapaxes(-1, -2)
        return expected

    def drift(self, mass: Floats, step: int) -> Floats:
        return _drifted(mass, self._moves(step), self._scratch).copy()

    @cached_property
    def _scratch(self) -> Scratch:  # making it anew takes as long as a drift
        return scratch_of(np.empty(self.state_shape))

    def matrices(self, step: int) -> tuple[Floats, Floats]:
        """The transition matrices of a step along x and y: shape (M, N, N), from [i] to [j]."""
        if step not in self._matrices:
            self._add_matrices(self._block_of(step))
        along_x, along_y = self._matrices[step]
        return along_x, along_y

    def _add_matrices(self, block: _Block) -> None:
        stays, higher, lower = block.moves.swapaxes(2, 3)  # each (n, 2, M, N)
        here = np.arange(self.grid_size)
        matrices = np.zeros((*stays.shape, self.grid_size))
        matrices[..., here, here] = stays
        matrices[..., here[:-1], here[1:]] = higher[..., :-1]
        matrices[..., here[1:], here[:-1]] = lower[..., 1:]
        if len(self._matrices) * matrices[0].nbytes > _MATRICES_BYTES:
            self._matrices.clear()
        self._matrices.update(enumerate(matrices, block.first))

    # The steps of a person.

    def walk(
        self, state: int, step: int, draws_x: Sequence[float], draws_y: Sequence[float]
    ) -> list[int]:
        size, hypotheses = self.grid_size, self.state_shape[0]
        hypothesis, cell = divmod(state, size**2)
        y, x = divmod(cell, size)
        path = []
        end = step  # of the block
        for u, v in zip(draws_x, draws_y, strict=True):
            if step == end:
                block = self._block_of(step)
                higher, lower = (each.reshape(-1).data for each in block.moves[1:])
                row = ((step - block.first) * hypotheses + hypothesis) * 2 * size
                end = block.first + self._block_steps
            at = row + x
            if u < higher[at]:
                x += 1
            elif u < higher[at] + lower[at]:
                x -= 1
            at = row + size + y
            if v < higher[at]:
                y += 1
            elif v < higher[at] + lower[at]:
                y -= 1
            path.append((hypothesis * size + y) * size + x)
            row += 2 * size * hypotheses
            step += 1
        return path

    def moved(self, states: Ints, step: int, draws_x: Floats, draws_y: Floats) -> Ints:
        _, higher, lower = self._moves(step)
        hypotheses, y, x = np.unravel_index(states, self.state_shape)
        across, along = (hypotheses, 0, x), (hypotheses, 1, y)
        new: Ints = states + moves(draws_x, higher[across], higher[across] + lower[across])
        return new + self.grid_size * moves(draws_y, higher[along], higher[along] + lower[along])

    def branches(self, states: Ints, probabilities: Floats, step: int) -> tuple[Ints, Ints, Floats]:
        falls_stays_rises = self._moves(step)[[2, 0, 1]]
        hypotheses, y, x = np.unravel_index(states, self.state_shape)
        along_x = falls_stays_rises[:, hypotheses, 0, x]
        along_y = falls_stays_rises[:, hypotheses, 1, y]
        onward = probabilities * along_y[:, None] * along_x  # [dy + 1, dx + 1, person]
        dy, dx, place = onward.nonzero()
        return place, states[place] + (dy - 1) * self.grid_size + dx - 1, onward[dy, dx, place]

    @classmethod
    def together(cls, models: Sequence[Any], **options: Any) -> ForecastTables:
        return ForecastTables([model.person for model in models], models, **options)

    # The tables.

    def _moves(self, step: int) -> Floats:
        block = self._block_of(step)
        moves: Floats = block.moves[:, step - block.first]
        return moves

    @cached_property
    def _kept(self) -> dict[int, _Block]:
        return _kept_blocks(self.key)

    def _block_of(self, step: int) -> _Block:
        """The tables that hold a step; fast if steps are in ascending order."""
        block = self._block
        if block is not None and type(step) is int and 0 <= step - block.first < self._block_steps:
            return block
        number, done = checks.integer("step", step, 0) // self._block_steps, 0
        if block is not None and block.first <= step:
            done = block.first // self._block_steps + 1
        for each in range(done, number + 1):
            previous = block if each else None
            block = self._kept.get(each) or self._made(each * self._block_steps, previous)
            if (each + 1) * self._block_steps * self._step_bytes <= CACHE_BYTES:
                self._kept[each] = block
        assert block is not None
        self._block = block
        return block

    def _made(self, first: int, previous: _Block | None) -> _Block:
        """The block that begins with a step."""
        size, drifts, count = self.grid_size, self.person.drifts, self._block_steps
        priors = [drift.prior for drift in drifts]
        steps = tabulate(
            size,
            Axes.of(drifts),
            start_marginals(priors),
            first=first,
            count=count,
            cdf=None if previous is None else previous.cdf,
        )
        shape = (count, len(drifts), 2, size)
        factors, right, left = (
            table.reshape(shape) for table in (steps.probability, steps.right, steps.left)
        )
        factors = factors.copy()
        factors[:, :, 1] *= self.weights[:, None]
        moves = np.stack([1.0 - right - left, right, left])
        joint = None
        if not self._separable:
            joint = np.empty((count + 1, *self.state_shape))
            if previous is None or previous.joint is None:
                joint[0] = joint_at_start(factors[0], self.weights, priors)
            else:
                joint[0] = previous.joint[-1]
            for index, each in enumerate(moves.swapaxes(0, 1)):
                joint[index + 1] = _drifted(joint[index], each)
        return _Block(first, factors, moves, steps.cdf, joint, [None] * count)


def _drifted(mass: Floats, moves: Floats, scratch: Scratch | None = None) -> Floats:
    """Mass of shape (M, N, N) one step later, given its moves, of shape (3, M, 2, N)."""
    return drifted(mass, moves[:, :, 0, None], moves[:, :, 1, :, None], scratch)
