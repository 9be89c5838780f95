"""The layout "top-cells": the likeliest cells relative to the drone, for any grid size."""

from __future__ import annotations

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.arrays import Singles
from DroneSwarmSearch._internal.cells import cell_position
from DroneSwarmSearch.layouts.layout import (
    Layout,
    Sight,
    own_first,
    scaled_positions,
)

_LOW = np.uint64(2**32 - 1)
_HALF = np.uint64(32)


class TopCellsLayout(Layout):
    """The layout of `wrappers.TopCellsObservation`; errors call `k` by `name`."""

    def __init__(
        self, grid_size: int, n_drones: int, k: int = 8, *, name: str = "k", radio: bool = False
    ) -> None:
        super().__init__(grid_size, n_drones, radio)
        self.k = checks.integer(name, k, 1, self.grid_size**2)
        ages = n_drones - 1 if radio else 0
        lowest = [-1, -1, 0] * self.k + [0, 0] + [-1, -1] * (n_drones - 1) + [0] * (ages + 1)
        low = np.array(lowest, np.float32)
        self.space = spaces.Box(low, np.ones_like(low), dtype=np.float32)
        self._others = own_first(n_drones)[:, 1:]
        self._drones = np.arange(n_drones)[:, None]

    def write(self, sight: Sight, out: Singles) -> None:
        positions, matrices, left, heard = sight
        size = self.grid_size
        k = self.k
        own = positions[:, :, None]
        # of each matrix of each search: (searches, matrices, k)
        cells, probabilities = likeliest_cells(matrices.reshape(-1, size, size), k)
        cells = cells.reshape(*matrices.shape[:2], k)
        probabilities = probabilities.reshape(cells.shape)
        x, y = cell_position(cells, size)
        by_cell = out[..., : 3 * k].reshape(*out.shape[:2], k, 3)
        scaled_positions(x - own[..., 0], size, by_cell[..., 0])
        scaled_positions(y - own[..., 1], size, by_cell[..., 1])
        by_cell[..., 2] = probabilities / probabilities[..., :1]

        scaled_positions(positions, size, out[..., 3 * k : 3 * k + 2])
        others = positions[:, self._others]
        if heard is not None:
            others = heard.positions[:, self._drones, self._others]
        others = others - own
        order = np.abs(others).sum(axis=-1).argsort(axis=-1, kind="stable")
        searches = np.arange(len(others))[:, None, None]
        others = others[searches, self._drones, order]
        end = 3 * k + 2 + 2 * (self.n_drones - 1)
        by_drone = out[..., 3 * k + 2 : end].reshape(others.shape)
        scaled_positions(others, size, by_drone)
        if heard is not None:
            ages = heard.ages[:, self._drones, self._others]
            out[..., end:-1] = ages[searches, self._drones, order]
        out[..., -1] = left[:, None]


def likeliest_cells(matrices: Singles, k: int) -> tuple[NDArray[np.int64], Singles]:
    """The k likeliest cells of each matrix in descending order, ties by number.

    Matrices are float32, at least 0, (S, N, N). Returns the cells, y * N + x, int64, and their
    probabilities, float32; both of shape (S, k).
    """
    # Floats of at least 0 have the order of their bits. Followed by the cell's rank from the
    # last, they are distinct integers.
    bits = np.ascontiguousarray(matrices).reshape(len(matrices), -1).view(np.uint32)
    n = bits.shape[1]
    keys = bits.astype(np.uint64) << _HALF
    keys |= np.arange(n - 1, -1, -1, dtype=np.uint64)
    best = np.sort(np.partition(keys, n - k, axis=1)[:, n - k :], axis=1)[:, ::-1]
    cells = n - 1 - (best & _LOW).astype(np.int64)
    return cells, (best >> _HALF).astype(np.uint32).view(np.float32)
