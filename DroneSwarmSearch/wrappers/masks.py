"""Which actions are sensible: masks that keep drones on the grid and out of each other."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch.rules import OFF_GRID, Action, neighbours_of_all

__all__ = ["action_masks", "choose_in_turn"]


def action_masks(cells: ArrayLike, grid_size: int, right_of_way: bool = False) -> NDArray[np.bool_]:
    """Which actions each drone of some swarms is allowed.

    A move is masked that leaves the grid or leads into a cell where another drone is.
    Searching and idling are always allowed. So no drone leaves the grid, but two may still
    collide by moving into the same empty cell.

    With right of way that cannot happen either, whatever drones choose independently of
    each other: a drone gives way to those before it and is not allowed to move within a
    step of any of their cells, where they may be next. Two drones can only meet in a cell
    that the later one moves into, which is then beyond the reach of the earlier one, or in
    one where the later one has stayed, which the earlier one may not move into.

    Args:
        cells: every drone's cell, y * grid_size + x; integers, shape (..., n).
        grid_size: cells along each side.
        right_of_way: mask moves to where an earlier drone may be next, too.

    Returns:
        bool, shape (..., n, 6), indexed by `Action`: True where allowed.

    Raises:
        TypeError: the cells or the grid's size are no integers.
        ValueError: they are out of their limits, or of another shape.
    """
    places = _checked_cells(cells, grid_size)
    right_of_way = checks.boolean("right_of_way", right_of_way)
    n = places.shape[-1]
    by_swarm = places.reshape(-1, n)
    swarms = np.arange(len(by_swarm))[:, None]
    ahead = _targets(grid_size)[by_swarm, :4]
    masks = np.ones((*by_swarm.shape, len(Action)), np.bool_)
    masks[..., :4] = ~_closed(by_swarm, grid_size)[swarms[..., None], ahead]
    if right_of_way:
        # In every cell, the first of the drones that may be there next.
        first = np.full((len(by_swarm), grid_size**2 + 1), n, np.min_scalar_type(n))
        for drone in reversed(range(n)):
            first[swarms[:, 0], by_swarm[:, drone]] = drone
            first[swarms, ahead[:, drone]] = drone
        masks[..., :4] &= first[swarms[..., None], ahead] >= np.arange(n)[:, None]
    return masks.reshape(*places.shape, len(Action))


def choose_in_turn(
    scores: NDArray[np.floating], cells: NDArray[np.integer], grid_size: int
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Let the drones of each swarm choose one after another, so that none collide.

    Each takes its best-scored action among those that are open to it: no move off the grid,
    none into a cell where another drone is, and none into one that a drone before it is
    about to enter. Searching and idling are always open.

    With Gumbel noise added to logits as scores this draws from their softmax over the open
    actions (E. J. Gumbel, Statistical theory of extreme values and some practical
    applications, 1954), so that a policy trained on it samples exactly what it is paid for.

    Args:
        scores: of every action of every drone, shape (swarms, n, 6), indexed by `Action`;
            or (swarms, n, 5), where drones never idle.
        cells: every drone's cell, y * grid_size + x; shape (swarms, n).
        grid_size: cells along each side.

    Returns:
        The actions, int64, shape (swarms, n); and which were open to each drone when its
        turn came, bool, of the scores' shape.

    Raises:
        TypeError: the cells or the grid's size are no integers.
        ValueError: they are out of their limits, or of another shape than the scores.
    """
    cells = _checked_cells(cells, grid_size)
    if cells.ndim != 2 or scores.shape not in ((*cells.shape, 5), (*cells.shape, 6)):
        raise ValueError(
            "scores must have the shape (swarms, n, 6) or (swarms, n, 5) for cells of shape "
            f"(swarms, n), got {scores.shape} for {cells.shape}"
        )
    swarms = np.arange(len(cells))
    targets = _targets(grid_size)
    closed = _closed(cells, grid_size)
    actions = np.empty(cells.shape, np.int64)
    masks = np.ones(scores.shape, np.bool_)
    for drone in range(cells.shape[1]):
        ahead = targets[cells[:, drone]]
        masks[:, drone, :4] = ~closed[swarms[:, None], ahead[:, :4]]
        chosen = np.where(masks[:, drone], scores[:, drone], -np.inf).argmax(axis=1)
        actions[:, drone] = chosen
        closed[swarms, ahead[swarms, chosen]] = True
    return actions, masks


def _checked_cells(cells: ArrayLike, grid_size: int) -> NDArray[np.integer]:
    """The drones' cells as an array of integers, shape (..., n)."""
    size = checks.integer("grid_size", grid_size, 2)
    what = f"integers from 0 to {size**2 - 1}, of shape (..., n)"
    places = checks.array("cells", cells, what)
    if places.dtype.kind not in "iu":
        raise TypeError(f"cells must be {what}, got {places.dtype}")
    if not places.ndim:
        raise ValueError(f"cells must be {what}, got {cells!r}")
    wrong = places[(places < 0) | (places >= size**2)]
    if wrong.size:
        raise ValueError(f"cells must be {what}, got {wrong[0]}")
    return places


def _closed(cells: NDArray[np.integer], grid_size: int) -> NDArray[np.bool_]:
    """Where nobody may move, (swarms, cells + 1), see `_targets`: off the grid, onto a drone."""
    closed = np.zeros((len(cells), grid_size**2 + 1), np.bool_)
    closed[:, -1] = True
    closed[np.arange(len(cells))[:, None], cells] = True
    return closed


@lru_cache(maxsize=16)
def _targets(grid_size: int) -> NDArray[np.int64]:
    """Where actions lead, indexed [cell, action]; the last cell + 1 stands for off the grid."""
    targets = neighbours_of_all(grid_size)
    targets[targets == OFF_GRID] = grid_size**2
    targets.flags.writeable = False
    return targets
