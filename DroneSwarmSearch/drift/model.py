"""The interface of a drift model: where a person may be, and how the person moves.

A *state* is what a person's next move depends on: a cell, and one of M hypotheses about the
person. States are numbered (hypothesis * N + y) * N + x. *Mass*, the probability of each state,
and *value*, what is expected of a person in it, are float64 arrays of shape (..., M, N, N). All
other code only uses the methods below, so that a new model needs nothing outside this folder.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Hashable, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from DroneSwarmSearch._internal.arrays import Floats, Ints, Singles

__all__ = ["DriftModel", "Forecasts"]

_BLOCK_STEPS = 32
_BLOCK_BYTES = 2**22


class DriftModel(ABC):
    """How one person may drift over a grid.

    Attributes:
        grid_size: cells along each side of the grid, N.
        key: equal for models with equal forecasts.
        weights: the probability of each hypothesis about the person at step 0: float64, (M,).
    """

    grid_size: int
    key: Hashable
    weights: Floats

    # The forecast.

    @abstractmethod
    def joint(self, step: int) -> Floats:
        """The probability of each state at a step, without searches; a new array."""

    def exact(self, step: int) -> Floats:
        """The matrix at a step in double precision: float64, shape (N, N), indexed [y, x]."""
        return self.map(self.joint(step)).copy()

    def matrix(self, step: int) -> Singles:
        """`at`, for reading only."""
        return self.exact(step).astype(np.float32)

    def at(self, step: int) -> Singles:
        """The matrix at a step: float32, shape (N, N), indexed [y, x], sums to 1; a new array.

        Raises:
            TypeError: the step is not an integer.
            ValueError: the step is negative.
        """
        return self.matrix(step).copy()

    # States and cells.

    @property
    def state_shape(self) -> tuple[int, int, int]:
        """The shape of mass, (M, N, N)."""
        return len(self.weights), self.grid_size, self.grid_size

    def map(self, mass: Floats) -> Floats:
        """The mass in each cell, shape (..., N, N); may be a view."""
        total: Floats = mass[..., 0, :, :]
        for hypothesis in range(1, mass.shape[-3]):
            total = total + mass[..., hypothesis, :, :]
        return total

    def lift(self, values: Floats) -> Floats:
        """Values of cells, shape (..., N, N), in a form that broadcasts with mass."""
        lifted: Floats = values[..., None, :, :]
        return lifted

    def states(self, cell: int) -> slice:
        """The index of a cell's states in flat mass, ``mass.reshape(-1)``."""
        return slice(cell, None, self.grid_size**2)

    def cells(self, states: Any) -> Any:
        """The cells, y * N + x, of states."""
        return states % self.grid_size**2

    def hypotheses(self, mass: Floats) -> tuple[float, ...]:
        """The probability of each hypothesis about the person, given the mass."""
        shares: list[float] = mass.sum(axis=(1, 2)).tolist()
        return tuple(shares)

    # The steps of a distribution.

    @abstractmethod
    def forward(self, mass: Floats, step: int) -> Floats:
        """The mass one step later, given that before it."""

    @abstractmethod
    def backward(self, value: Floats, step: int) -> Floats:
        """The expected value before a step, given that after it."""

    def drift(self, mass: Floats, step: int) -> Floats:
        """`forward` of a single belief, in arithmetic that does not depend on the batch."""
        return self.forward(mass, step)

    def matrices(self, step: int) -> tuple[Floats, Floats] | None:
        """The transition matrices of a step along x and y, from [i] to [j]: (M, N, N) each.

        They make planning faster. None unless x and y move independently, and by a cell at most.
        """
        return None

    # The steps of a person.

    def start(self, draws: Any) -> Any:
        """The state at step 0 of one person or of several, one for each uniform draw in [0, 1)."""
        return self._starts.searchsorted(draws, side="right")

    @cached_property
    def _starts(self) -> Floats:
        return _cumulative(self.joint(0))

    def walk(
        self, state: int, step: int, draws_x: Sequence[float], draws_y: Sequence[float]
    ) -> list[int]:
        """The state of one person after each of several steps.

        Args:
            state: the person's state.
            step: completed steps.
            draws_x: a uniform draw from [0, 1) for each step.
            draws_y: another one for each step.
        """
        path = []
        for u, v in zip(draws_x, draws_y, strict=True):
            (state,) = self.moved(np.array([state]), step, np.array([u]), np.array([v])).tolist()
            path.append(state)
            step += 1
        return path

    @abstractmethod
    def moved(self, states: Ints, step: int, draws_x: Floats, draws_y: Floats) -> Ints:
        """`walk` for many persons and one step.

        Args:
            states: the persons' states, shape (n,).
            step: completed steps.
            draws_x: a uniform draw from [0, 1) for each person.
            draws_y: another one for each person.
        """

    @abstractmethod
    def branches(self, states: Ints, probabilities: Floats, step: int) -> tuple[Ints, Ints, Floats]:
        """All ways in which persons, in states of some probabilities, (n,), may move on in a step.

        Returns, for each way, the person's index, the state one step later, and its probability.
        """

    # The array form.

    @classmethod
    def together(cls, models: Sequence[Any], **options: Any) -> Forecasts:
        """The array form of several models of this class; `options` are those of `Forecasts`."""
        return Forecasts(models, **options)


def forecasts_of(models: Sequence[DriftModel], **options: Any) -> tuple[Forecasts, Ints]:
    """The `Forecasts` of models on one grid, and each model's number; equal ones share it."""
    different = {model.key: model for model in models}
    places = {key: number for number, key in enumerate(different)}
    kinds = {type(model) for model in models}
    kind = kinds.pop() if len(kinds) == 1 else DriftModel
    forecasts = kind.together([*different.values()], **options)
    return forecasts, np.array([places[model.key] for model in models])


