"""The layouts that show the whole matrix: "dict", "flat" and "planes"."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from DroneSwarmSearch._internal.arrays import Singles
from DroneSwarmSearch.layouts.layout import Layout, Positions, mark, own_first, scaled_positions


class DictLayout(Layout):
    """The layout of `wrappers.DictObservation`."""

    def __init__(self, grid_size: int, n_drones: int) -> None:
        super().__init__(grid_size, n_drones)
        position = spaces.Box(0, grid_size - 1, (2,), np.int32)
        matrix = self._fractions(grid_size, grid_size)
        self.space = spaces.Dict({"position": position, "probability_matrix": matrix})

    def write(
        self, positions: Positions, matrices: Singles, left: Singles, out: dict[str, NDArray[Any]]
    ) -> None:
        out["position"][...] = positions
        out["probability_matrix"][...] = matrices[:, None]


class JointDictLayout(Layout):
    """For each swarm `positions`, int32, shape (n, 2), and `probability_matrix`."""

    def __init__(self, grid_size: int, n_drones: int) -> None:
        super().__init__(grid_size, n_drones)
        positions = spaces.Box(0, grid_size - 1, (n_drones, 2), np.int32)
        matrix = self._fractions(grid_size, grid_size)
        self.space = spaces.Dict({"positions": positions, "probability_matrix": matrix})

    def write(
        self, positions: Positions, matrices: Singles, left: Singles, out: dict[str, NDArray[Any]]
    ) -> None:
        out["positions"][...] = positions
        if out["probability_matrix"] is not matrices:
            out["probability_matrix"][...] = matrices


class FlatLayout(Layout):
    """The layout of `wrappers.FlatObservation`."""

    def __init__(self, grid_size: int, n_drones: int) -> None:
        super().__init__(grid_size, n_drones)
        self.space = self._fractions(2 * n_drones + 1 + grid_size**2)
        self._orders = own_first(n_drones)

    def write(self, positions: Positions, matrices: Singles, left: Singles, out: Singles) -> None:
        n = self.n_drones
        places = out[..., : 2 * n].reshape(*out.shape[:2], n, 2)
        scaled_positions(positions[:, self._orders], self.grid_size, places)
        out[..., 2 * n] = left[:, None]
        matrices /= matrices.max(axis=(1, 2), keepdims=True)
        out[..., 2 * n + 1 :] = matrices.reshape(len(matrices), 1, -1)


class JointFlatLayout(FlatLayout):
    """For each swarm what "flat" shows a drone, with the drones by number."""

    def __init__(self, grid_size: int, n_drones: int) -> None:
        super().__init__(grid_size, n_drones)
        self._orders = np.arange(n_drones)[None]

    def write(self, positions: Positions, matrices: Singles, left: Singles, out: Singles) -> None:
        super().write(positions, matrices, left, out[:, None])


class PlanesLayout(Layout):
    """The layout of `wrappers.PlanesObservation`, with channels first."""

    def __init__(self, grid_size: int, n_drones: int) -> None:
        super().__init__(grid_size, n_drones)
        self.space = self._fractions(4, grid_size, grid_size)
        self._orders = own_first(n_drones)

    def write(self, positions: Positions, matrices: Singles, left: Singles, out: Singles) -> None:
        matrices /= matrices.max(axis=(1, 2), keepdims=True)
        out[:, :, 0] = matrices[:, None]
        ordered = positions[:, self._orders]
        mark(ordered[:, :, :1], out[:, :, 1])
        mark(ordered[:, :, 1:], out[:, :, 2])
        out[:, :, 3] = left[:, None, None, None]


class JointPlanesLayout(Layout):
    """For each swarm 2 + n planes: the matrix, a plane for each drone, and the time.

    float32 in [0, 1], shape (2 + n, N, N), indexed [plane, y, x]; values as in "planes".
    """

    def __init__(self, grid_size: int, n_drones: int) -> None:
        super().__init__(grid_size, n_drones)
        self.space = self._fractions(2 + n_drones, grid_size, grid_size)

    def write(self, positions: Positions, matrices: Singles, left: Singles, out: Singles) -> None:
        matrices /= matrices.max(axis=(1, 2), keepdims=True)
        out[:, 0] = matrices
        mark(positions[:, :, None], out[:, 1:-1])
        out[:, -1] = left[:, None, None]
