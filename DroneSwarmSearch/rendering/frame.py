"""What a picture of the search shows, as plain data.

The environment makes a `Frame`; `text`, `painter` and `window` draw it. None of
them knows the environment, and drawing a frame cannot change an episode.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch.rules import Ending

__all__ = ["Frame"]


@dataclass(frozen=True, eq=False)
class Frame:
    """One moment of a search.

    Attributes:
        matrix: probability of each cell, float32, shape (grid_size, grid_size),
            indexed [y, x]; sums to 1.
        drones: (x, y) of every drone, in the order of their names.
        searching: for every drone, whether it searched in the step that led here.
        persons: (x, y) of every person, missing or found.
        found: for every person, whether it has been found.
        step: completed steps.
        timestep_limit: the step with which the episode ends at the latest.
        vector: drift in cells per step, (x, y), y growing downward.
        ending: how the episode ended, None while it goes on.
    """

    matrix: NDArray[np.float32]
    drones: tuple[tuple[int, int], ...]
    searching: tuple[bool, ...]
    persons: tuple[tuple[int, int], ...]
    found: tuple[bool, ...]
    step: int
    timestep_limit: int
    vector: tuple[float, float]
    ending: Ending | None

    @property
    def grid_size(self) -> int:
        """Cells along each side of the square grid."""
        return int(self.matrix.shape[0])

    @property
    def outcome(self) -> str:
        """The seed's sentence for the end screen; empty while the episode goes on."""
        if self.ending is None:
            return ""
        if self.ending is Ending.FOUND:
            return f"The target was found in {self.step} moves"
        return "The target was not found"