def _cumulative(joint: Floats) -> Floats:
    """The cumulative distribution of the states at step 0, flat; at the end it exceeds any draw."""
    sums: Floats = joint.cumsum()
    sums[joint.reshape(-1).nonzero()[0][-1] :] = 2.0
    return sums


class Forecasts:
    """The array form of `DriftModel`: many rows, each with one of several models and its own step.

    Models on one grid have numbers, and an *entry* is one step of one model: step * `count` +
    number. Tables of the entries grow up to the step `last`, see `reach`. This class handles any
    models, one row at a time; subclasses are faster for models of one kind. Models with fewer
    hypotheses than others, or than `hypotheses` at first, are padded with mass 0. With
    `keeps_matrices`, the matrices of all entries are a table, too.
    """

    def __init__(
        self, models: Sequence[DriftModel], *, last: int, hypotheses: int, keeps_matrices: bool
    ) -> None:
        self.models = tuple(models)
        self.count = len(models)
        self.hypotheses = max(hypotheses, *(len(model.weights) for model in models))
        self._size, self._last = models[0].grid_size, last
        empty: Singles = np.zeros((0, self._size, self._size), np.float32)
        self._matrices = empty if keeps_matrices else None
        self._filled = 0  # steps

    # The tables.

    @property
    def step_bytes(self) -> int:
        """The memory of the tables for each step."""
        return self.count * 4 * self._size**2

    def reach(self, step: int) -> None:
        """Fill the tables up to this step, at most to the last one."""
        step = min(step, self._last)
        while self._filled <= step:
            usual = max(1, min(_BLOCK_STEPS, _BLOCK_BYTES // self.step_bytes), self._filled)
            more = min(usual, self._last + 1 - self._filled)
            self._fill(more)
            first, self._filled = self._filled, self._filled + more
            if self._matrices is not None:
                new = np.arange(first * self.count, self._filled * self.count)
                self._matrices = np.concatenate([self._matrices, self._computed(new)])

    def _fill(self, steps: int) -> None:
        """Fill the tables but for the matrices for some more steps."""

    @property
    def table(self) -> Singles:
        """The matrices of all entries so far: float32, (entries, N, N), read-only."""
        assert self._matrices is not None
        table = self._matrices.view()
        table.flags.writeable = False
        return table

    # The forecast.

    def _each(self, entries: Ints) -> list[tuple[DriftModel, int]]:
        """The model and the step of some entries."""
        steps, numbers = np.divmod(entries, self.count)
        pairs = zip(numbers.tolist(), steps.tolist(), strict=True)
        return [(self.models[number], step) for number, step in pairs]

    def joint(self, entries: Ints) -> Floats:
        """The probability of each state: float64, (n, M, N, N)."""
        joint = np.zeros((len(entries), self.hypotheses, self._size, self._size))
        for mass, (model, step) in zip(joint, self._each(entries), strict=True):
            mass[: len(model.weights)] = model.joint(step)
        return joint

    def matrices(self, entries: Ints, out: Singles | None = None) -> Singles:
        """The matrices: float32, (n, N, N)."""
        if self._matrices is not None:
            return self._matrices.take(entries, 0, out=out, mode="clip")
        matrices = self._computed(entries)
        if out is not None:
            out[...] = matrices
        return matrices

    def _computed(self, entries: Ints) -> Singles:
        matrices: Singles = np.empty((len(entries), self._size, self._size), np.float32)
        for matrix, (model, step) in zip(matrices, self._each(entries), strict=True):
            matrix[...] = model.matrix(step)
        return matrices

    def probabilities(self, entries: Ints, cells: Ints) -> Singles:
        """The matrix entry of one cell in each of some entries: float32, (n,)."""
        if self._matrices is not None:
            return self._matrices.take(entries * self._size**2 + cells, mode="clip")
        return self._computed(entries).reshape(-1, self._size**2)[np.arange(len(cells)), cells]

    def drift(self, mass: Floats, entries: Ints) -> None:
        """Let mass, (M, N, N, n) and C-contiguous, drift by a step from its entries, in place."""
        for row, (model, step) in enumerate(self._each(entries)):
            own = np.ascontiguousarray(mass[: len(model.weights), ..., row])
            mass[: len(own), ..., row] = model.drift(own, step)

    # Persons.

    def start(self, numbers: Ints, draws: Floats) -> Ints:
        """The states at step 0 given the numbers of the persons' models and uniform draws."""
        pairs = zip(numbers.flat, draws.flat, strict=True)
        states = [self._starts[number].searchsorted(draw, side="right") for number, draw in pairs]
        return np.array(states, np.int64).reshape(numbers.shape)

    @cached_property
    def _starts(self) -> list[Floats]:
        self.reach(0)
        return [_cumulative(joint) for joint in self.joint(np.arange(self.count))]

    @cached_property
    def certain_starts(self) -> Ints | None:
        """The state at step 0 of each model, if all of them are certain: int64, (count,)."""
        self.reach(0)
        joint = self.joint(np.arange(self.count)).reshape(self.count, -1)
        is_certain = (np.count_nonzero(joint, axis=1) == 1).all()
        return joint.argmax(axis=1) if is_certain else None

    def walk(self, states: Ints, entries: Ints, draws: Floats) -> Ints:
        """The states, (...), one step later, given the entries before it and draws, (2, ...)."""
        after = states.copy()
        for entry in np.unique(entries):
            ((model, step),) = self._each(entry[None])
            who = entries == entry
            after[who] = model.moved(states[who], step, *draws[:, who])
        return after
