"""The layout "planes": image-like channels, for convolutional networks."""

from __future__ import annotations

from DroneSwarmSearch._internal.arrays import Singles
from DroneSwarmSearch.layouts.layout import (
    Layout,
    Positions,
    mark,
    own_first,
    scaled_matrices,
)

__all__ = ["JointPlanesLayout", "PlanesLayout"]


class PlanesLayout(Layout):
    """For each drone four planes: float32 in [0, 1], shape (4, N, N), indexed [plane, y, x].

    The matrix, with its maximum scaled to 1; 1 in the drone's own cell; 1 in the other
    drones' cells; the remaining time fraction in every cell.
    """

    def __init__(self, grid_size: int, n_drones: int) -> None:
        super().__init__(grid_size, n_drones)
        self.space = self._fractions(4, grid_size, grid_size)
        self._own_first = own_first(n_drones)

    def write(self, positions: Positions, matrices: Singles, left: Singles, out: Singles) -> None:
        scaled_matrices(matrices, matrices)
        out[:, :, 0] = matrices[:, None]
        ordered = positions[:, self._own_first]
        mark(ordered[:, :, :1], out[:, :, 1])
        mark(ordered[:, :, 1:], out[:, :, 2])
        out[:, :, 3] = left[:, None, None, None]


class JointPlanesLayout(Layout):
    """For each swarm 2 + n planes: float32 in [0, 1], shape (2 + n, N, N).

    The matrix, with its maximum scaled to 1; for each drone a plane with 1 in its cell; the
    remaining time fraction in every cell. Indexed [plane, y, x].
    """

    def __init__(self, grid_size: int, n_drones: int) -> None:
        super().__init__(grid_size, n_drones)
        self.space = self._fractions(2 + n_drones, grid_size, grid_size)

    def write(self, positions: Positions, matrices: Singles, left: Singles, out: Singles) -> None:
        scaled_matrices(matrices, matrices)
        out[:, 0] = matrices
        mark(positions[:, :, None], out[:, 1:-1])
        out[:, -1] = left[:, None, None]
