"""The layouts that show the whole matrix: "dict", "flat" and "planes".

With `joint`, they show a swarm instead of each drone, so that a search has one observation.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from DroneSwarmSearch._internal.arrays import Singles
from DroneSwarmSearch.layouts.layout import (
    Layout,
    Positions,
    own_first,
    scale_to_maximum,
    scaled_positions,
)


class DictLayout(Layout):
    """The layout of `wrappers.DictObservation`.

    Joint: `positions`, every drone's (x, y), int32, shape (n, 2), and `probability_matrix`.
    """

    def __init__(self, grid_size: int, n_drones: int, joint: bool = False) -> None:
        super().__init__(grid_size, n_drones)
        self._joint = joint
        self._name, shape = ("positions", (n_drones, 2)) if joint else ("position", (2,))
        position = spaces.Box(0, grid_size - 1, shape, np.int32)
        matrix = spaces.Box(0.0, 1.0, (grid_size, grid_size), np.float32)
        self.space = spaces.Dict({self._name: position, "probability_matrix": matrix})

    def write(
        self, positions: Positions, matrices: Singles, left: Singles, out: dict[str, NDArray[Any]]
    ) -> None:
        out[self._name][...] = positions[:, None] if self._joint else positions
        out["probability_matrix"][...] = matrices[:, None]


class FlatLayout(Layout):
    """The layout of `wrappers.FlatObservation`; joint, with the drones by number."""

    def __init__(self, grid_size: int, n_drones: int, joint: bool = False) -> None:
        super().__init__(grid_size, n_drones)
        self.space = spaces.Box(0.0, 1.0, (2 * n_drones + 1 + grid_size**2,), np.float32)
        self._orders = np.arange(n_drones)[None] if joint else own_first(n_drones)

    def write(self, positions: Positions, matrices: Singles, left: Singles, out: Singles) -> None:
        n = self.n_drones
        scaled = out[..., : 2 * n].reshape(*out.shape[:2], n, 2)
        scaled_positions(positions.take(self._orders, axis=1), self.grid_size, scaled)
        out[..., 2 * n] = left[:, None]
        scale_to_maximum(matrices)
        out[..., 2 * n + 1 :] = matrices.reshape(len(matrices), 1, -1)


class PlanesLayout(Layout):
    """The layout of `wrappers.PlanesObservation`, with channels first.

    Joint: 2 + n planes, the matrix, a plane for each drone, and the time.
    """

    def __init__(self, grid_size: int, n_drones: int, joint: bool = False) -> None:
        super().__init__(grid_size, n_drones)
        self._joint = joint
        planes = 2 + n_drones if joint else 4
        self.space = spaces.Box(0.0, 1.0, (planes, grid_size, grid_size), np.float32)
        self._drones = np.arange(n_drones)
        self._others = own_first(n_drones)[:, 1:]

    def write(self, positions: Positions, matrices: Singles, left: Singles, out: Singles) -> None:
        scale_to_maximum(matrices)
        out[:, :, 0] = matrices[:, None]
        out[:, :, 1:-1] = 0.0
        searches = np.arange(len(out))[:, None]
        x, y = positions[..., 0], positions[..., 1]
        if self._joint:
            out[searches, 0, 1 + self._drones, y, x] = 1.0
        else:
            out[searches, self._drones, 1, y, x] = 1.0
            others_x = x.take(self._others, axis=1)
            others_y = y.take(self._others, axis=1)
            out[searches[..., None], self._drones[:, None], 2, others_y, others_x] = 1.0
        out[:, :, -1] = left[:, None, None, None]
