"""Conflict resolution: which drones may move so that no two end up in one cell."""

from __future__ import annotations

from collections.abc import Sequence

from DroneSwarmSearch.core.grid import MOVES, Cell
from DroneSwarmSearch.core.rules import Action

ACTION_OF: dict[Cell, Action] = {(0, 0): Action.IDLE, **dict(zip(MOVES, Action, strict=False))}
"""The action that moves a drone by (x, y)."""


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
