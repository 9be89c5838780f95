"""What the tests of planning share: searches small enough for brute force, and flights in them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
from helpers import inside, target_of

from DroneSwarmSearch import Action, Scenario
from DroneSwarmSearch.drift import ProbabilityMatrix
from DroneSwarmSearch.evaluation import NamedSearch
from DroneSwarmSearch.planning.chain import Chain
from DroneSwarmSearch.planning.exact import best_success
from DroneSwarmSearch.planning.paths import Path
from DroneSwarmSearch.planning.plan import Plan, Target
from DroneSwarmSearch.policies import Knowledge, SwarmPolicy

Cell = tuple[int, int]


def search(drones: Sequence[Cell], **parameters: Any) -> NamedSearch:
    """A search with drones that start in some cells."""
    scenario = Scenario(n_drones=len(drones), **parameters)
    return NamedSearch("small", "For tests.", scenario, tuple(drones))


def a_small_search(
    grid_size: int,
    drones: Sequence[Cell],
    person: Cell,
    vector: tuple[float, float],
    constant: float,
    steps: int,
    detection: float,
) -> NamedSearch:
    return search(
        drones,
        grid_size=grid_size,
        person_initial_position=person,
        vector=vector,
        disperse_constant=constant,
        timestep_limit=steps,
        probability_of_detection=detection,
    )


SMALL = [
    a_small_search(5, [(0, 0)], (2, 2), (0, 0), 10, 10, 1.0),
    a_small_search(5, [(0, 0)], (3, 2), (0.3, -0.2), 2, 10, 0.6),
    a_small_search(6, [(5, 5)], (1, 1), (0.7, 0.4), 5, 10, 0.3),
    a_small_search(6, [(2, 0)], (3, 3), (-0.4, 0.1), 30, 10, 1.0),
    a_small_search(4, [(3, 0)], (0, 3), (0.25, -0.6), 1, 10, 0.6),
    a_small_search(7, [(1, 5)], (5, 3), (-1.5, 0.2), 3, 10, 0.6),
    a_small_search(4, [(0, 0), (3, 3)], (1, 2), (0.2, 0.1), 10, 6, 1.0),
    a_small_search(5, [(4, 0), (0, 4)], (2, 2), (0.5, 0.5), 20, 6, 0.3),
    a_small_search(3, [(0, 0), (1, 0)], (1, 1), (0, 0), 10, 6, 0.6),
    a_small_search(4, [(3, 0), (3, 1)], (0, 1), (0.6, 0.3), 3, 6, 1.0),
]
"""Searches for one person, of which branch and bound finds the best plan in no time."""


@cache
def best(index: int, steps: int | None = None) -> float:
    """The chance of the best plan for a search of `SMALL`, perhaps in fewer steps."""
    of = SMALL[index]
    return best_success(shortened(of, steps).scenario, of.drones)


def shortened(of: NamedSearch, steps: int | None) -> NamedSearch:
    """The same search with an earlier end."""
    scenario = of.scenario
    return replace(of, scenario=scenario.replace(timestep_limit=steps or scenario.timestep_limit))


def forecast_of(of: NamedSearch, person: int = 0) -> ProbabilityMatrix:
    scenario = of.scenario
    return ProbabilityMatrix(
        scenario.grid_size,
        scenario.person_initial_position[person],
        scenario.vector,
        scenario.disperse_constant,
    )


def targets_of(of: NamedSearch, knowledge: Knowledge | None = None) -> list[Target]:
    """The persons who are missing, from the present step to the last one."""
    known = Knowledge(of.scenario) if knowledge is None else knowledge
    end, detections = of.scenario.timestep_limit, of.scenario.detections
    return [
        Target(
            Chain(forecast_of(of, person), detections[person], known.step, end),
            known.belief(person),
        )
        for person in known.missing
    ]


def chances(
    of: NamedSearch, paths: Sequence[Path], knowledge: Knowledge | None = None
) -> list[float]:
    """The chance that each missing person is found by drones that fly some paths."""
    first = 0 if knowledge is None else knowledge.step
    worth = np.ones(of.scenario.timestep_limit - first)
    return Plan(targets_of(of, knowledge), worth, first, paths).chances()


def observations(cells: Sequence[Cell], matrix: np.ndarray) -> dict[str, Any]:
    """What drones in some cells are shown."""
    return {f"drone{i}": {"observation": (cell, matrix)} for i, cell in enumerate(cells)}


def fly(policy: SwarmPolicy, knowledge: Knowledge, cells: Sequence[Cell], steps: int) -> list[Path]:
    """The paths on which a policy leads the drones while nobody is found; checks each step.

    Args:
        policy: as it is in the present step.
        knowledge: what is known in that step; taken on with the steps.
        cells: every drone's.
        steps: how many.
    """
    size = knowledge.scenario.grid_size
    ways, searches = [list(cells)], []
    for _ in range(steps):
        here = ways[-1]
        actions = list(policy(observations(here, knowledge.shown())).values())
        knowledge.acted(here, actions)
        there = [target_of(cell, action) for cell, action in zip(here, actions, strict=True)]
        assert all(inside(cell, size) for cell in there), "a drone has left the grid"
        assert len({*there}) == len(there), "drones have collided"
        ways.append(there)
        searches.append([action == Action.SEARCH for action in actions])
    numbers = np.array(ways) @ [1, size]
    return [
        Path(way, searched) for way, searched in zip(numbers.T, np.array(searches).T, strict=True)
    ]


def flown(policy: SwarmPolicy, of: NamedSearch) -> list[Path]:
    """The paths of a policy from the beginning to the end of an episode that finds nobody."""
    return fly(policy, Knowledge(of.scenario), of.drones, of.scenario.timestep_limit)


def found_in_each_step(
    forecast: ProbabilityMatrix, detection: float, schedule: Sequence[Sequence[int]]
) -> list[float]:
    """The chance that a person is found in each step, by following every way there is.

    Args:
        forecast: the person's.
        detection: the probability of detection.
        schedule: the cells searched in each step, y * N + x.
    """
    found = [0.0] * len(schedule)

    def follow(step: int, x: int, y: int, chance: float) -> None:
        if step == len(schedule):
            return
        left = chance
        for cell in schedule[step]:
            if cell == y * forecast.grid_size + x:
                left *= 1 - detection
        found[step] += chance - left
        right, left_x, down, up = forecast.moves(step)
        for dx, across in ((1, right[x]), (-1, left_x[x]), (0, 1 - right[x] - left_x[x])):
            for dy, along in ((1, down[y]), (-1, up[y]), (0, 1 - down[y] - up[y])):
                if left * across * along > 0:
                    follow(step + 1, x + dx, y + dy, left * across * along)

    follow(0, *forecast.parameters[1], 1.0)
    return found


def schedule_of(paths: Sequence[Path]) -> list[list[int]]:
    """The cells that are searched in each step of some paths."""
    return [
        [int(path.cells[step]) for path in paths if path.searches[step]]
        for step in range(len(paths[0].searches))
    ]


def assert_legal(paths: Sequence[Path], starts: Sequence[int], size: int) -> None:
    """Paths begin where they should, go step by step, search where they are, and never meet."""
    assert [path.cells[0] for path in paths] == list(starts)
    cells = np.array([path.cells for path in paths])
    assert ((cells >= 0) & (cells < size**2)).all()
    y, x = np.divmod(cells, size)
    gone = abs(np.diff(x)) + abs(np.diff(y))
    assert (gone <= 1).all()
    assert not gone[np.array([path.searches for path in paths])].any()
    assert all(len({*column}) == len(column) for column in cells.T.tolist())
