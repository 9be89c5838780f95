"""The best path of one drone for given gains, by dynamic programming over cells and steps.

For gains G[t](c) of searching cell c in step t, the value of being in a cell is

    V[t](c) = max(G[t](c) + V[t+1](c), V[t+1](c'), c' next to c),

since a drone either searches its cell or moves by one cell in a step (R. Bellman, Dynamic
Programming, 1957). One pass computes the values of all cells, for drones anywhere. A search may
gain less right after one of the same cell, so there is a second value, of a cell just searched.

Drones that search in flight search the cell in which they arrive, their own or a neighbour:

    V[t](c) = max(G[t](c') + V[t+1](c'), c' = c or next to c).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from DroneSwarmSearch._internal.arrays import Flags, Floats, Ints
from DroneSwarmSearch.core.grid import neighbours_in_box
from DroneSwarmSearch.core.rules import BLOCK, PASS

FORBIDDEN = -np.inf  # the value of a cell that a drone must not be in


class DronePath(NamedTuple):
    """One drone's path over n steps.

    Attributes:
        cells: the drone's cell y * N + x at the beginning and after each step: int64, (n + 1,).
        searches: the steps in which it searches: bool, (n,). In the others it moves or idles. In
            flight, it searches where it arrives.
    """

    cells: Ints
    searches: Flags


def cells_looked_at(cells: Ints, in_flight: bool) -> Ints:
    """The cell that a drone searches in each step, if it does: (n, ...), given (n + 1, ...)."""
    return cells[1:] if in_flight else cells[:-1]


def values_to_go(
    gains: Floats,
    at_end: Floats,
    blocked: Sequence[Sequence[tuple[Any, ...]]] = (),
    again: Floats | None = None,
    in_flight: bool = False,
) -> Floats:
    """The most that a drone can gain from each step and cell on: shape (2, n + 1, ..., h, w).

    The first values are for a drone that has just moved, the second for one that has just searched.

    Args:
        gains: of searching a cell in a step, at least 0: shape (n, ..., h, w), indexed [t, y, x];
            dimensions in between stand for different gains.
        at_end: the value of each cell after the last step, (h, w); may be `FORBIDDEN`.
        blocked: for each step, the cells y * w + x that a drone must not be in after it, as
            indices of an array of shape (..., h * w); none by default.
        again: gains of searching a cell directly after a search of it; by default, the same.
        in_flight: whether drones search in flight.
    """
    n = len(gains)
    values = np.empty((2, n + 1, *gains.shape[1:]), gains.dtype)
    values[:, n] = at_end
    flat = values.reshape(*values.shape[:-2], -1)
    if again is None:
        again = gains
    for step in range(n - 1, -1, -1):
        if len(blocked):
            for index in blocked[step]:
                flat[0, step + 1][index] = flat[1, step + 1][index] = FORBIDDEN
        ahead, searched = values[:, step + 1]
        here, here_again = values[:, step]
        # A drone that waits searches, since gains are never negative.
        np.add(again[step], searched, out=here_again)
        if in_flight:
            ahead = gains[step] + searched
        here[..., :1, :] = FORBIDDEN
        here[..., 1:, :] = ahead[..., :-1, :]
        np.maximum(here[..., :-1, :], ahead[..., 1:, :], out=here[..., :-1, :])
        np.maximum(here[..., 1:], ahead[..., :-1], out=here[..., 1:])
        np.maximum(here[..., :-1], ahead[..., 1:], out=here[..., :-1])
        np.maximum(here_again, here, out=here_again)
        np.maximum(here, gains[step] + searched, out=here)
    return values


def best_paths(
    gains: Floats,
    values: Floats,
    starts: Ints,
    which: Ints,
    again: Floats | None = None,
    in_flight: bool = False,
) -> tuple[Ints, Flags]:
    """Paths that gain as much as possible, given the result of `values_to_go`.

    Ties go to searching, then to moving left, right, up and down.

    Args:
        gains: as in `values_to_go`, of shape (n, k, h, w): k different gains.
        values: the result of `values_to_go`.
        starts: the first cell y * w + x of each path: (m,).
        which: the gains that count for each path: (m,).
        again: as in `values_to_go`.
        in_flight: as in `values_to_go`.

    Returns:
        The cells y * w + x at the beginning and after each step, (n + 1, m), and the steps with a
        search, (n, m).
    """
    n, _, height, width = gains.shape
    ahead_of = neighbours_in_box(height, width)
    first = which * (height * width)
    cells = np.empty((n + 1, len(starts)), np.int64)
    searches = np.zeros((n, len(starts)), np.bool_)
    cells[0] = here = starts
    if again is None:
        again = gains
    just_searched = np.zeros(len(starts), np.bool_)
    for step in range(n):
        flat = first + here
        gain = np.where(just_searched, again[step].take(flat), gains[step].take(flat))
        ahead = ahead_of[:, here]
        moved = values[0, step + 1].take(first + ahead)
        if in_flight:
            moved = gains[step].take(first + ahead) + values[1, step + 1].take(first + ahead)
        options = np.where(ahead == here, FORBIDDEN, moved)
        options[0] = gain + values[1, step + 1].take(flat)
        chosen = options.argmax(axis=0)
        just_searched = np.ones(len(starts), np.bool_) if in_flight else chosen == 0
        searches[step] = True if in_flight else just_searched & (gain > 0.0)
        cells[step + 1] = here = ahead[chosen, np.arange(len(here))]
    return cells, searches


def path_beside_others(
    gains: Floats,
    start: int,
    *,
    before: Sequence[DronePath],
    waiting: Sequence[int],
    crash: str,
    in_flight: bool,
) -> DronePath:
    """The path of one drone that gains most, beside those of others.

    Args:
        gains: of searching a cell in a step: (n, N, N). A search right after one of the same cell
            gains nothing.
        start: the drone's first cell.
        before: the paths of drones with lower numbers.
        waiting: the cells of drones with higher numbers, which have no paths yet.
        crash: what happens to drones that meet, see `core.rules`.
        in_flight: as in `values_to_go`.
    """
    steps, size, _ = gains.shape
    taken = [*(path.cells[1:] for path in before), *(np.full(steps, cell) for cell in waiting)]
    if crash == PASS:
        taken = []
    elif crash == BLOCK:  # out of the way before the others move
        taken += [np.append(path.cells[2:], path.cells[-1]) for path in before]
    blocked = [[(0, cells)] for cells in np.array(taken, np.int64).reshape(-1, steps).T]
    single = gains[:, None]  # (n, 1, N, N)
    again = np.zeros_like(single)
    values = values_to_go(single, np.zeros((size, size)), blocked, again, in_flight)
    first = np.zeros(1, np.int64)
    cells, searches = best_paths(single, values, np.array([start]), first, again, in_flight)
    return DronePath(cells[:, 0], searches[:, 0])
