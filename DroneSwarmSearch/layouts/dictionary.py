"""The layout "dict": positions and matrix by name."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from DroneSwarmSearch._internal.arrays import Singles
from DroneSwarmSearch.layouts.layout import Layout, Positions

__all__ = ["DictLayout", "JointDictLayout"]


class DictLayout(Layout):
    """For each drone, `position`, its (x, y), and `probability_matrix`.

    int32, shape (2,); float32, shape (N, N), indexed [y, x], sums to 1.
    """

    def __init__(self, grid_size: int, n_drones: int) -> None:
        super().__init__(grid_size, n_drones)
        position = spaces.Box(0, grid_size - 1, (2,), np.int32)
        matrix = self._fractions(grid_size, grid_size)
        self.space = spaces.Dict({"position": position, "probability_matrix": matrix})

    def write(
        self,
        positions: Positions,
        matrices: Singles,
        left: Singles,
        out: dict[str, NDArray[Any]],
    ) -> None:
        out["position"][...] = positions
        out["probability_matrix"][...] = matrices[:, None]


class JointDictLayout(Layout):
    """For each swarm, `positions`, every drone's (x, y), and `probability_matrix`.

    int32, shape (n, 2); float32, shape (N, N), indexed [y, x], sums to 1.
    """

    def __init__(self, grid_size: int, n_drones: int) -> None:
        super().__init__(grid_size, n_drones)
        positions = spaces.Box(0, grid_size - 1, (n_drones, 2), np.int32)
        matrix = self._fractions(grid_size, grid_size)
        self.space = spaces.Dict({"positions": positions, "probability_matrix": matrix})

    def write(
        self,
        positions: Positions,
        matrices: Singles,
        left: Singles,
        out: dict[str, NDArray[Any]],
    ) -> None:
        out["positions"][...] = positions
        if out["probability_matrix"] is not matrices:
            out["probability_matrix"][...] = matrices
