"""The person's trajectory as a Markov chain: its steps as matrices, forwards and backwards.

`belief.after_drift` moves one distribution by shifting arrays and agrees with the batch bit
for bit. Planning moves thousands, and needs the backward step too; matrix products are
faster there, and agree with `after_drift` to rounding.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch.drift.probability_matrix import ProbabilityMatrix

__all__ = ["MarkovChain", "move_probabilities", "transition_matrices"]

Floats = NDArray[np.float64]


def move_probabilities(higher: Floats, lower: Floats) -> Floats:
    """The probabilities of all moves along one axis.

    Args:
        higher: probability of moving from each cell to the next higher one, shape (...).
        lower: the same for the next lower one.

    Returns:
        float64, shape (3, ...): of moving lower, staying and moving higher.
    """
    return np.stack([lower, 1.0 - higher - lower, higher])


def transition_matrices(higher: Floats, lower: Floats) -> Floats:
    """The transition matrices along one axis.

    Args:
        higher: as in `move_probabilities`, shape (..., N).
        lower: the same for the next lower one.

    Returns:
        float64, shape (..., N, N): the probability of moving from cell [i] to cell [j].
    """
    cells = higher.shape[-1]
    falls, stays, rises = move_probabilities(higher, lower)
    matrices = np.zeros((*higher.shape, cells))
    here = np.arange(cells)
    matrices[..., here, here] = stays
    matrices[..., here[:-1], here[1:]] = rises[..., :-1]
    matrices[..., here[1:], here[:-1]] = falls[..., 1:]
    return matrices


class MarkovChain:
    """The steps of one person.

    Arrays over hypotheses and cells have shape (..., M, N, N), indexed
    [..., hypothesis, y, x], with any leading axes.
    The matrices of the steps used so far are kept as long as the object; copies do without.

    Args:
        forecast: the person's forecast.
    """

    def __init__(self, forecast: ProbabilityMatrix) -> None:
        self._forecast = forecast
        self._matrices: dict[int, tuple[Floats, Floats]] = {}  # along x and y, by step

    def forward(self, mass: Floats, step: int) -> Floats:
        """The distribution after a step, given the distribution before it."""
        along_x, along_y = self.matrices(step)
        moved: Floats = along_y.swapaxes(-1, -2) @ mass @ along_x
        return moved

    def backward(self, value: Floats, step: int) -> Floats:
        """The expected value before a step in each cell, given the values after it."""
        along_x, along_y = self.matrices(step)
        expected: Floats = along_y @ value @ along_x.swapaxes(-1, -2)
        return expected

    def matrices(self, step: int) -> tuple[Floats, Floats]:
        """The transition matrices of a step along x and y, each of shape (M, N, N)."""
        return self._matrices.get(step) or self._made(step)

    def _made(self, step: int) -> tuple[Floats, Floats]:
        """The matrices of a step, after making those of its block in the forecast."""
        count = self._forecast.block_steps
        first = step - step % count
        moves = zip(*map(self._forecast.moves, range(first, first + count)), strict=True)
        right, left, down, up = map(np.array, moves)
        along_x, along_y = transition_matrices(right, left), transition_matrices(down, up)
        self._matrices.update(enumerate(zip(along_x, along_y, strict=True), first))
        return self._matrices[step]

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_matrices": {}}
