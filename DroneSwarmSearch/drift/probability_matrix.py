"""The drift model of `Hypotheses`: a mixture of them, which drift along x and y on their own.

The matrix of a hypothesis is separable: at step t it is the outer product of one probability
vector per axis. Only if the start of one is an array, the matrices of all hypotheses are carried
along by the moves of each step. `axes` computes both in blocks of consecutive steps on demand.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import numpy as np

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.arrays import Floats, Ints, Singles
from DroneSwarmSearch._internal.cells import cell_number, cell_position
from DroneSwarmSearch.drift.axes import (
    Drifter,
    Steps,
    joint_of,
    matrices_of,
    moves_of,
    tabulate,
)
from DroneSwarmSearch.drift.forecast_tables import ForecastTables
from DroneSwarmSearch.drift.model import BLOCK_BYTES, BLOCK_STEPS, DriftModel
from DroneSwarmSearch.persons.hypotheses import Hypotheses

CACHE_BYTES = 16 * 2**20
"""The largest tables that a forecast keeps; later ones are made again in each episode."""

_TRANSITIONS_BYTES = 2**28  # the largest transition matrices that a forecast keeps


class _Block(NamedTuple):
    """The tables of consecutive steps of one person, shared by forecasts with equal parameters.

    Never pass these arrays to users: other libraries ignore NumPy's read-only flag.
    """

    first: int
    steps: Steps
    matrices: dict[int, Singles]  # by step, computed on first use


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
        known: what is known of the person's drift: a `Drift`, a sequence of them, their
            `Hypotheses`, or a `Person` made of them.

    Raises:
        TypeError: an argument is of the wrong type.
        ValueError: an argument is out of its limits.
    """

    def __init__(self, grid_size: int, known: Any) -> None:
        self.grid_size = size = checks.integer("grid_size", grid_size, 2)
        known = getattr(known, "drift", known)
        self.known = known = known if isinstance(known, Hypotheses) else Hypotheses(known)
        known.check(size, 0, "known")
        hypotheses = len(known.drifts)
        checks.fits("a matrix", 4 * size**2 * hypotheses, grid_size=size)
        self.key = size, known.key
        self.weights = np.array(known.weights)
        self._separable = all(drift.prior is None for drift in known.drifts)
        joint = 0 if self._separable else 8 * size**2
        self._step_bytes = 4 * size**2 + hypotheses * (8 * 8 * size + joint) + 512
        self._block_steps = min(max(BLOCK_BYTES // self._step_bytes, 1), BLOCK_STEPS)
        self._transitions: dict[int, Floats] = {}  # along x and y, by step
        self._block: _Block | None = None  # used last

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), (self.grid_size, self.known)

    # The forecast.

    def matrix(self, step: int) -> Singles:
        block = self._block_of(step)
        step = int(step)
        if step not in block.matrices:
            is_separable = block.steps.joint is None
            matrix = matrices_of(self._factors(step)) if is_separable else super().matrix(step)
            block.matrices[step] = matrix
        return block.matrices[step]

    def joint(self, step: int) -> Floats:
        block = self._block_of(step)
        if block.steps.joint is None:
            return joint_of(self._factors(step))
        joint: Floats = block.steps.joint[step - block.first, 0].copy()
        return joint

    def marginals(self, step: int) -> tuple[Floats, Floats]:
        """The probability of each column and of each row at a step: float64, shape (N,)."""
        x, y = self._factors(step).swapaxes(0, 1)
        return self.weights @ x, y.sum(axis=0)

    def moves(self, step: int) -> tuple[Floats, Floats, Floats, Floats]:
        """The probabilities of a person's moves from a step to the next: float64, (M, N) each.

        To the right and to the left for each hypothesis and column, then down and up for each row.
        """
        _, higher, lower = self._moves(step).copy()
        return higher[:, 0], lower[:, 0], higher[:, 1], lower[:, 1]

    # The steps of a distribution.

    def forward(self, mass: Floats, step: int) -> Floats:
        along_x, along_y = self.transitions(step)
        moved: Floats = along_y.swapaxes(-1, -2) @ mass @ along_x
        return moved

    def backward(self, value: Floats, step: int) -> Floats:
        along_x, along_y = self.transitions(step)
        expected: Floats = along_y @ value @ along_x.swapaxes(-1, -2)
        return expected

    def drift(self, mass: Floats, step: int) -> Floats:
        return self._drifter(mass, self._moves(step))

    @cached_property
    def _drifter(self) -> Drifter:
        return Drifter(self.state_shape)

    def transitions(self, step: int) -> tuple[Floats, Floats]:
        if step not in self._transitions:
            stays, higher, lower = self._moves(step).swapaxes(1, 2)  # each (2, M, N)
            here = np.arange(self.grid_size)
            transitions = np.zeros((*stays.shape, self.grid_size))
            transitions[..., here, here] = stays
            transitions[..., here[:-1], here[1:]] = higher[..., :-1]
            transitions[..., here[1:], here[:-1]] = lower[..., 1:]
            if len(self._transitions) * transitions.nbytes > _TRANSITIONS_BYTES:
                self._transitions.clear()
            self._transitions[step] = transitions
        along_x, along_y = self._transitions[step]
        return along_x, along_y

    # The steps of a person.

    def walk(
        self, state: int, step: int, draws_x: Sequence[float], draws_y: Sequence[float]
    ) -> list[int]:
        size = self.grid_size
        hypotheses = self.state_shape[0]
        hypothesis, cell = divmod(state, size**2)
        x, y = cell_position(cell, size)
        first_state = state - cell
        path = []
        end = step  # of the block
        for u, v in zip(draws_x, draws_y, strict=True):
            if step == end:
                block = self._block_of(step)
                higher, lower = (move.reshape(-1).data for move in block.steps.moves[1:])
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
            path.append(first_state + cell_number(x, y, size))
            row += 2 * size * hypotheses
            step += 1
        return path

    def moved(self, states: Ints, step: int, draws_x: Floats, draws_y: Floats) -> Ints:
        _, higher, lower = self._moves(step)
        hypotheses, y, x = np.unravel_index(states, self.state_shape)
        across = (hypotheses, 0, x)
        along = (hypotheses, 1, y)
        new: Ints = states + moves_of(draws_x, higher[across], higher[across] + lower[across])
        return new + self.grid_size * moves_of(draws_y, higher[along], higher[along] + lower[along])

    def branches(self, states: Ints, probabilities: Floats, step: int) -> tuple[Ints, Ints, Floats]:
        falls_stays_rises = self._moves(step)[[2, 0, 1]]
        hypotheses, y, x = np.unravel_index(states, self.state_shape)
        along_x = falls_stays_rises[:, hypotheses, 0, x]
        along_y = falls_stays_rises[:, hypotheses, 1, y]
        onward = probabilities * along_y[:, None] * along_x  # [dy + 1, dx + 1, person]
        dy, dx, index = onward.nonzero()
        return index, states[index] + (dy - 1) * self.grid_size + dx - 1, onward[dy, dx, index]

    @classmethod
    def batched(cls, models: Sequence[Any], **options: Any) -> ForecastTables:
        return ForecastTables(models, **options)

    # The tables.

    def _factors(self, step: int) -> Floats:
        block = self._block_of(step)
        factors: Floats = block.steps.factors[step - block.first, 0]
        return factors

    def _moves(self, step: int) -> Floats:
        block = self._block_of(step)
        moves: Floats = block.steps.moves[:, step - block.first, 0]
        return moves

    @cached_property
    def _kept(self) -> dict[int, _Block]:
        return _kept_blocks(self.key)

    def _block_of(self, step: int) -> _Block:
        """The tables that hold a step; fast if steps are in ascending order."""
        block = self._block
        count = self._block_steps
        if block is not None and type(step) is int and 0 <= step - block.first < count:
            return block
        number = checks.integer("step", step, 0) // count
        done = 0 if block is None or step < block.first else block.first // count + 1
        for step in range(done, number + 1):
            first = step * count
            previous = block.steps if block is not None and step else None
            block = self._kept.get(step)
            if block is None:
                steps = tabulate(self.grid_size, [self.known], first, count, previous)
                block = _Block(first, steps, {})
            if (step + 1) * count * self._step_bytes <= CACHE_BYTES:
                self._kept[step] = block
        assert block is not None
        self._block = block
        return block
