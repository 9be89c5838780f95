"""Radio: which drones hear each other, and where each has last heard the others.

Arrays have leading axes (...), none for one search, and one for the rows of a batch.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from DroneSwarmSearch._internal.arrays import Flags, Ints
from DroneSwarmSearch._internal.cells import cell_position


def hearing(cells: Ints, grid_size: int, radio_range: float) -> Flags:
    """Which drone hears which: bool, (..., n, n), indexed [listener, heard].

    A drone always hears itself; others if the centres of their cells are within the range.

    Args:
        cells: of all drones, y * N + x: (..., n).
        grid_size: cells along each side of the grid, N.
        radio_range: in cells.
    """
    x, y = cell_position(cells, grid_size)
    across = x[..., None] - x[..., None, :]
    down = y[..., None] - y[..., None, :]
    heard: Flags = np.sqrt(across**2 + down**2) <= radio_range
    return heard


def links_of(heard: Flags) -> tuple[tuple[int, int], ...]:
    """The pairs of drones that hear each other, lower numbers first, given (n, n)."""
    first, second = np.triu(heard, 1).nonzero()
    return tuple(zip(first.tolist(), second.tolist(), strict=True))


class LastHeard(NamedTuple):
    """Where each drone last heard each other one.

    At the start of an episode, all drones know where all are.

    Attributes:
        cells: y * N + x: int64, (..., n, n), indexed [listener, heard].
        ages: steps since then, 0 for drones in range: int64, (..., n, n).
    """

    cells: Ints
    ages: Ints

    @classmethod
    def at_start(cls, cells: Ints) -> LastHeard:
        """At the start of an episode, with the drones in some cells, (..., n)."""
        known = np.repeat(cells[..., None, :], cells.shape[-1], axis=-2)
        return cls(known, np.zeros_like(known))

    def restart(self, rows: Ints, cells: Ints) -> None:
        """Start episodes in some rows of a batch, in place, with the drones in cells, (E, n)."""
        for values, new in zip(self, self.at_start(cells[rows]), strict=True):
            values[rows] = new

    def copy(self) -> LastHeard:
        """The same in new arrays."""
        return LastHeard(self.cells.copy(), self.ages.copy())

    def after(self, cells: Ints, heard: Flags) -> LastHeard:
        """One step later, with the drones in some cells; `heard` is from `hearing`."""
        return LastHeard(
            cells=np.where(heard, cells[..., None, :], self.cells),
            ages=np.where(heard, 0, self.ages + 1),
        )
