"""The person adrift: a walk over cells, at most one cell a step along each axis.

From step to step the person follows the moves tabulated beside the forecast in
`probability_matrix`, so that at every step it is distributed exactly as the matrix says.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch.drift.probability_matrix import ProbabilityMatrix

__all__ = ["move_probabilities", "moved", "walk"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def walk(
    forecast: ProbabilityMatrix,
    step: int,
    cell: int,
    for_x: Sequence[float],
    for_y: Sequence[float],
) -> list[int]:
    """Follow a person for some steps, at most to the end of the forecast's block of tables.

    Args:
        forecast: the person's forecast.
        step: completed steps at the beginning.
        cell: the person's cell then, y * grid_size + x.
        for_x: a number in [0, 1) for each step to walk, which decides the move along x.
        for_y: the same for y.

    Returns:
        The cell after each step.
    """
    block = forecast.block(step)
    right, left = block.right, block.left
    grid_size = forecast.grid_size
    y, x = divmod(cell, grid_size)
    path = []
    # The tables hold a row for x and a row for y of each step, one after another.
    rows_of_x = range((step - block.first) * 2 * grid_size, len(right), 2 * grid_size)
    for row, u, v in zip(rows_of_x, for_x, for_y, strict=False):
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


def moved(coordinates: Ints, uniforms: Floats, higher: Floats, lower: Floats) -> Ints:
    """One step of `walk` along one axis, for many persons with the same forecast.

    Args:
        coordinates: the persons' columns (or rows), shape (n,).
        uniforms: a number in [0, 1) for each person.
        higher: probability of moving from each column to the next higher one, shape (N,).
        lower: the same for the next lower one.

    Returns:
        int64, shape (n,): the columns (or rows) after the step.
    """
    rises = higher[coordinates]
    falls = (uniforms >= rises) & (uniforms < rises + lower[coordinates])
    after: Ints = coordinates + (uniforms < rises) - falls
    return after


def move_probabilities(coordinates: Ints, higher: Floats, lower: Floats) -> Floats:
    """The probabilities of the three moves along one axis.

    Args:
        coordinates: the persons' columns (or rows), shape (n,).
        higher: as in `moved`.
        lower: as in `moved`.

    Returns:
        float64, shape (3, n): of moving lower, staying and moving higher.
    """
    rises, falls = higher[coordinates], lower[coordinates]
    return np.stack([falls, 1.0 - rises - falls, rises])
