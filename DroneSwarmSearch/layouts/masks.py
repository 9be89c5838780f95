"""Action masks, which keep drones on the grid and apart from each other."""

from __future__ import annotations

import math
from functools import lru_cache
from itertools import product

import numpy as np
from gymnasium import spaces
from numpy.typing import ArrayLike, NDArray

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.grid import Neighbours
from DroneSwarmSearch.rules import OFF_GRID, Action, neighbours_of_all

__all__ = ["action_masks", "choose_in_turn", "mask_space"]

_MASKS = {
    closed: np.array([*(not is_closed for is_closed in closed), 1, 1], np.int8)
    for closed in product((False, True), repeat=4)
}
"""The mask of a drone by which of its four moves are closed."""


def action_masks(cells: ArrayLike, grid_size: int, right_of_way: bool = False) -> NDArray[np.bool_]:
    """Which actions each drone of some swarms is allowed.

    Moves that leave the grid or lead into another drone's cell are masked; searching and
    idling are always allowed. Drones then never leave the grid, but two may still collide by
    moving into the same empty cell.

    Right of way prevents that too, even if the drones choose independently: each drone gives
    way to the drones with lower numbers, and may not move to a cell within one step of
    theirs. A later drone thus never enters a cell that an earlier one may enter, and an
    earlier drone never enters the current cell of a later one.

    Args:
        cells: every drone's cell, y * grid_size + x; integers, shape (..., n).
        grid_size: cells along each side.
        right_of_way: also mask moves to where a drone with a lower number may be next.

    Returns:
        bool, shape (..., n, 6), indexed by `Action`: True where allowed.

    Raises:
        TypeError: the cells or the grid size are not integers.
        ValueError: they are out of their limits, or of another shape.
    """
    places = _checked_cells(cells, grid_size)
    right_of_way = checks.boolean("right_of_way", right_of_way)
    n, cells_each = places.shape[-1], grid_size**2 + 1
    by_swarm = places.reshape(math.prod(places.shape[:-1]), n)
    first_cells = np.arange(0, len(by_swarm) * cells_each, cells_each)[:, None]
    here = first_cells + by_swarm
    ahead = first_cells[..., None] + _targets(grid_size)[:, :4].take(by_swarm, axis=0)
    # What the number of a drone must be below to enter a cell: 0 where no drone may enter.
    below = np.full(len(by_swarm) * cells_each, n, np.min_scalar_type(n))
    if right_of_way:
        for drone in reversed(range(n)):
            below[ahead[:, drone]] = drone + 1
    below[here] = 0
    below[cells_each - 1 :: cells_each] = 0  # off the grid
    masks = np.ones((*by_swarm.shape, len(Action)), np.bool_)
    np.greater(below.take(ahead), np.arange(n, dtype=below.dtype)[:, None], out=masks[..., :4])
    return masks.reshape(*places.shape, len(Action))


def mask_space(n_drones: int | None = None) -> spaces.Box:
    """The space of masks in observations: int8, shape (6,), or (n_drones, 6) for a swarm."""
    shape = (len(Action),) if n_drones is None else (n_drones, len(Action))
    return spaces.Box(0, 1, shape, np.int8)


def swarm_masks(
    cells: list[int], neighbours: Neighbours, right_of_way: bool
) -> list[NDArray[np.int8]]:
    """`action_masks` for a single swarm: each drone's mask, int8, shape (6,); new arrays.

    Args:
        cells: every drone's cell.
        neighbours: of the grid's cells.
        right_of_way: as for `action_masks`.
    """
    closed = {OFF_GRID, *cells}
    masks = []
    for cell in cells:
        targets = neighbours[cell]
        left, right, up, down, _, _ = targets
        mask = _MASKS[left in closed, right in closed, up in closed, down in closed]
        masks.append(mask.copy())
        if right_of_way:
            closed.update(targets)
    return masks


def choose_in_turn(
    scores: NDArray[np.floating], cells: NDArray[np.integer], grid_size: int
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Let the drones of each swarm choose in turn, so that none collide.

    Each drone takes its best-scored action among those allowed: no move off the grid, into
    another drone's cell, or into a cell that a drone before it is about to enter. Searching
    and idling are always allowed.

    With logits plus Gumbel noise as scores, the choices are samples of the softmax over the
    allowed actions (E. J. Gumbel, Statistical theory of extreme values and some practical
    applications, 1954).

    Args:
        scores: of each drone's actions, shape (swarms, n, 6), indexed by `Action`; or
            (swarms, n, 5) if drones never idle.
        cells: every drone's cell, y * grid_size + x; shape (swarms, n).
        grid_size: cells along each side.

    Returns:
        The actions, int64, shape (swarms, n); and which actions each drone was allowed at its
        turn, bool, of the scores' shape.

    Raises:
        TypeError: the cells or the grid size are not integers.
        ValueError: they are out of their limits, or do not match the scores' shape.
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


def _checked_cells(cells: ArrayLike, grid_size: int) -> NDArray[np.int64]:
    """The drones' cells: int64, shape (..., n)."""
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
    return places.astype(np.int64, copy=False)


def _closed(cells: NDArray[np.integer], grid_size: int) -> NDArray[np.bool_]:
    """The cells that no drone may enter, bool, (swarms, cells + 1), indexed as by `_targets`."""
    closed = np.zeros((len(cells), grid_size**2 + 1), np.bool_)
    closed[:, -1] = True
    closed[np.arange(len(cells))[:, None], cells] = True
    return closed


@lru_cache(maxsize=16)
def _targets(grid_size: int) -> NDArray[np.int64]:
    """The target of each action, [cell, action]; the index after the last cell is off the grid."""
    targets = neighbours_of_all(grid_size)
    targets[targets == OFF_GRID] = grid_size**2
    targets.flags.writeable = False
    return targets
