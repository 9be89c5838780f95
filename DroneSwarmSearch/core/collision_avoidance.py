"""Collision avoidance: actions that keep drones on the grid and out of each other's cells.

Masks are for drones that choose independently, see `action_masks`. Drones that choose one after
the other know where those before them will be, see `choose_in_turn`. Drones that have all chosen
their next cells already give way to each other, see `resolve_conflicts`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.arrays import Flags, Floats, Ints
from DroneSwarmSearch.core.grid import MOVES, OFF_GRID, Cell, CellTable, Grid
from DroneSwarmSearch.core.rules import CRASHES, END, PASS, Action

ACTION_OF: dict[Cell, Action] = {(0, 0): Action.IDLE, **dict(zip(MOVES, Action, strict=False))}
"""The action that moves a drone by (x, y)."""

# Masks.


def action_masks(
    cells: ArrayLike,
    grid_size: int,
    right_of_way: bool = False,
    *,
    crash: str = END,
    heard: Flags | None = None,
) -> Flags:
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
        crash: see `Scenario`. With "pass", only moves off the grid are masked: there is no right of
            way to keep.
        heard: which drone hears which, bool, (..., n, n), indexed [listener, heard], as in
            `SearchBatch.heard`: drones know nothing of others out of range, so they may collide
            with them. By default, all hear each other.

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
    checks.choice("crash", crash, CRASHES)
    if crash == PASS:
        masks: Flags = Grid.of(size).targets.take(checked, axis=0) != OFF_GRID
        return masks
    n = checked.shape[-1]
    by_swarm = checked.reshape(math.prod(checked.shape[:-1]), n)
    if heard is not None:
        by_listener = np.asarray(heard).reshape(len(by_swarm), n, n)
        return _masks_by_radio(by_swarm, size, right_of_way, by_listener).reshape(
            *checked.shape, len(Action)
        )
    closed = _closed(by_swarm, grid_size)
    ahead = Grid.of(size).targets.take(by_swarm, axis=0)  # (swarms, n, 6)
    masks = ahead == by_swarm[..., None]
    # Flat indices are faster than two axes; `OFF_GRID` is the last cell.
    flat = closed.reshape(-1)
    swarm_begins = np.arange(0, closed.size, closed.shape[1])[:, None, None]
    indices = (ahead % closed.shape[1] + swarm_begins).swapaxes(0, 1).copy()  # (n, swarms, 6)
    for drone in range(n):
        masks[:, drone] |= ~flat.take(indices[drone])
        if right_of_way:
            flat[indices[drone]] = True
    return masks.reshape(*checked.shape, len(Action))


def _masks_by_radio(cells: Ints, grid_size: int, right_of_way: bool, heard: Flags) -> Flags:
    """`action_masks` of drones that know only of those in range; cells are (swarms, n)."""
    ahead = Grid.of(grid_size).targets.take(cells, axis=0)  # (swarms, n, 6)
    n = cells.shape[1]
    closed = ahead == OFF_GRID
    for other in range(n):
        taken = ahead == cells[:, None, other, None]
        if right_of_way:
            # from the other drone to those after it
            may_be = (ahead[..., None] == ahead[:, None, other, None]).any(axis=-1)
            taken[:, other + 1 :] |= may_be[:, other + 1 :]
        closed |= taken & heard[:, :, other, None]
    masks: Flags = ~closed | (ahead == cells[..., None])
    return masks


def swarm_masks(
    cells: list[int], neighbours: CellTable[tuple[int, ...]], right_of_way: bool, crash: str
) -> list[NDArray[np.int8]]:
    """`action_masks` for a single swarm: each drone's mask, int8, shape (6,); new arrays.

    Of drones that all hear each other.
    """
    if crash == PASS:
        return [
            np.array([target != OFF_GRID for target in neighbours[cell]], np.int8) for cell in cells
        ]
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


# Choices in turn.


def choose_in_turn(
    scores: NDArray[np.floating],
    cells: NDArray[np.integer],
    grid_size: int,
    crash: str = END,
) -> tuple[Ints, Flags]:
    """Let the drones of each swarm choose in turn, so that none collide.

    Each drone takes its best-scored action among those allowed: no move off the grid, into
    another drone's cell, or into a cell that a drone before it is about to enter. Searching
    and idling are always allowed.

    With logits plus Gumbel noise as scores, the choices are samples of the softmax over the
    allowed actions (E. J. Gumbel, Statistical theory of extreme values and some practical
    applications, 1954).

    If drones pass each other (`crash` is "pass"), only moves off the grid are not allowed.

    Scores are (swarms, n, 6), or (swarms, n, 5) if drones never idle; cells are (swarms, n).
    Returns the actions, int64, and which ones each drone was allowed at its turn, bool.
    """
    swarms = np.arange(len(cells))
    targets = Grid.of(grid_size).targets[cells, : scores.shape[-1]]
    closed = _closed(cells if crash != PASS else cells[:, :0], grid_size)
    actions = np.empty(cells.shape, np.int64)
    masks = targets == cells[..., None]
    for drone in range(cells.shape[1]):
        ahead = targets[:, drone]
        masks[:, drone] |= ~closed[swarms[:, None], ahead]
        chosen = np.where(masks[:, drone], scores[:, drone], -np.inf).argmax(axis=1)
        actions[:, drone] = chosen
        if crash != PASS:
            closed[swarms, ahead[swarms, chosen]] = True
    return actions, masks


def approach_in_turn(
    cells: list[Cell],
    targets: Iterable[tuple[int, Cell]],
    probability: Floats,
    crash: str = END,
) -> list[Action]:
    """Let the drones of one swarm approach their targets in turn, so that none collide.

    A drone on its target searches. Any other takes the move towards its target that leads
    through the likelier cell, or idles if no such move is free.

    Args:
        cells: every drone's (x, y).
        targets: drones by number, each with its target (x, y), in the order of their turns.
        probability: of each cell, float64, shape (N, N), indexed [y, x].
        crash: with "pass", drones may share cells.
    """
    closed = set() if crash == PASS else set(cells)
    actions = [Action.IDLE] * len(cells)
    for drone, target in targets:
        x, y = cells[drone]
        to_x = target[0] - x
        to_y = target[1] - y
        nearer = [
            # In a tie the longer leg comes first, which keeps both directions open.
            ((probability[y + dy, x + dx], abs(to_x * dx + to_y * dy)), action, (x + dx, y + dy))
            for (dx, dy), action in ACTION_OF.items()
            if to_x * dx + to_y * dy > 0 and (x + dx, y + dy) not in closed
        ]
        if cells[drone] == target:
            actions[drone] = Action.SEARCH
        elif nearer:
            _, actions[drone], ahead = max(nearer, key=lambda option: option[0])
            if crash != PASS:
                closed.add(ahead)
    return actions


def _closed(cells: NDArray[np.integer], grid_size: int) -> Flags:
    """The cells that no drone may enter, bool, (swarms, cells + 1); the last one is `OFF_GRID`."""
    closed = np.zeros((len(cells), grid_size**2 + 1), np.bool_)
    closed[:, OFF_GRID] = True
    closed[np.arange(len(cells))[:, None], cells] = True
    return closed


# Conflicts.


def resolve_conflicts(cells: Sequence[Cell], wanted: Sequence[Cell]) -> list[Cell]:
    """Every drone's next cell, the wanted or the current one; all different, as the current are.

    Drones that exchange cells or rotate in a ring always move; if one of them gave way, they would
    block each other forever. Of other drones that want the same cell, the first moves. A drone
    stays if another drone stays in the cell that it wants; drones may follow one another.
    """
    rings = _in_rings(cells, wanted)
    order = [*rings, *(drone for drone in range(len(cells)) if drone not in rings)]
    nexts = list(wanted)
    changed = True
    while changed:  # ends, since a drone that is stopped stays stopped
        changed = False
        taken = {cell: drone for drone, cell in enumerate(cells) if nexts[drone] == cell}
        for drone in order:
            if taken.setdefault(nexts[drone], drone) != drone:
                nexts[drone] = cells[drone]
                changed = True
    return nexts


def _in_rings(cells: Sequence[Cell], wanted: Sequence[Cell]) -> set[int]:
    """The drones in rings, in which each drone wants the cell of the next."""
    occupant = {cell: drone for drone, cell in enumerate(cells)}
    follows = {
        drone: occupant[cell]
        for drone, cell in enumerate(wanted)
        if cell in occupant and cell != cells[drone]
    }
    rings: set[int] = set()
    for drone in follows:
        trail = [drone]
        here = follows.get(drone)
        while here is not None and here not in trail:
            trail.append(here)
            here = follows.get(here)
        if here == drone:
            rings.update(trail)
    return rings
