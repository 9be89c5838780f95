"""The layouts that show the whole matrix: "dict", "flat" and "planes".

With `joint`, they show a swarm instead of each drone, so that a search has one observation. With
`radio`, each drone has a matrix of its own, and a swarm all of these.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from DroneSwarmSearch._internal.arrays import Singles
from DroneSwarmSearch.layouts.layout import (
    Layout,
    Sight,
    own_first,
    scale_to_maximum,
    scaled_positions,
)


class DictLayout(Layout):
    """The layout of `wrappers.DictObservation`.

    Joint: `positions`, every drone's (x, y), int32, shape (n, 2), and `probability_matrix`, with
    `radio` of the shape (n, N, N).
    """

    def __init__(
        self, grid_size: int, n_drones: int, joint: bool = False, radio: bool = False
    ) -> None:
        super().__init__(grid_size, n_drones, radio)
        self._joint = joint
        self._name, shape = ("positions", (n_drones, 2)) if joint else ("position", (2,))
        position = spaces.Box(0, grid_size - 1, shape, np.int32)
        leading = (n_drones,) if joint and radio else ()
        matrix = spaces.Box(0.0, 1.0, (*leading, grid_size, grid_size), np.float32)
        self.space = spaces.Dict({self._name: position, "probability_matrix": matrix})

    def write(self, sight: Sight, out: dict[str, NDArray[Any]]) -> None:
        positions = sight.positions
        matrices = sight.matrices
        out[self._name][...] = positions[:, None] if self._joint else positions
        if self._joint and self.radio:
            matrices = matrices[:, None]
        out["probability_matrix"][...] = matrices


class FlatLayout(Layout):
    """The layout of `wrappers.FlatObservation`; joint, with the drones by number."""

    def __init__(
        self, grid_size: int, n_drones: int, joint: bool = False, radio: bool = False
    ) -> None:
        super().__init__(grid_size, n_drones, radio)
        self._joint = joint
        self._orders = np.arange(n_drones)[None] if joint else own_first(n_drones)
        self._listeners = np.arange(n_drones)[:, None]
        ages = n_drones - 1 if radio and not joint else 0
        cells = grid_size**2 * (n_drones if radio and joint else 1)
        self.space = spaces.Box(0.0, 1.0, (2 * n_drones + ages + 1 + cells,), np.float32)

    def write(self, sight: Sight, out: Singles) -> None:
        positions, matrices, left, heard = sight
        n = self.n_drones
        shown = positions.take(self._orders, axis=1)
        begin = 2 * n
        if heard is not None and not self._joint:
            shown = heard.positions[:, self._listeners, self._orders]
            ages = heard.ages[:, self._listeners, self._orders[:, 1:]]
            out[..., begin : begin + n - 1] = ages
            begin += n - 1
        scaled_positions(shown, self.grid_size, out[..., : 2 * n].reshape(shown.shape))
        out[..., begin] = left[:, None]
        scale_to_maximum(matrices)
        observations = 1 if self._joint else matrices.shape[1]
        out[..., begin + 1 :] = matrices.reshape(len(matrices), observations, -1)


class PlanesLayout(Layout):
    """The layout of `wrappers.PlanesObservation`, with channels first.

    Joint: the matrix, or with `radio` that of each drone; a plane for each drone; and the time.
    """

    def __init__(
        self, grid_size: int, n_drones: int, joint: bool = False, radio: bool = False
    ) -> None:
        super().__init__(grid_size, n_drones, radio)
        self._joint = joint
        self._maps = n_drones if joint and radio else 1
        planes = self._maps + (n_drones if joint else 2) + 1
        self.space = spaces.Box(0.0, 1.0, (planes, grid_size, grid_size), np.float32)
        self._drones = np.arange(n_drones)
        self._others = own_first(n_drones)[:, 1:]

    def write(self, sight: Sight, out: Singles) -> None:
        positions, matrices, left, heard = sight
        scale_to_maximum(matrices)
        if self._joint:
            out[:, 0, : self._maps] = matrices
        else:
            out[:, :, 0] = matrices
        out[:, :, self._maps : -1] = 0.0
        out[:, :, -1] = left[:, None, None, None]
        searches = np.arange(len(out))[:, None]
        x, y = positions[..., 0], positions[..., 1]
        if self._joint:
            out[searches, 0, self._maps + self._drones, y, x] = 1.0
            return
        out[searches, self._drones, 1, y, x] = 1.0
        drones = self._drones[:, None]
        if heard is None:
            x, y = x[:, self._others], y[:, self._others]
            out[searches[..., None], drones, 2, y, x] = 1.0
            return
        x, y = np.moveaxis(heard.positions[:, drones, self._others], -1, 0)
        values = 1.0 - heard.ages[:, drones, self._others]
        where: Any = searches[..., None], drones, 2, y, x
        np.maximum.at(out, where, values)
