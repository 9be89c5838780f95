"""The base class of the observation layouts, and their building blocks.

Matrices are scaled to a maximum of 1, because the probabilities of single cells are too small
for networks to learn from, and only their ratios show where to search.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, NamedTuple

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from DroneSwarmSearch._internal.arrays import Singles
from DroneSwarmSearch.core.grid import Grid
from DroneSwarmSearch.core.radio import LastHeard
from DroneSwarmSearch.core.rules import Action

Positions = NDArray[np.integer]
Observations = Any  # an array, or a dict of arrays


class Heard(NamedTuple):
    """Where each drone last heard the others, see `radio.LastHeard`.

    Attributes:
        positions: (x, y): integers, shape (S, n, n, 2), indexed [search, listener, heard].
        ages: steps since then, as a fraction of the time limit: float32, shape (S, n, n).
    """

    positions: Positions
    ages: Singles

    @classmethod
    def of(cls, last: LastHeard, grid_size: int, timestep_limit: int) -> Heard:
        """The same as positions and fractions; `last` has an axis for the searches."""
        positions = Grid.of(grid_size).coordinates.take(last.cells, axis=0)
        return cls(positions, (last.ages / timestep_limit).astype(np.float32))


class Sight(NamedTuple):
    """What the drones of S searches see, for a layout to show.

    Attributes:
        positions: every drone's cell (x, y): integers, shape (S, n, 2).
        matrices: float32, indexed [y, x], shape (S, 1, N, N), or with radios (S, n, N, N); layouts
            use them as scratch and overwrite them.
        left: see `remaining_time_fraction`: float32, shape (S,).
        heard: with radios, where each drone last heard the others.
    """

    positions: Positions
    matrices: Singles
    left: Singles
    heard: Heard | None = None

    def of(self, searches: slice) -> Sight:
        """Some of the searches; views."""
        heard = self.heard and Heard(self.heard.positions[searches], self.heard.ages[searches])
        return Sight(self.positions[searches], self.matrices[searches], self.left[searches], heard)


class Layout(ABC):
    """A layout: it writes the observations of S searches with n drones on N x N cells into arrays.

    Attributes:
        space: the space of one drone's observation; for a joint layout, of one swarm's.
        radio: whether each drone has a matrix of its own, and knows of the others what it heard.
    """

    space: spaces.Space[Any]

    def __init__(self, grid_size: int, n_drones: int, radio: bool = False) -> None:
        self.grid_size = grid_size
        self.n_drones = n_drones
        self.radio = radio

    @abstractmethod
    def write(self, sight: Sight, out: Observations) -> None:
        """Write observations.

        Args:
            sight: what the drones see; its matrices are overwritten.
            out: an array of the space's dtype and shape, or a dict of such arrays, with axes in
                front for the searches and the drones; for a joint layout, the second one is 1.
        """


def mask_space(n_drones: int | None = None) -> spaces.Box:
    """The space of masks in observations: int8, shape (6,), or (n_drones, 6) for a swarm."""
    shape = (len(Action),) if n_drones is None else (n_drones, len(Action))
    return spaces.Box(0, 1, shape, np.int8)


def remaining_time_fraction(steps: Any, timestep_limit: int) -> Singles:
    """The remaining steps as a fraction of the time limit: 1 at the start; float32."""
    left: Singles = ((timestep_limit - np.asarray(steps)) / timestep_limit).astype(np.float32)
    return left


def own_first(n_drones: int) -> NDArray[np.int64]:
    """Row k: drone k, then the others by number, as its observations show them; int64, (n, n)."""
    return np.array([[k, *(i for i in range(n_drones) if i != k)] for k in range(n_drones)])


def scaled_positions(positions: Positions, grid_size: int, out: Singles) -> None:
    """Write positions or offsets, of any shape, with the grid scaled to the unit square."""
    np.divide(positions.astype(np.float32), np.float32(grid_size - 1), out=out)


def maxima(matrices: Singles) -> Singles:
    """The maximum of each matrix, (...), given (..., N, N)."""
    highest: Singles = matrices.reshape(*matrices.shape[:-2], -1).max(axis=-1)
    return highest


def scale_to_maximum(matrices: Singles) -> None:
    """Scale each matrix, (..., N, N), in place so that its maximum is 1."""
    matrices /= maxima(matrices)[..., None, None]
