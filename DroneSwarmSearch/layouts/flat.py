"""The layout "flat": one vector, for networks of dense layers."""

from __future__ import annotations

from DroneSwarmSearch._internal.arrays import Singles
from DroneSwarmSearch.layouts.layout import (
    Layout,
    Positions,
    own_first,
    scaled_matrices,
    scaled_positions,
)

__all__ = ["FlatLayout", "JointFlatLayout"]


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
