"""The interface of a drift model: where a person may be, and how the person moves.

A *state* is what a person's next move depends on, such as a cell and a hypothesis about the
person. *Mass*, the probability of each state, and *value*, what is expected of a person in it, are
float64 arrays of shape (M, R, N): M layers with R * N *slots*, each of which belongs to one cell,
the same one in all layers. The number of a state is its index in flat mass. Usually a layer is the
grid, and the slot of a cell is y * N + x. All other code only uses the methods below, so that a
new model needs nothing outside this folder.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Hashable, Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch._internal.arrays import Floats, Ints, Singles

# of tables: the most that are filled at a time
BLOCK_STEPS = 32
BLOCK_BYTES = 2**22


class DriftModel(ABC):
    """How one person may drift over a grid.

    Attributes:
        grid_size: cells along each side of the grid, N.
        key: equal for models with equal forecasts.
        weights: the probability of each hypothesis about the person at step 0: float64, (H,).
        kept_cells: the cells that have slots, in their order; None for all cells of the grid.
    """

    grid_size: int
    key: Hashable
    weights: Floats
    kept_cells: Ints | None = None

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
        """The shape of mass, (M, R, N)."""
        if self.kept_cells is None:
            return len(self.weights), self.grid_size, self.grid_size
        return len(self.weights), len(self.kept_cells) // self.grid_size + 1, self.grid_size

    @property
    def layer(self) -> int:
        """The number of slots in a layer of mass, R * N."""
        return self.state_shape[1] * self.grid_size

    @cached_property
    def slots(self) -> Ints:
        """The slot of each cell in a layer: int64, (N²,).

        All cells outside the model share one extra slot, whose mass is always 0.
        """
        if self.kept_cells is None:
            return np.arange(self.grid_size**2)
        slots = np.full(self.grid_size**2, len(self.kept_cells))
        slots[self.kept_cells] = np.arange(len(self.kept_cells))
        return slots

    def map(self, mass: Floats) -> Floats:
        """The mass in each cell, shape (..., N, N), given (..., M, R, N); may be a view."""
        total: Floats = mass[..., 0, :, :]
        for layer in range(1, mass.shape[-3]):
            total = total + mass[..., layer, :, :]
        if self.kept_cells is None:
            return total
        grid = total.reshape(*total.shape[:-2], -1).take(self.slots, -1)
        return grid.reshape(*total.shape[:-2], self.grid_size, self.grid_size)

    def lift(self, values: Floats) -> Floats:
        """Values of cells, (..., N, N), in a form that broadcasts with mass: (..., 1, R, N)."""
        if self.kept_cells is not None:
            flat = values.reshape(*values.shape[:-2], -1)[..., self._cell_of]
            values = flat.reshape(*flat.shape[:-1], *self.state_shape[1:])
        lifted: Floats = values[..., None, :, :]
        return lifted

    def states(self, cell: int) -> slice:
        """The index of a cell's states in flat mass, ``mass.reshape(-1)``."""
        if self.kept_cells is None:
            return slice(cell, None, self.grid_size**2)
        return slice(int(self.slots[cell]), None, self.layer)

    def cells(self, states: Any) -> Any:
        """The cells, y * N + x, of states."""
        slots = states % self.layer
        return slots if self.kept_cells is None else self._cell_of[slots]

    @cached_property
    def _cell_of(self) -> Ints:
        """The cell of each slot; 0 for those without one, whose mass is always 0."""
        assert self.kept_cells is not None
        return np.append(self.kept_cells, np.zeros(self.layer - len(self.kept_cells), np.int64))

    def by_hypothesis(self, mass: Floats) -> Floats:
        """The mass in each cell by hypothesis about the person: shape (H, N, N); may be a view."""
        return self.map(mass.reshape(len(self.weights), -1, *mass.shape[1:]))

    def hypotheses(self, mass: Floats) -> tuple[float, ...]:
        """The probability of each hypothesis about the person, given the mass."""
        by_hypothesis = mass.reshape(len(self.weights), -1, mass.shape[-1])
        shares: list[float] = by_hypothesis.sum(axis=(1, 2)).tolist()
        return tuple(shares)

    # The steps of a distribution.

    @abstractmethod
    def forward(self, mass: Floats, step: int) -> Floats:
        """The mass one step later, given that before it."""

    @abstractmethod
    def backward(self, value: Floats, step: int) -> Floats:
        """The expected value before a step, given the expected value after it."""

    def forward_each(self, masses: Floats, step: int) -> Floats:
        """`forward` of several masses: (n, M, R, N)."""
        return np.stack([self.forward(mass, step) for mass in masses])

    def backward_each(self, values: Floats, step: int) -> Floats:
        """`backward` of several values: (n, M, R, N)."""
        return np.stack([self.backward(value, step) for value in values])

    def drift(self, mass: Floats, step: int) -> Floats:
        """`forward` of a single belief, in arithmetic that does not depend on the batch."""
        return self.forward(mass, step)

    def transitions(self, step: int) -> tuple[Floats, Floats] | None:
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
        return cumulative(self.joint(0))

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
    def batched(cls, models: Sequence[Any], **options: Any) -> Forecasts:
        """The array form of several models of this class; `options` are those of `Forecasts`."""
        return Forecasts(models, **options)


