"""The person adrift: a walk over cells, at most one cell a step along each axis.

From step to step the person follows the moves tabulated beside the law in
`probability_matrix`, so that at every step it is distributed exactly as the matrix says.
"""

from __future__ import annotations

from collections.abc import Sequence

from DroneSwarmSearch.probability_matrix import ProbabilityMatrix

__all__ = ["walk"]


def walk(
    law: ProbabilityMatrix, step: int, cell: int, for_x: Sequence[float], for_y: Sequence[float]
) -> list[int]:
    """Follow a person for some steps, at most to the end of the law's block of tables.

    Args:
        law: the person's law.
        step: completed steps at the beginning.
        cell: the person's cell then, y * grid_size + x.
        for_x: a number in [0, 1) for each step to walk, which decides the move along x.
        for_y: the same for y.

    Returns:
        The cell after each step.
    """
    block = law.block(step)
    moves = block.moves[step - block.first :]
    grid_size = law.grid_size
    y, x = divmod(cell, grid_size)
    path = []
    for (right_x, moved_x, right_y, moved_y), u, v in zip(moves, for_x, for_y, strict=False):
        if u < moved_x[x]:
            x += 1 if u < right_x[x] else -1
        if v < moved_y[y]:
            y += 1 if v < right_y[y] else -1
        path.append(y * grid_size + x)
    return path
