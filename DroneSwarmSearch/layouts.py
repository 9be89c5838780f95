"""Layouts of observations for networks: one vector, or planes as of a picture.

Matrices are scaled to their maximum here: probabilities of single cells are small
numbers, which networks learn from badly, and it is their shape that says where to look.

Arrays have any number of leading batch axes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["mark", "scaled_matrices", "scaled_positions"]

Singles = NDArray[np.float32]
Cells = NDArray[np.integer]


def scaled_matrices(matrices: Singles, out: Singles) -> None:
    """Write matrices with their maximum scaled to 1.

    Args:
        matrices: float32, shape (..., N, N).
        out: receives them, float32, same shape; may be the same array.
    """
    highest = matrices.max(axis=(-2, -1), keepdims=True)
    np.divide(matrices, highest, out=out)


def scaled_positions(positions: Cells, grid_size: int, out: Singles) -> None:
    """Write positions with the grid scaled to the unit square.

    Args:
        positions: columns or rows, of any shape.
        grid_size: cells along each side.
        out: receives them, float32, same shape.
    """
    np.divide(positions, np.float32(grid_size - 1), out=out, casting="same_kind")


def mark(cells: Cells, planes: Singles) -> None:
    """Write 1 where a drone is and 0 elsewhere.

    Args:
        cells: y * N + x, shape (n, drones): every drone of a plane.
        planes: receives them, float32, shape (n, N, N).
    """
    planes[...] = 0.0
    y, x = np.divmod(cells, planes.shape[-1])
    planes[np.arange(len(cells))[:, None], y, x] = 1.0
