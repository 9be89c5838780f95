"""The numbers of the cells of a grid: y * size + x; y grows downward."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Whole = TypeVar("Whole", int, NDArray[np.int64], NDArray[np.int32])


def cell_number(x: Whole, y: Whole, size: int) -> Whole:
    """The numbers of the cells in columns x and rows y of a grid that is `size` cells wide."""
    return y * size + x


def cell_position(cells: Whole, size: int) -> tuple[Whole, Whole]:
    """The columns x and the rows y of cells, given by number."""
    y, x = divmod(cells, size)
    return x, y
