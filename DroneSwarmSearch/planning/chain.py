"""A person's chain, forecast: where a person is at every step who has not been found yet.

The person's way over the grid is a Markov chain whose moves are known (`probability_matrix`),
so sums over all ways need two passes over the steps and no sampling: one forth, which
carries the share of persons not found, and one back, which carries what is still to come
for somebody in a cell. Brown (Operations Research 28:1275, 1980) builds optimal plans for
moving targets from these two passes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch.drift.probability_matrix import ProbabilityMatrix

__all__ = ["Chain", "transitions"]

Floats = NDArray[np.float64]


def transitions(right: Floats, left: Floats) -> Floats:
    """The moves along one axis as matrices.

    Args:
        right: the chance to move from each cell to the next higher, shape (n, N).
        left: the same to the next lower.

    Returns:
        float64, shape (n, N, N): the chance to get from cell [i] to cell [j].
    """
    n, cells = right.shape
    matrices = np.zeros((n, cells, cells))
    here = np.arange(cells)
    matrices[:, here, here] = 1.0 - right - left
    matrices[:, here[:-1], here[1:]] = right[:, :-1]
    matrices[:, here[1:], here[:-1]] = left[:, 1:]
    return matrices


class Chain:
    """One person's walk over some steps.

    Arrays over the grid have the shape (..., N, N), indexed [..., y, x]; any leading axes
    are carried along.

    Args:
        forecast: the person's forecast.
        detection: the chance that a search of the right cell finds this person, q.
        begin: the first step that is forecast.
        end: the step after the last.

    Attributes:
        detection: as given.
    """

    def __init__(self, forecast: ProbabilityMatrix, detection: float, begin: int, end: int) -> None:
        self.detection = detection
        self._begin = begin
        moves = [forecast.moves(step) for step in range(begin, end)]
        right, left, down, up = (np.array(chances) for chances in zip(*moves, strict=True))
        self._across = transitions(right, left)
        self._down = transitions(down, up)

    def forward(self, mass: Floats, step: int) -> Floats:
        """Where persons are after a step who were distributed like `mass` before it."""
        place = step - self._begin
        moved: Floats = self._down[place].T @ mass @ self._across[place]
        return moved

    def backward(self, value: Floats, step: int) -> Floats:
        """What a value of the cells after a step is expected to be, seen from before it."""
        place = step - self._begin
        expected: Floats = self._down[place] @ value @ self._across[place].T
        return expected
