"""The layout "flat": one vector, for networks of dense layers."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from pettingzoo import ParallelEnv

from DroneSwarmSearch.wrappers.layout import (
    Layout,
    Positions,
    Singles,
    own_first,
    scaled_matrices,
    scaled_positions,
    time_fraction,
)
from DroneSwarmSearch.wrappers.layout_observation import LayoutObservation
from DroneSwarmSearch.wrappers.wrapper import Observations

__all__ = ["FlatLayout", "FlatObservation", "JointFlatLayout"]


class FlatLayout(Layout):
    """For each drone a vector: float32 in [0, 1], length 2 n + 1 + N².

    The drone's own x and y, then those of the other drones by number, with the grid scaled to
    1; the remaining time fraction; the matrix row by row, with its maximum scaled to 1.
    """

    def __init__(self, grid_size: int, n_drones: int) -> None:
        super().__init__(grid_size, n_drones)
        self.space = self._fractions(2 * n_drones + 1 + grid_size**2)
        self._own_first = own_first(n_drones)

    def write(self, positions: Positions, matrices: Singles, left: Singles, out: Singles) -> None:
        n = self.n_drones
        places = out[..., : 2 * n].reshape(*out.shape[:2], n, 2)
        scaled_positions(positions[:, self._own_first], self.grid_size, places)
        out[..., 2 * n] = left[:, None]
        scaled_matrices(matrices, matrices)
        out[..., 2 * n + 1 :] = matrices.reshape(len(matrices), 1, -1)


class JointFlatLayout(Layout):
    """For each swarm a vector: float32 in [0, 1], length 2 n + 1 + N².

    Every drone's x and y, with the grid scaled to 1; the remaining time fraction; the matrix
    row by row, with its maximum scaled to 1.
    """

    def __init__(self, grid_size: int, n_drones: int) -> None:
        super().__init__(grid_size, n_drones)
        self.space = self._fractions(2 * n_drones + 1 + grid_size**2)

    def write(self, positions: Positions, matrices: Singles, left: Singles, out: Singles) -> None:
        n = self.n_drones
        scaled_positions(positions.reshape(-1, 2 * n), self.grid_size, out[:, : 2 * n])
        out[:, 2 * n] = left
        scaled_matrices(matrices, matrices)
        out[:, 2 * n + 1 :] = matrices.reshape(len(matrices), -1)


class FlatObservation(LayoutObservation):
    """Each drone observes a vector: float32 in [0, 1], length 2 n_drones + 1 + N².

    Its own x and y, then those of the other drones in the order of their names, with the
    grid scaled to 1; the remaining time fraction, 1 at the start; the matrix row by row,
    with its maximum scaled to 1.

    Args:
        env: the environment.

    Raises:
        TypeError: `env` is not a `DroneSwarmSearch` or a wrapper of one.
        ValueError: `env` has masks in its observations.
    """

    def __init__(self, env: ParallelEnv[str, Any, int]) -> None:
        super().__init__(env, FlatLayout)
        n, size = self._search.n_drones, self._search.grid_size
        # Each cell's scaled x and y, as one item of eight bytes: a look-up gives both.
        y, x = np.divmod(np.arange(size**2, dtype=np.int32), np.int32(size))
        pairs = np.empty((size**2, 2), np.float32)
        scaled_positions(np.stack([x, y], axis=-1), size, pairs)
        self._pairs: NDArray[np.float64] = pairs.view(np.float64)[:, 0]
        self._order = own_first(n)
        self._shape = (n, 2 * n + 1 + size**2)
        self._tail = np.empty(1 + size**2, np.float32)

    def _observe(self) -> Observations:
        # `FlatLayout.write` for one search, with as few NumPy calls as possible.
        cells, world = self._search._cells_and_world()
        row, tail = world.matrix().reshape(-1), self._tail
        width = 2 * len(cells)
        vectors = np.empty(self._shape, np.float32)
        tail[0] = time_fraction(world.step, self._search.timestep_limit)
        np.divide(row, row[row.argmax()], tail[1:])  # argmax is faster than max
        vectors[:, width:] = tail
        vectors[:, :width] = self._pairs.take(cells).take(self._order).view(np.float32)
        return dict(zip(self._names, vectors))  # noqa: B905 (strict=True takes time)
