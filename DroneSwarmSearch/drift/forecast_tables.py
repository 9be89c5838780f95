"""The forecasts of a batch as tables: the array form of `ProbabilityMatrix`, bit for bit."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np

from DroneSwarmSearch._internal.arrays import Floats, Ints, Singles
from DroneSwarmSearch._internal.cells import cell_position
from DroneSwarmSearch.drift.axes import (
    Steps,
    joint_of,
    matrices_of,
    moves_of,
    tabulate,
)
from DroneSwarmSearch.drift.model import Forecasts, cumulative, over_layers
from DroneSwarmSearch.persons.hypotheses import Hypotheses


class ForecastTables(Forecasts):
    """Forecasts of `ProbabilityMatrix`; all steps so far are tables, indexed [entry, ...]."""

    def __init__(self, models: Sequence[Any], **options: Any) -> None:
        super().__init__(models, **options)
        self._persons: list[Hypotheses] = [model.known for model in models]
        priors = [[drift.prior is not None for drift in person.drifts] for person in self._persons]
        self._has_prior = np.array([any(prior) for prior in priors])
        self._last_steps: Steps | None = None
        self._hypotheses = self.shape[0]
        shape = self._hypotheses, 2, self._size
        self._factors = np.zeros((0, *shape))
        # To the next higher and to the next lower cell, [..., entry].
        self._moves = np.zeros((2, *shape, 0))
        self._joint: Floats | None = None
        self._scratch = np.empty((2, 0))  # of `drift`
        # The index of each state's column and row in the moves of its entry.
        hypothesis, y, x = np.indices((self._hypotheses, self._size, self._size)).reshape(3, -1)
        self._move_index = np.stack([x, self._size + y]) + hypothesis * (2 * self._size)

    # The tables.

    @property
    def step_bytes(self) -> int:
        joint = 8 * self._size**2 if self._has_prior.any() else 0
        tables = self._hypotheses * (3 * 8 * 2 * self._size + joint)
        return self.count * tables + (super().step_bytes if self._map_table is not None else 0)

    def _fill(self, steps: int) -> None:
        new = tabulate(
            self._size, self._persons, self._filled, steps, self._last_steps, self._hypotheses
        )
        self._last_steps = new
        shape = steps * self.count, self._hypotheses, 2, self._size
        self._factors = np.concatenate([self._factors, new.factors.reshape(shape)])
        moves = np.moveaxis(new.moves[1:].reshape(2, *shape), 1, -1)
        self._moves = np.concatenate([self._moves, moves], axis=-1)
        if new.joint is not None:
            more = new.joint[:-1].reshape(-1, *self.shape)
            self._joint = more if self._joint is None else np.concatenate([self._joint, more])

    # The forecast.

    def joint(self, entries: Ints) -> Floats:
        if self._joint is not None:
            return self._joint.take(entries, 0)
        return joint_of(self._factors.take(entries, 0)).reshape(-1, *self.shape)

    def _computed(self, entries: Ints) -> Singles:
        matrices = matrices_of(self._factors.take(entries, 0))
        if self._joint is not None:
            carried = self._has_prior[entries % self.count]
            joint = self._joint[entries[carried]]
            maps = over_layers(joint.swapaxes(0, 1))
            matrices[carried] = maps.reshape(-1, self._size, self._size)
        return matrices

    def probabilities(self, entries: Ints, cells: Ints) -> Singles:
        if self._map_table is not None or self._joint is not None:
            return super().probabilities(entries, cells)
        x, y = cell_position(cells, self._size)
        at_x = self._factors[entries, :, 0, x]
        at_y = self._factors[entries, :, 1, y]
        total: Singles = over_layers((at_y.astype(np.float32) * at_x.astype(np.float32)).T)
        return total

    def drift(self, mass: Floats, entries: Ints) -> None:
        mass = mass.reshape(self._hypotheses, self._size, self._size, -1)
        shape: tuple[int, ...] = mass.shape
        moves = self._moves.take(entries, -1, mode="clip").astype(mass.dtype, copy=False)
        if self._scratch.shape[1:] != shape:
            self._scratch = np.empty((2, *shape), mass.dtype)
        cells = mass.reshape(-1)
        higher, lower = self._scratch.reshape(2, -1)
        along_x = moves[:, :, 0, None]
        along_y = moves[:, :, 1, :, None]
        for along, row in ((along_x, mass[0, 0, 0]), (along_y, mass[0, 0])):  # see `Drifter`
            np.multiply(along, mass, self._scratch)
            mass *= 1.0 - along[0] - along[1]
            cells[row.size :] += higher[: -row.size]
            cells[: -row.size] += lower[row.size :]

    # States and cells.

    def slots(self, entries: Ints, cells: Ints) -> Ints:
        return cells

    def map(self, mass: Floats, entries: Ints) -> Floats:
        return over_layers(mass)

    def cells(self, states: Ints, entries: Ints) -> Ints:
        cells: Ints = states % self._size**2
        return cells

    # Persons.

    def start(self, indices: Ints, draws: Floats) -> Ints:
        pairs = zip(indices.flat, draws.flat, strict=True)
        states = [self._starts[number].searchsorted(draw, side="right") for number, draw in pairs]
        return np.array(states, np.int64).reshape(indices.shape)

    @cached_property
    def _starts(self) -> list[Floats]:
        self.reach(0)
        return [cumulative(joint) for joint in self.joint(np.arange(self.count))]

    @cached_property
    def certain_starts(self) -> Ints | None:
        self.reach(0)
        joint = self.joint(np.arange(self.count)).reshape(self.count, -1)
        is_certain = (np.count_nonzero(joint, axis=1) == 1).all()
        return joint.argmax(axis=1) if is_certain else None

    def walk(self, states: Ints, entries: Ints, draws: Floats) -> Ints:
        index = self._move_index.take(states, 1, mode="clip") * self._moves.shape[-1]
        index += entries
        higher, either = self._moves.reshape(2, -1).take(index, 1, mode="clip")
        either += higher
        along_x, along_y = moves_of(draws, higher, either)
        after: Ints = states + along_x + np.multiply(along_y, self._size, dtype=np.int64)
        return after
