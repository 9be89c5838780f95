"""The layout "flat": one vector, for networks of dense layers."""

from __future__ import annotations

from collections.abc import Sequence
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

_KEPT_TAILS = 64
"""Groups of steps whose scaled matrices `FlatObservation` keeps, of 64 KiB at most each."""


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
        self._last_tail = np.empty(1 + size**2, np.float32)  # of a posterior
        # By first step: the tables of some steps, and what `_make_tails` makes of them.
        self._tails: dict[int, tuple[Sequence[Singles], Singles]] = {}

    def _observe(self) -> Observations:
        # `FlatLayout.write` for one search, with as few NumPy calls as possible.
        cells, world = self._search._cells_and_world()
        matrices, index = world.loaded_matrices()
        width = 2 * len(cells)
        vectors = np.empty(self._shape, np.float32)
        if len(matrices) > 1:
            vectors[:, width:] = self._tail(matrices, index, world.step)
        else:
            row, tail = matrices[0].reshape(-1), self._last_tail
            tail[0] = time_fraction(world.step, self._search.timestep_limit)
            np.divide(row, row[row.argmax()], tail[1:])  # argmax is faster than max
            vectors[:, width:] = tail
        vectors[:, :width] = self._pairs.take(cells).take(self._order).view(np.float32)
        return dict(zip(self._names, vectors))  # noqa: B905 (strict=True takes time)

    def _tail(self, matrices: Sequence[Singles], index: int, step: int) -> Singles:
        """The part of the vectors that all drones share, from matrices of several steps."""
        first = step - index
        known, tails = self._tails.get(first, (None, matrices))
        if known is not matrices:
            tails = self._make_tails(matrices, first)
            if len(self._tails) >= _KEPT_TAILS:
                self._tails.clear()
            self._tails[first] = matrices, tails
        tail: Singles = tails[index]
        return tail

    def _make_tails(self, matrices: Sequence[Singles], first: int) -> Singles:
        """`_tail` of some steps: float32, (n, 1 + N²)."""
        count = len(matrices)
        rows = np.asarray(matrices).reshape(count, -1)
        tails = np.empty((count, 1 + rows.shape[1]), np.float32)
        limit = self._search.timestep_limit
        tails[:, 0] = [time_fraction(step, limit) for step in range(first, first + count)]
        np.divide(rows, np.maximum.reduce(rows, 1, keepdims=True), tails[:, 1:])
        return tails

    def __getstate__(self) -> dict[str, Any]:
        """A copy computes its tails itself."""
        return {**self.__dict__, "_tails": {}}
