"""The person's trajectory as a Markov chain: its steps as matrices, forwards and backwards.

`belief.after_drift` moves one distribution by shifting arrays and agrees with the batch bit
for bit. Planning moves thousands, and needs the backward step too; matrix products are
faster there, and agree with `after_drift` to rounding.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch.drift.probability_matrix import ProbabilityMatrix

__all__ = ["MarkovChain", "transition_matrices"]

Floats = NDArray[np.float64]


def transition_matrices(higher: Floats, lower: Floats) -> Floats:
    """The transition matrices of some steps along one axis.

    Args:
        higher: probability of moving from each cell to the next higher one, shape (n, N).
        lower: the same for the next lower one.

    Returns:
        float64, shape (n, N, N): the probability of moving from cell [i] to cell [j].
    """
    n, cells = higher.shape
    matrices = np.zeros((n, cells, cells))
    here = np.arange(cells)
    matrices[:, here, here] = 1.0 - higher - lower
    matrices[:, here[:-1], here[1:]] = higher[:, :-1]
    matrices[:, here[1:], here[:-1]] = lower[:, 1:]
    return matrices


class MarkovChain:
    """The steps of one person over part of an episode.

    Arrays over the grid have shape (..., N, N), indexed [..., y, x], with any leading axes.

    Args:
        forecast: the person's forecast.
        begin: the first step covered.
        end: the step after the last.
    """

    def __init__(self, forecast: ProbabilityMatrix, begin: int, end: int) -> None:
        self._begin = begin
        moves = [forecast.moves(step) for step in range(begin, end)]
        right, left, down, up = (np.array(chances) for chances in zip(*moves, strict=True))
        self._along_x = transition_matrices(right, left)
        self._along_y = transition_matrices(down, up)

    def forward(self, mass: Floats, step: int) -> Floats:
        """The distribution after a step, given the distribution before it."""
        index = step - self._begin
        moved: Floats = self._along_y[index].T @ mass @ self._along_x[index]
        return moved

    def backward(self, value: Floats, step: int) -> Floats:
        """The expected value before a step in each cell, given the values after it."""
        index = step - self._begin
        expected: Floats = self._along_y[index] @ value @ self._along_x[index].T
        return expected
