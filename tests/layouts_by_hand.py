"""Plain implementations of the observation layouts, number by number."""

from collections.abc import Sequence

import numpy as np

__all__ = ["TOP_CELLS", "drone_by_hand", "swarm_by_hand"]

TOP_CELLS = 8

Cell = Sequence[int]


def drone_by_hand(layout, drone, positions, matrix, left):
    """A drone's observation.

    Args:
        layout: its name.
        drone: by number.
        positions: every drone's (x, y).
        matrix: as the environment returns it.
        left: the remaining time fraction.
    """
    own = positions[drone]
    others = [*positions[:drone], *positions[drone + 1 :]]
    if layout == "dict":
        return {"position": np.array(own, np.int32), "probability_matrix": matrix}
    if layout == "flat":
        return flat([own, *others], matrix, left)
    if layout == "planes":
        return planes([[own], others], matrix, left)
    assert layout == "top-cells"
    return top_cells(own, others, matrix, left)


def swarm_by_hand(layout, positions, matrix, left):
    """A swarm's observation; arguments as above."""
    if layout == "flat":
        return flat(positions, matrix, left)
    if layout == "planes":
        return planes([[cell] for cell in positions], matrix, left)
    return np.stack(
        [drone_by_hand(layout, k, positions, matrix, left) for k in range(len(positions))]
    )


def flat(positions: Sequence[Cell], matrix: np.ndarray, left: float) -> np.ndarray:
    size = len(matrix)
    numbers = [number / (size - 1) for cell in positions for number in cell]
    return np.concatenate([np.float32([*numbers, left]), (matrix / matrix.max()).reshape(-1)])


def planes(groups: Sequence[Sequence[Cell]], matrix: np.ndarray, left: float) -> np.ndarray:
    """The matrix, a plane for every group of drones, and the time."""
    out = np.zeros((2 + len(groups), *matrix.shape), np.float32)
    out[0] = matrix / matrix.max()
    for plane, cells in zip(out[1:], groups, strict=False):
        for x, y in cells:
            plane[y, x] = 1
    out[-1] = left
    return out


def top_cells(own, others, matrix, left, k=TOP_CELLS):
    size = len(matrix)
    x, y = own
    cells = [(column, row) for row in range(size) for column in range(size)]
    cells.sort(key=lambda cell: -matrix[cell[1], cell[0]])  # of equals the first stays first
    numbers: list[float] = []
    for column, row in cells[:k]:
        share = matrix[row, column] / matrix.max()
        numbers += [(column - x) / (size - 1), (row - y) / (size - 1), share]
    numbers += [x / (size - 1), y / (size - 1)]
    for column, row in sorted(others, key=lambda cell: abs(cell[0] - x) + abs(cell[1] - y)):
        numbers += [(column - x) / (size - 1), (row - y) / (size - 1)]
    return np.float32([*numbers, left])
