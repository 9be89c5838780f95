"""The best path of one drone: a dynamic programme over cells and steps.

For given gains G[t, y, x] of searching a cell in a step, the best a drone can still gain
from a cell onward is

    V[t](c) = max(G[t](c) + V[t+1](c), V[t+1](c'), c' next to c or c itself),

since a step is either spent on searching or on moving one cell (Bellman, Dynamic
Programming, 1957). All cells are done together, so one pass serves drones anywhere.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["NOWHERE", "Path", "best_path", "values_to_go"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

NOWHERE = -np.inf
"""The value of a cell that a drone must not be in."""


class Path(NamedTuple):
    """One drone's plan.

    Attributes:
        cells: where the drone is after each step, y * N + x, from the beginning on:
            int64, shape (n + 1,).
        searches: in which steps it searches: bool, shape (n,). In the others it moves, or
            stays idle if its cell stays the same.
    """

    cells: Ints
    searches: NDArray[np.bool_]


def values_to_go(gains: Floats, at_end: Floats, blocked: list[list[int]] | None = None) -> Floats:
    """What a drone can still gain at most, from every cell and step on.

    Args:
        gains: of searching a cell in a step: shape (n, N, N), indexed [t, y, x].
        at_end: what it is worth to be in a cell after the last step, shape (N, N);
            `NOWHERE` forbids a cell.
        blocked: for each step, the cells that must not be entered or kept in it,
            y * N + x, because others will be there.

    Returns:
        float64, shape (n + 1, N, N).
    """
    n = len(gains)
    values = np.empty((n + 1, *at_end.shape))
    values[n] = at_end
    for step in range(n - 1, -1, -1):
        ahead, here = values[step + 1], values[step]
        if blocked is not None and blocked[step]:
            ahead = ahead.copy()
            ahead.reshape(-1)[blocked[step]] = NOWHERE
        # Gains are never negative: searching is no worse than idling.
        np.add(gains[step], ahead, out=here)
        np.maximum(here[1:], ahead[:-1], out=here[1:])
        np.maximum(here[:-1], ahead[1:], out=here[:-1])
        np.maximum(here[:, 1:], ahead[:, :-1], out=here[:, 1:])
        np.maximum(here[:, :-1], ahead[:, 1:], out=here[:, :-1])
    return values


def best_path(
    gains: Floats, values: Floats, start: int, blocked: list[list[int]] | None = None
) -> Path:
    """A path that gains as much as `values` promises.

    Args:
        gains: as given to `values_to_go`.
        values: what that returned.
        start: the drone's first cell, y * N + x.
        blocked: as given to `values_to_go`.

    Returns:
        The path; among equally good ones that which searches first, then moves left,
        right, up or down.
    """
    n, size = len(gains), gains.shape[-1]
    cells, searches = np.empty(n + 1, np.int64), np.zeros(n, np.bool_)
    cells[0] = here = start
    flat_gains, flat_values = gains.reshape(n, -1), values.reshape(n + 1, -1)
    for step in range(n):
        ahead = flat_values[step + 1]
        taken = blocked[step] if blocked is not None else ()
        best, target = NOWHERE, here
        if here not in taken:
            best = flat_gains[step, here] + ahead[here]
        y, x = divmod(here, size)
        searches[step] = flat_gains[step, here] > 0.0
        for allowed, cell in (
            (x > 0, here - 1),
            (x < size - 1, here + 1),
            (y > 0, here - size),
            (y < size - 1, here + size),
        ):
            if allowed and ahead[cell] > best and cell not in taken:
                best, target = ahead[cell], cell
                searches[step] = False
        cells[step + 1] = here = target
    return Path(cells, searches)
