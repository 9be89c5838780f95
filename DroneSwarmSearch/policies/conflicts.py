"""How drones move, and right of way: who may go so that no two end up in one cell."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from DroneSwarmSearch.rules import Action
from DroneSwarmSearch.scenario import Cell

__all__ = ["MOVES", "resolve_conflicts"]

MOVES: dict[Cell, Action] = {
    (-1, 0): Action.LEFT,
    (1, 0): Action.RIGHT,
    (0, -1): Action.UP,
    (0, 1): Action.DOWN,
    (0, 0): Action.IDLE,
}
"""What brings a drone by (x, y) to another cell, without a search."""


def resolve_conflicts(
    cells: Sequence[Cell], wishes: Sequence[Cell], priority: Iterable[int] | None = None
) -> list[Cell]:
    """Where the drones go in a step.

    Drones that exchange cells, or pass them round a ring, always go: were one of them to
    give way to somebody from outside, all would block each other for ever. Of the others
    that want one cell the first goes and the rest stay, and whoever wants the cell of a
    drone that stays, stays too. Nothing else keeps a drone from going: drones may follow
    one another.

    Args:
        cells: every drone's cell, no two alike.
        wishes: the cell that each of them wants to be in next; its own to stay.
        priority: the drones by number, the first in right of way first; without it by
            number.

    Returns:
        Every drone's next cell, which is its wish or its own; no two alike.
    """
    order = range(len(cells)) if priority is None else list(priority)
    rings = _in_rings(cells, wishes)
    order = [*rings, *(drone for drone in order if drone not in rings)]
    nexts = list(wishes)
    changed = True
    while changed:  # whoever is stopped stays stopped, so this ends
        changed = False
        held = {cell: drone for drone, cell in enumerate(cells) if nexts[drone] == cell}
        for drone in order:
            if held.setdefault(nexts[drone], drone) != drone:
                nexts[drone] = cells[drone]
                changed = True
    return nexts


def _in_rings(cells: Sequence[Cell], wishes: Sequence[Cell]) -> set[int]:
    """The drones each of which wants the cell of the next, and the last that of the first."""
    holder = {cell: drone for drone, cell in enumerate(cells)}
    follows = {
        drone: holder[wish]
        for drone, wish in enumerate(wishes)
        if wish in holder and wish != cells[drone]
    }
    rings: set[int] = set()
    passed: set[int] = set()
    for drone in follows:
        trail: list[int] = []
        here: int | None = drone
        while here is not None and here not in passed:
            passed.add(here)
            trail.append(here)
            here = follows.get(here)
        if here in trail:
            rings.update(trail[trail.index(here) :])
    return rings
