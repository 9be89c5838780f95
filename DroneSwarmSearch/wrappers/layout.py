"""What layouts have in common, and the pieces that they are made of.

Matrices are scaled to their maximum: probabilities of single cells are small numbers,
which networks learn from badly, and it is their shape that says where to look.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from DroneSwarmSearch._internal import checks

__all__ = [
    "Layout",
    "StackedLayout",
    "mark",
    "own_first",
    "remaining_time_fraction",
    "scaled_matrices",
    "scaled_positions",
]

Singles = NDArray[np.float32]
Positions = NDArray[np.integer]
Observations = Any  # an array, or a dict of arrays


class Layout(ABC):
    """What drones are shown of many searches, S of them, that are alike in size.

    Args:
        grid_size: cells along each side, N.
        n_drones: the drones in each search, n.

    Attributes:
        space: what one drone is shown; of a joint layout, what one swarm is shown.

    Raises:
        TypeError: an argument is no integer.
        ValueError: it is out of its limits, or what is shown would not fit in memory.
    """

    space: spaces.Space[Any]

    def __init__(self, grid_size: int, n_drones: int) -> None:
        self.grid_size = checks.integer("grid_size", grid_size, 2)
        self.n_drones = checks.integer("n_drones", n_drones, 1, self.grid_size**2)

    def _check_memory(self, numbers: int) -> None:
        """Refuse a search of which drones would be shown too many numbers for the memory."""
        size = 10 * numbers  # the limits of a Box
        checks.fits("an observation", size, grid_size=self.grid_size, n_drones=self.n_drones)

    def _fractions(self, *shape: int) -> spaces.Box:
        """The space of numbers from 0 to 1, float32."""
        self._check_memory(math.prod(shape))
        return spaces.Box(0.0, 1.0, shape, np.float32)

    @abstractmethod
    def write(
        self, positions: Positions, matrices: Singles, left: Singles, out: Observations
    ) -> None:
        """Write what is shown.

        Args:
            positions: every drone's cell (x, y): integers, shape (S, n, 2).
            matrices: what the drones are shown, as the environment has it: float32, shape
                (S, N, N), indexed [y, x]. They are scratch: what is in them afterwards is
                anything.
            left: the share of the steps left, see `remaining_time_fraction`: float32, shape (S,).
            out: receives it, an array of the space's dtype, with axes for the searches and
                the drones, S and n, before the space's own; for a joint layout with one
                for the searches alone. Where the space is a Dict, a dict of such arrays.
        """


class StackedLayout(Layout):
    """What a swarm is shown in a layout without a joint form: what its drones are, stacked.

    Args:
        layout: what each drone is shown.
    """

    def __init__(self, layout: Layout) -> None:
        if not isinstance(layout, Layout):
            raise TypeError(f"layout must be a Layout, got {layout!r}")
        super().__init__(layout.grid_size, layout.n_drones)
        self.layout = layout
        self._check_memory(layout.n_drones * spaces.flatdim(layout.space))
        self.space = batch_space(layout.space, layout.n_drones)

    def write(
        self, positions: Positions, matrices: Singles, left: Singles, out: Observations
    ) -> None:
        self.layout.write(positions, matrices, left, out)


def remaining_time_fraction(steps: Any, timestep_limit: int) -> Singles:
    """The share of the steps left: 1 at the beginning, 0 when the time is up.

    Args:
        steps: completed steps, integers of any shape.
        timestep_limit: the number of steps in an episode.

    Returns:
        float32, of the same shape.
    """
    share: Singles = ((timestep_limit - np.asarray(steps)) / timestep_limit).astype(np.float32)
    return share


def own_first(n_drones: int) -> NDArray[np.int64]:
    """In which order each drone is shown the drones: itself, then the others by number.

    Returns:
        int64, shape (n_drones, n_drones): row k is the order for drone k.
    """
    checks.fits("the order of the drones", 8 * n_drones**2, n_drones=n_drones)
    return np.array([[k, *(i for i in range(n_drones) if i != k)] for k in range(n_drones)])


def scaled_matrices(matrices: Singles, out: Singles) -> None:
    """Write matrices with their maximum scaled to 1.

    Args:
        matrices: float32, shape (..., N, N).
        out: receives them, float32, same shape; may be the same array.
    """
    highest = matrices.max(axis=(-2, -1), keepdims=True)
    np.divide(matrices, highest, out=out)


def scaled_positions(positions: Positions, grid_size: int, out: Singles) -> None:
    """Write positions with the grid scaled to the unit square, or offsets alike.

    Args:
        positions: columns or rows, of any shape.
        grid_size: cells along each side.
        out: receives them, float32, same shape.
    """
    np.divide(positions, np.float32(grid_size - 1), out=out, casting="same_kind")


def mark(positions: Positions, planes: Singles) -> None:
    """Write 1 where a drone is and 0 elsewhere.

    Args:
        positions: the cell (x, y) of every drone of a plane: shape (..., drones, 2).
        planes: receives them, float32, shape (..., N, N).
    """
    planes[...] = 0.0
    leading = np.ogrid[tuple(map(slice, planes.shape[:-2]))]
    planes[(*(axis[..., None] for axis in leading), positions[..., 1], positions[..., 0])] = 1.0
