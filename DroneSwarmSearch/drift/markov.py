"""The drift model of a `MarkovDrift`: a Markov chain over the cells of the grid."""

from __future__ import annotations

import numpy as np

from DroneSwarmSearch._internal.arrays import Floats
from DroneSwarmSearch.drift.moves_model import MovesModel, MoveTable
from DroneSwarmSearch.persons.markov import MarkovDrift

MOST_TABLES = 64
"""The tables of single steps that a chain keeps; the transitions of others are asked for again."""


class MarkovModel(MovesModel):
    """A Markov chain over the cells of a grid: a state is a cell."""

    def __init__(self, known: MarkovDrift, grid_size: int) -> None:
        self.grid_size = grid_size
        self.known = known
        self.key = grid_size, known.key
        self.weights = np.ones(1)
        self._tables: dict[int, MoveTable] = {}
        self._forecasts = [known.start_map(grid_size)[None]]  # by step, as far as computed

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), (self.known, self.grid_size)

    def table(self, step: int) -> MoveTable:
        if self.known.is_constant:
            step = 0
        if step not in self._tables:
            if len(self._tables) == MOST_TABLES:
                self._tables.pop(next(iter(self._tables)))
            moves = self.known.moves(step, self.grid_size)
            states = np.arange(self.grid_size**2)
            self._tables[step] = MoveTable.of(states, *moves)
        return self._tables[step]

    def joint(self, step: int) -> Floats:
        while len(self._forecasts) <= step:
            before = len(self._forecasts) - 1
            self._forecasts.append(self.forward(self._forecasts[before], before))
        return self._forecasts[step].copy()
