"""The layout "planes": image-like channels, for convolutional networks."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces
from pettingzoo import ParallelEnv

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch.wrappers.layout import (
    Layout,
    Positions,
    Singles,
    mark,
    own_first,
    scaled_matrices,
)
from DroneSwarmSearch.wrappers.layout_observation import LayoutObservation
from DroneSwarmSearch.wrappers.wrapper import Observations

__all__ = ["JointPlanesLayout", "PlanesLayout", "PlanesObservation"]


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


class PlanesObservation(LayoutObservation):
    """Each drone observes four planes: float32 in [0, 1], (4, N, N), indexed [plane, y, x].

    The matrix, with its maximum scaled to 1; 1 in the drone's own cell; 1 in the other
    drones' cells; the remaining time fraction in every cell.

    Args:
        env: the environment.
        channels_last: shape (N, N, 4), indexed [y, x, plane], as RLlib expects images. PyTorch
            expects channels first.

    Raises:
        TypeError: `env` is not a `DroneSwarmSearch` or a wrapper of one, or `channels_last`
            is not a bool.
        ValueError: `env` has masks in its observations.
    """

    def __init__(self, env: ParallelEnv[str, Any, int], channels_last: bool = False) -> None:
        super().__init__(env, PlanesLayout)
        self.channels_last = checks.boolean("channels_last", channels_last)
        if self.channels_last:
            size = self.unwrapped.grid_size
            self._spaces = {
                agent: spaces.Box(0.0, 1.0, (size, size, 4), np.float32)
                for agent in self.possible_agents
            }

    def _observe(self) -> Observations:
        observations = super()._observe()
        if not self.channels_last:
            return observations
        return {
            agent: np.ascontiguousarray(planes.transpose(1, 2, 0))
            for agent, planes in observations.items()
        }
