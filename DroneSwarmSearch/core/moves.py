"""Where actions lead the drones of one search, and which cells they search in the step."""

from __future__ import annotations

from collections.abc import Sequence

from DroneSwarmSearch.core.grid import Grid
from DroneSwarmSearch.core.rules import Action, arrivals
from DroneSwarmSearch.core.scenario import Scenario


def moved(scenario: Scenario, cells: Sequence[int], actions: Sequence[int]) -> list[int]:
    """The drones' cells, y * N + x, after a step; `cells` are those before it."""
    neighbours = Grid.of(scenario.grid_size).neighbours
    targets = [neighbours[cell][action] for cell, action in zip(cells, actions, strict=True)]
    return arrivals(cells, targets, scenario.crash)


def searched(scenario: Scenario, cells: Sequence[int], actions: Sequence[int]) -> list[int]:
    """The cells that the drones search in a step; `cells` are those after it."""
    if scenario.search_in_flight:
        return list(cells)
    pairs = zip(cells, actions, strict=True)
    return [cell for cell, action in pairs if action == Action.SEARCH]
