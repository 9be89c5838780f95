"""The layout "dict": positions and matrix by name."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray
from pettingzoo import ParallelEnv

from DroneSwarmSearch.wrappers.layout import Layout, Positions, Singles
from DroneSwarmSearch.wrappers.layout_observation import LayoutObservation

__all__ = ["DictLayout", "DictObservation", "JointDictLayout"]


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
        out["probability_matrix"][...] = matrices


class DictObservation(LayoutObservation):
    """Each drone observes {"position": (x, y), "probability_matrix": matrix}.

    The position is int32, shape (2,). The matrix is float32, shape (N, N), indexed [y, x],
    and sums to 1.

    Args:
        env: the environment.

    Raises:
        TypeError: `env` is not a `DroneSwarmSearch` or a wrapper of one.
        ValueError: it has masks in its observations.
    """

    def __init__(self, env: ParallelEnv[str, Any, int]) -> None:
        super().__init__(env, DictLayout)
