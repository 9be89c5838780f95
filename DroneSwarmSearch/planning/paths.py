"""The best path of one drone for given gains, by dynamic programming over cells and steps.

For gains G[t](c) of searching cell c in step t, the value of being in a cell is

    V[t](c) = max(G[t](c) + V[t+1](c), V[t+1](c'), c' next to c or c itself),

since a drone either searches its cell or moves by one cell in a step (R. Bellman, Dynamic
Programming, 1957). One pass computes the values of all cells, for drones anywhere.

Drones that search in flight take two steps to cross a cell: they search it in one step, which is
why they *stay*, and may move in the next.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from DroneSwarmSearch._internal.arrays import Flags, Floats, Ints

FORBIDDEN = -np.inf
"""The value of a cell that a drone must not be in."""


class Path(NamedTuple):
    """One drone's path over n steps.

    Attributes:
        cells: the drone's cell y * N + x at the beginning and after each step: int64, (n + 1,).
        searches: the steps in which it searches: bool, (n,). In the others it moves or idles.
    """

    cells: Ints
    searches: Flags


def values_to_go(
    gains: Floats,
    at_end: Floats,
    blocked: Sequence[Sequence[int]] = (),
    stays: Flags | None = None,
) -> Floats:
    """The most that a drone can gain from each step and cell on: float64, (n + 1, N, N).

    Args:
        gains: of searching a cell in a step, at least 0: shape (n, N, N), indexed [t, y, x].
        at_end: the value of each cell after the last step, (N, N); may be `FORBIDDEN`.
        blocked: for each step, the cells that the drone must not be in after it; none by default.
        stays: for each step, whether the drone must stay and search; by default, it is free.
    """
    n = len(gains)
    values = np.empty((n + 1, *at_end.shape))
    values[n] = at_end
    for step in range(n - 1, -1, -1):
        ahead, here = values[step + 1], values[step]
        if blocked and blocked[step]:
            ahead = ahead.copy()
            ahead.reshape(-1)[blocked[step]] = FORBIDDEN
        # Gains are never negative, so searching is no worse than idling.
        np.add(gains[step], ahead, out=here)
        if stays is not None and stays[step]:
            continue
        np.maximum(here[1:], ahead[:-1], out=here[1:])
        np.maximum(here[:-1], ahead[1:], out=here[:-1])
        np.maximum(here[:, 1:], ahead[:, :-1], out=here[:, 1:])
        np.maximum(here[:, :-1], ahead[:, 1:], out=here[:, :-1])
    return values


def best_path(
    gains: Floats,
    values: Floats,
    start: int,
    blocked: Sequence[Sequence[int]] = (),
    stays: Flags | None = None,
) -> Path:
    """A path that gains as much as possible, given the result of `values_to_go`.

    Ties go to searching, then to moving left, right, up and down.
    """
    n, height, width = gains.shape
    cells, searches = np.empty(n + 1, np.int64), np.zeros(n, np.bool_)
    cells[0] = here = start
    flat_gains, flat_values = gains.reshape(n, -1), values.reshape(n + 1, -1)
    for step in range(n):
        if stays is not None and stays[step]:
            cells[step + 1], searches[step] = here, True
            continue
        ahead = flat_values[step + 1]
        closed = blocked[step] if blocked else ()
        best, target = FORBIDDEN, here
        if here not in closed:
            best = flat_gains[step, here] + ahead[here]
        y, x = divmod(here, width)
        searches[step] = flat_gains[step, here] > 0.0
        for on_grid, cell in (
            (x > 0, here - 1),
            (x < width - 1, here + 1),
            (y > 0, here - width),
            (y < height - 1, here + width),
        ):
            if on_grid and ahead[cell] > best and cell not in closed:
                best, target = ahead[cell], cell
                searches[step] = False
        cells[step + 1] = here = target
    return Path(cells, searches)