def forecasts_of(models: Sequence[DriftModel], **options: Any) -> tuple[Forecasts, Ints]:
    """The `Forecasts` of models on one grid, and each model's number; equal ones share it."""
    different = {model.key: model for model in models}
    indices = {key: number for number, key in enumerate(different)}
    kinds = {type(model) for model in models}
    kind = kinds.pop() if len(kinds) == 1 else DriftModel
    forecasts = kind.batched([*different.values()], **options)
    return forecasts, np.array([indices[model.key] for model in models])


def cumulative(joint: Floats) -> Floats:
    """The cumulative distribution of the states at step 0, flat; at the end it exceeds any draw."""
    sums: Floats = joint.cumsum()
    sums[joint.reshape(-1).nonzero()[0][-1] :] = 2.0
    return sums


def over_layers(mass: NDArray[Any]) -> NDArray[Any]:
    """The sum over the layers of mass, (...), given (M, ...); may be a view."""
    total: NDArray[Any] = mass[0]
    for part in mass[1:]:
        total = total + part
    return total


class Forecasts:
    """The array form of `DriftModel`: many rows, each with one of several models and its own step.

    Models on one grid have indices, and an *entry* is one step of one model: step * `count` +
    number. Tables of the entries grow up to the step `last`, see `reach`. This class handles any
    models, one row at a time; subclasses are faster for models of one kind. Mass has the `shape`
    (M, L), layers and their slots: models with fewer of them than others are padded with mass 0.
    With `keeps_matrices`, the matrices of all entries are a table, too, `_map_table`.
    """

    def __init__(self, models: Sequence[DriftModel], *, last: int, keeps_matrices: bool) -> None:
        self.models = tuple(models)
        self.count = len(models)
        layers = max(model.state_shape[0] for model in models)
        self.shape = layers, max(model.layer for model in models)
        self._size = models[0].grid_size
        self._last = last
        empty: Singles = np.zeros((0, self._size, self._size), np.float32)
        self._map_table = empty if keeps_matrices else None
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
            usual = max(1, min(BLOCK_STEPS, BLOCK_BYTES // self.step_bytes), self._filled)
            more = min(usual, self._last + 1 - self._filled)
            self._fill(more)
            first = self._filled
            self._filled = self._filled + more
            if self._map_table is not None:
                new = np.arange(first * self.count, self._filled * self.count)
                self._map_table = np.concatenate([self._map_table, self._computed(new)])

    def _fill(self, steps: int) -> None:
        """Fill the tables but for the matrices for some more steps."""

    # The forecast.

    def _each(self, entries: Ints) -> list[tuple[DriftModel, int]]:
        """The model and the step of some entries."""
        steps, indices = np.divmod(entries, self.count)
        pairs = zip(indices.tolist(), steps.tolist(), strict=True)
        return [(self.models[number], step) for number, step in pairs]

    def joint(self, entries: Ints) -> Floats:
        """The probability of each state: float64, (n, M, L)."""
        different, which = np.unique(entries, return_inverse=True)
        joint = np.zeros((len(different), *self.shape))
        for mass, (model, step) in zip(joint, self._each(different), strict=True):
            mass[: model.state_shape[0], : model.layer] = model.joint(step).reshape(-1, model.layer)
        return joint[which]

    def matrices(self, entries: Ints, out: Singles | None = None) -> Singles:
        """The matrices: float32, (n, N, N)."""
        if self._map_table is not None:
            return self._map_table.take(entries, 0, out=out, mode="clip")
        matrices = self._computed(entries)
        if out is not None:
            out[...] = matrices
        return matrices

    def _computed(self, entries: Ints) -> Singles:
        different, which = np.unique(entries, return_inverse=True)
        matrices: Singles = np.empty((len(different), self._size, self._size), np.float32)
        for matrix, (model, step) in zip(matrices, self._each(different), strict=True):
            matrix[...] = model.matrix(step)
        return matrices[which]

    def probabilities(self, entries: Ints, cells: Ints) -> Singles:
        """The probability of one cell in each of some entries' matrices: float32, (n,)."""
        if self._map_table is not None:
            return self._map_table.take(entries * self._size**2 + cells, mode="clip")
        return self._computed(entries).reshape(-1, self._size**2)[np.arange(len(cells)), cells]

    def drift(self, mass: Floats, entries: Ints) -> None:
        """Let mass, (M, L, n) and C-contiguous, drift by a step from its entries, in place."""
        rows = np.ascontiguousarray(np.moveaxis(mass, -1, 0))
        for row, (model, step) in zip(rows, self._each(entries), strict=True):
            own = row[: model.state_shape[0], : model.layer]
            own[...] = model.drift(own.reshape(model.state_shape), step).reshape(own.shape)
        mass[...] = np.moveaxis(rows, 0, -1)

    # States and cells.

    def slots(self, entries: Ints, cells: Ints) -> Ints:
        """The slot of a cell in the layers of mass for each of some entries: (n,)."""
        return self._slots[entries % self.count, cells]

    @cached_property
    def _slots(self) -> Ints:
        return np.array([model.slots for model in self.models])

    def map(self, mass: Floats, entries: Ints) -> Floats:
        """The mass in each cell: (N², n), given (M, L, n); may be a view."""
        total: Floats = over_layers(mass)
        if self.count == 1:
            single: Floats = total.take(self._slots[0], 0)
            return single
        mapped: Floats = np.take_along_axis(total, self._slots[entries % self.count].T, 0)
        return mapped

    def cells(self, states: Ints, entries: Ints) -> Ints:
        """The cells of persons' states, of the same shape."""
        cells = np.empty_like(states)
        indices = entries % self.count
        for number in np.unique(indices):
            who = indices == number
            cells[who] = self.models[number].cells(states[who])
        return cells

    # Persons.

    def start(self, indices: Ints, draws: Floats) -> Ints:
        """The states at step 0 given the indices of the persons' models and uniform draws."""
        states = np.empty(indices.shape, np.int64)
        for number in np.unique(indices):
            who = indices == number
            states[who] = self.models[number].start(draws[who])
        return states

    @property
    def certain_starts(self) -> Ints | None:
        """The state at step 0 of each model, (count,), if all are known to be certain."""
        return None

    def walk(self, states: Ints, entries: Ints, draws: Floats) -> Ints:
        """The states, (...), one step later, given the entries before it and draws, (2, ...)."""
        after = states.reshape(-1).copy()
        draws = draws.reshape(2, -1)
        entries = entries.reshape(-1)
        order = entries.argsort(kind="stable")
        _, first = np.unique(entries[order], return_index=True)
        for who in np.split(order, first[1:]):
            ((model, step),) = self._each(entries[who[:1]])
            after[who] = model.moved(after[who], step, *draws[:, who])
        return after.reshape(states.shape)
