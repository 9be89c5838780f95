"""Action masks, which keep drones on the grid and apart from each other."""

from __future__ import annotations

import math

import numpy as np
from gymnasium import spaces
from numpy.typing import ArrayLike, NDArray

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.arrays import Flags, Ints
from DroneSwarmSearch.core.grid import OFF_GRID, CellTable, Grid
from DroneSwarmSearch.core.rules import Action


def action_masks(cells: ArrayLike, grid_size: int, right_of_way: bool = False) -> Flags:
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
    size = checks.integer("grid_size", grid_size, 2)
    what = f"integers from 0 to {size**2 - 1}, of shape (..., n)"
    checked = checks.integer_array("cells", cells, what, 0, size**2 - 1)
    if not checked.ndim:
        raise ValueError(f"cells must be {what}, got {cells!r}")
    checks.boolean("right_of_way", right_of_way)
    n = checked.shape[-1]
    by_swarm = checked.reshape(math.prod(checked.shape[:-1]), n)
    closed = _closed(by_swarm, grid_size)
    ahead = Grid.of(size).targets.take(by_swarm, axis=0)  # (swarms, n, 6)
    masks: Flags = ahead == by_swarm[..., None]
    # Flat indices are faster than two axes; `OFF_GRID` is the last cell.
    flat = closed.reshape(-1)
    swarm_begins = np.arange(0, closed.size, closed.shape[1])[:, None, None]
    indices = (ahead % closed.shape[1] + swarm_begins).swapaxes(0, 1).copy()  # (n, swarms, 6)
    for drone in range(n):
        masks[:, drone] |= ~flat.take(indices[drone])
        if right_of_way:
            flat[indices[drone]] = True
    return masks.reshape(*checked.shape, len(Action))


def mask_space(n_drones: int | None = None) -> spaces.Box:
    """The space of masks in observations: int8, shape (6,), or (n_drones, 6) for a swarm."""
    shape = (len(Action),) if n_drones is None else (n_drones, len(Action))
    return spaces.Box(0, 1, shape, np.int8)


def swarm_masks(
    cells: list[int], neighbours: CellTable[tuple[int, ...]], right_of_way: bool
) -> list[NDArray[np.int8]]:
    """`action_masks` for a single swarm: each drone's mask, int8, shape (6,); new arrays."""
    closed = {OFF_GRID, *cells}
    allowed = bytearray()
    for cell in cells:
        # Four names instead of a loop over the moves save a third of the time.
        left, right, up, down, _, _ = neighbours[cell]
        allowed += bytes(
            (
                left not in closed,
                right not in closed,
                up not in closed,
                down not in closed,
                True,  # to search
                True,  # to idle
            )
        )
        if right_of_way:
            closed.update((left, right, up, down))
    return list(np.frombuffer(allowed, np.int8).reshape(len(cells), len(Action)))


def choose_in_turn(
    scores: NDArray[np.floating], cells: NDArray[np.integer], grid_size: int
) -> tuple[Ints, Flags]:
    """Let the drones of each swarm choose in turn, so that none collide.

    Each drone takes its best-scored action among those allowed: no move off the grid, into
    another drone's cell, or into a cell that a drone before it is about to enter. Searching
    and idling are always allowed.

    With logits plus Gumbel noise as scores, the choices are samples of the softmax over the
    allowed actions (E. J. Gumbel, Statistical theory of extreme values and some practical
    applications, 1954).

    Scores are (swarms, n, 6), or (swarms, n, 5) if drones never idle; cells are (swarms, n).
    Returns the actions, int64, and which ones each drone was allowed at its turn, bool.
    """
    swarms = np.arange(len(cells))
    targets = Grid.of(grid_size).targets[cells, : scores.shape[-1]]
    closed = _closed(cells, grid_size)
    actions = np.empty(cells.shape, np.int64)
    masks = targets == cells[..., None]
    for drone in range(cells.shape[1]):
        ahead = targets[:, drone]
        masks[:, drone] |= ~closed[swarms[:, None], ahead]
        chosen = np.where(masks[:, drone], scores[:, drone], -np.inf).argmax(axis=1)
        actions[:, drone] = chosen
        closed[swarms, ahead[swarms, chosen]] = True
    return actions, masks


def _closed(cells: NDArray[np.integer], grid_size: int) -> Flags:
    """The cells that no drone may enter, bool, (swarms, cells + 1); the last one is `OFF_GRID`."""
    closed = np.zeros((len(cells), grid_size**2 + 1), np.bool_)
    closed[:, OFF_GRID] = True
    closed[np.arange(len(cells))[:, None], cells] = True
    return closed
