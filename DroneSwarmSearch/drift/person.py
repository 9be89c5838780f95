"""A person adrift: a random walk over cells, at most one cell per step along each axis.

The probabilities of the moves come from the tables of `probability_matrix`, so that at every
step the person's position has exactly the distribution that the matrix shows.

A uniform random draw u decides the move along an axis. With the probabilities p(+1) and
p(-1) of a move up or down the axis, the person moves

    +1 if u < p(+1),   -1 if p(+1) <= u < p(+1) + p(-1),   0 otherwise.

`walk` applies this rule to one person, `moves` to arrays of persons.

Another uniform draw decides the hypothesis and the cell at step 0: the first entry of the
forecast's `start_cumulative` above it. `start` and `Starts` apply that rule.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch.drift.probability_matrix import ProbabilityMatrix

__all__ = ["Starts", "moves", "start", "walk"]


def start(forecast: ProbabilityMatrix, draw: float) -> tuple[int, int]:
    """The hypothesis that a person follows, and the cell at step 0, y * grid_size + x.

    Args:
        forecast: the person's forecast.
        draw: a uniform draw from [0, 1).
    """
    index = int(forecast.start_cumulative.searchsorted(draw, side="right"))
    return divmod(index, forecast.grid_size**2)


class Starts:
    """The array form of `start`, for persons with different forecasts.

    Args:
        forecasts: the forecasts, which are numbered in this order.
    """

    def __init__(self, forecasts: Sequence[ProbabilityMatrix]) -> None:
        cumulative = [forecast.start_cumulative for forecast in forecasts]
        # Each forecast's entries are a square array, so that two short counts find an entry.
        self._width = math.isqrt(max(map(len, cumulative)) - 1) + 1
        entries = np.full((len(cumulative), self._width**2), 2.0)
        for place, values in zip(entries, cumulative, strict=True):
            place[: len(values)] = values
        self._blocks = entries.reshape(-1, self._width)
        self._ends = self._blocks[:, -1].reshape(-1, self._width).copy()

    def __call__(self, numbers: NDArray[Any], draws: NDArray[Any]) -> NDArray[np.int64]:
        """Return the hypothesis times grid_size², plus the cell, of each person at step 0.

        Args:
            numbers: the number of each person's forecast.
            draws: a uniform draw from [0, 1) for each, of the same shape.
        """
        above = draws[..., None]
        block = np.less_equal(self._ends.take(numbers, 0), above).sum(-1)
        block += numbers * self._width
        entry = np.less_equal(self._blocks.take(block, 0), above).sum(-1)
        found: NDArray[np.int64] = (block - numbers * self._width) * self._width + entry
        return found


def walk(
    forecast: ProbabilityMatrix,
    hypothesis: int,
    step: int,
    cell: int,
    draws_x: Sequence[float],
    draws_y: Sequence[float],
) -> list[int]:
    """Walk one person for several steps, at most to the end of the forecast's block of tables.

    Args:
        forecast: the person's forecast.
        hypothesis: the hypothesis that the person follows.
        step: completed steps at the start.
        cell: the person's cell at the start, y * grid_size + x.
        draws_x: a uniform draw from [0, 1) for the move along x in each step.
        draws_y: the same for y.

    Returns:
        The cell after each step.
    """
    block = forecast.block(step)
    right, left = block.right, block.left
    grid_size = forecast.grid_size
    y, x = divmod(cell, grid_size)
    path = []
    # For each step and hypothesis the tables hold a row for x, then a row for y.
    width = 2 * grid_size * len(forecast.weights)
    rows_of_x = range((step - block.first) * width + 2 * grid_size * hypothesis, len(right), width)
    for row, u, v in zip(rows_of_x, draws_x, draws_y, strict=False):
        at_x = row + x
        if u < right[at_x]:
            x += 1
        elif u < right[at_x] + left[at_x]:
            x -= 1
        at_y = row + grid_size + y
        if v < right[at_y]:
            y += 1
        elif v < right[at_y] + left[at_y]:
            y -= 1
        path.append(y * grid_size + x)
    return path


def moves(draws: NDArray[Any], higher: NDArray[Any], either: NDArray[Any]) -> NDArray[np.int8]:
    """The moves of many persons along an axis in one step.

    Args:
        draws: a uniform draw from [0, 1) for each person; or, if the probabilities are
            multiplied by 2**53 too, the integer 2**53 times the draw.
        higher: the probability of +1 at each person's coordinate, of the same shape.
        either: the probability of +1 or -1, their sum.

    Returns:
        int8, of the same shape: +1, -1 or 0.
    """
    move: NDArray[np.int8] = np.less(draws, higher).view(np.int8)
    move += move
    move -= np.less(draws, either).view(np.int8)  # 2 a - (a or b)
    return move
