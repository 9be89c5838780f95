"""Shared by the tests of planning: searches small enough for brute force, and paths in them."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache, lru_cache
from typing import Any

import hypothesis.strategies as st
import numpy as np
from branch_and_bound import best_success
from helpers import inside, target_of

from DroneSwarmSearch import Action, Scenario
from DroneSwarmSearch.drift import ProbabilityMatrix
from DroneSwarmSearch.evaluation import NamedSearch
from DroneSwarmSearch.paths.joint_plan import JointPlan
from DroneSwarmSearch.paths.passes import Target
from DroneSwarmSearch.persons import Drift, Person
from DroneSwarmSearch.planning import DronePath
from DroneSwarmSearch.policies import BeliefTracker, SwarmPolicy

Cell = tuple[int, int]


def search(drones: Sequence[Cell], **parameters: Any) -> NamedSearch:
    """A search with drones that start in some cells."""
    scenario = Scenario(n_drones=len(drones), **parameters)
    return NamedSearch("small", "For tests.", scenario, tuple(drones))


@st.composite
def uncertain_persons(draw: st.DrawFn, size: int) -> Person:
    """A person with one to three hypotheses: known cells, uncertain ones, adrift, arrays."""
    drifts = []
    for _ in range(draw(st.integers(1, 3))):
        speed = st.sampled_from([0.0, 0.3, -0.5, 1.0, -2.5])
        kind = draw(st.sampled_from(["cell", "uncertain", "adrift", "array"]))
        start: Any = draw(st.integers(0, size - 1)), draw(st.integers(0, size - 1))
        more: dict[str, Any] = {}
        if kind == "uncertain":
            more = {"start_sd": (0.7, 0.0), "vector_sd": 0.1}
        elif kind == "adrift":
            more = {"adrift": 3, "vector_sd": (0.2, 0.0)}
        elif kind == "array":
            start = np.eye(size)
        drifts.append(
            Drift(
                start,
                vector=(draw(speed), draw(speed)),
                diffusion=draw(st.sampled_from([0.0, 0.06, 0.44, 2 / 3])),
                weight=draw(st.sampled_from([1.0, 2.5])),
                **more,
            )
        )
    return Person(drifts, draw(st.sampled_from([1.0, 0.6, 0.3, 0.0])))


@st.composite
def parameters(draw: st.DrawFn, most_cells: int = 8, most_drones: int = 3) -> dict[str, Any]:
    """The parameters of any search, with persons in known cells or uncertain ones."""
    size = draw(st.integers(2, most_cells))
    common = {
        "grid_size": size,
        "n_drones": draw(st.integers(1, min(most_drones, size**2))),
        "timestep_limit": draw(st.integers(1, 40)),
        "bayesian_update": draw(st.booleans()),
    }
    if draw(st.booleans()):
        persons = st.lists(uncertain_persons(size), min_size=1, max_size=3)
        mission = st.sampled_from(["rescue", "rescue", "coverage"])
        return {**common, "persons": draw(persons), "mission": draw(mission)}
    cells = st.tuples(st.integers(0, size - 1), st.integers(0, size - 1))
    starts = draw(st.lists(cells, min_size=1, max_size=3))
    detection = st.sampled_from([1.0, 1.0, 0.6, 0.2, 0.0])
    drift = st.sampled_from([0.0, 0.3, -0.5, 1.0, -2.0])
    return {
        **common,
        "vector": (draw(drift), draw(drift)),
        "person_initial_position": starts,
        "disperse_constant": draw(st.sampled_from([0.0, 1.0, 10.0, 1000.0])),
        "probability_of_detection": draw(detection | st.tuples(*[detection for _ in starts])),
    }


def known(
    grid_size: int, drones: Sequence[Cell], start: Cell, vector: tuple[float, float],
    constant: float, steps: int, detection: float,
) -> NamedSearch:  # fmt: skip
    """A search for a person at a known cell."""
    return search(
        drones, grid_size=grid_size, person_initial_position=start, vector=vector,
        disperse_constant=constant, timestep_limit=steps, probability_of_detection=detection,
    )  # fmt: skip


def uncertain(grid_size, drones, steps, detection, *drifts):
    person = Person(drifts, detection)
    return search(drones, grid_size=grid_size, timestep_limit=steps, persons=person)


CORNER = [[0, 0, 0, 3], [0, 0, 2, 0], [1, 0, 0, 0], [0, 0, 0, 0]]
ADRIFT = {"start_sd": (0.6, 0.4), "vector": (0.2, 0.1), "vector_sd": 0.05, "diffusion": 0.1}

SMALL = [
    known(5, [(0, 0)], (2, 2), (0, 0), 10, 10, 1.0),
    known(5, [(0, 0)], (3, 2), (0.3, -0.2), 2, 10, 0.6),
    known(6, [(5, 5)], (1, 1), (0.7, 0.4), 5, 10, 0.3),
    known(6, [(2, 0)], (3, 3), (-0.4, 0.1), 30, 10, 1.0),
    known(4, [(3, 0)], (0, 3), (0.25, -0.6), 1, 10, 0.6),
    known(7, [(1, 5)], (5, 3), (-1.5, 0.2), 3, 10, 0.6),
    known(4, [(0, 0), (3, 3)], (1, 2), (0.2, 0.1), 10, 6, 1.0),
    known(5, [(4, 0), (0, 4)], (2, 2), (0.5, 0.5), 20, 6, 0.3),
    known(3, [(0, 0), (1, 0)], (1, 1), (0, 0), 10, 6, 0.6),
    known(4, [(3, 0), (3, 1)], (0, 1), (0.6, 0.3), 3, 6, 1.0),
    uncertain(  # left and right of the wind, from one cell
        5, [(0, 0)], 10, 0.7,
        Drift((2, 1), vector=(-0.3, 0.4), vector_sd=0.2, diffusion=0.1, weight=2),
        Drift((2, 1), vector=(0.4, 0.3), vector_sd=0.1, diffusion=0.3),
    ),
    uncertain(  # two last known positions
        5, [(2, 4)], 10, 1.0,
        Drift((0, 1), diffusion=0.1), Drift((4, 2), vector=(0, 0.1), weight=1.5),
    ),
    # An uncertain start, some steps adrift.
    uncertain(4, [(3, 3)], 8, 0.8, Drift((0.6, 1.2), adrift=3, **ADRIFT)),
    uncertain(  # an array beside a known cell
        4, [(0, 0), (3, 3)], 5, 0.6,
        Drift(CORNER, vector=(-0.1, 0.3), diffusion=0.2),
        Drift((2, 2), vector=(0.7, -0.5), diffusion=0.05, weight=0.5),
    ),
]  # fmt: skip
"""Searches for one person that branch and bound solves at once."""


@cache
def best(index: int, steps: int | None = None) -> float:
    """The optimal probability of success of a search of `SMALL`, perhaps in fewer steps."""
    return best_success(shortened(SMALL[index], steps))


def shortened(of: NamedSearch, steps: int | None) -> NamedSearch:
    """The same search with a lower time limit."""
    scenario = of.scenario
    return replace(of, scenario=scenario.replace(timestep_limit=steps or scenario.timestep_limit))


def forecast_of(of: NamedSearch, person: int = 0) -> ProbabilityMatrix:
    return of.scenario.forecasts()[person]


def targets_of(of, tracker=None, worth=None):
    """The missing persons, from the current step to the last one; a find is worth 1 by default."""
    tracker = tracker or BeliefTracker(of.scenario)
    return [
        Target(
            forecast_of(of, person),
            of.scenario.detections[person],
            tracker.joint(person),
            np.ones(of.scenario.timestep_limit - tracker.step) if worth is None else worth,
        )
        for person in tracker.missing
    ]


def success_of(of, paths, tracker=None):
    """The probability that drones on some paths find each missing person."""
    first = 0 if tracker is None else tracker.step
    return [
        float(found.sum()) for found in JointPlan(targets_of(of, tracker), first, paths).found()
    ]


def observations(cells: Sequence[Cell], matrix: np.ndarray) -> dict[str, Any]:
    """The observations of drones in some cells."""
    return {f"drone{i}": {"observation": (cell, matrix)} for i, cell in enumerate(cells)}


def fly(policy, tracker, cells, steps):
    """Return the drones' paths over the next steps without a find, and update the tracker.

    Checks that every step is legal.
    """
    size = tracker.scenario.grid_size
    positions = [list(cells)]
    searches = []
    for _ in range(steps):
        here = positions[-1]
        actions = list(policy(observations(here, tracker.matrix())).values())
        tracker.update(here, actions)
        ahead = [target_of(cell, action) for cell, action in zip(here, actions, strict=True)]
        assert all(inside(cell, size) for cell in ahead), "a drone has left the grid"
        assert len({*ahead}) == len(ahead), "drones have collided"
        positions.append(ahead)
        searches.append([action == Action.SEARCH for action in actions])
    numbers = np.array(positions) @ [1, size]
    return [DronePath(*path) for path in zip(numbers.T, np.array(searches).T, strict=True)]


def paths_of(policy: SwarmPolicy, of: NamedSearch) -> list[DronePath]:
    """Return the paths of a policy's drones in an episode without a find."""
    return fly(policy, BeliefTracker(of.scenario), of.drones, of.scenario.timestep_limit)


def found_in_each_step(forecast, detection, schedule):
    """The probability that the searches of each step's cells find a person, by every trajectory."""
    cells, left = all_trajectories(forecast, len(schedule))
    found = []
    for step, searched in enumerate(schedule):
        after = left
        for cell in searched:
            after = np.where(cells[:, step] == cell, (1 - detection) * after, after)
        found.append(float((left - after).sum()))
        left = after
    return found


@lru_cache(maxsize=4)
def all_trajectories(forecast: ProbabilityMatrix, steps: int) -> tuple[np.ndarray, np.ndarray]:
    """Every trajectory's cells, y * N + x: shape (K, steps); and its probability: shape (K,)."""
    size = forecast.grid_size
    moves = [forecast.moves(step) for step in range(steps)]
    paths = []
    probabilities = []

    def follow(hypothesis: int, path: tuple[int, ...], probability: float) -> None:
        if len(path) == steps:
            paths.append(path)
            probabilities.append(probability)
            return
        y, x = divmod(path[-1], size)
        right, left, down, up = (chances[hypothesis] for chances in moves[len(path) - 1])
        for dx, along_x in ((1, right[x]), (-1, left[x]), (0, 1 - right[x] - left[x])):
            for dy, along_y in ((1, down[y]), (-1, up[y]), (0, 1 - down[y] - up[y])):
                if along_x * along_y > 0:
                    ahead = path[-1] + dy * size + dx
                    follow(hypothesis, (*path, ahead), probability * along_x * along_y)

    joint = forecast.joint(0).reshape(-1, size**2)
    for hypothesis, cell in np.argwhere(joint).tolist():
        follow(hypothesis, (cell,), joint[hypothesis, cell])
    return np.array(paths), np.array(probabilities)


def schedule_of(paths: Sequence[DronePath]) -> list[list[int]]:
    """The cells that some paths search in each step."""
    return [
        [int(path.cells[step]) for path in paths if path.searches[step]]
        for step in range(len(paths[0].searches))
    ]


def assert_legal(paths: Sequence[DronePath], starts: Sequence[int], size: int) -> None:
    """Check the start cells, single-cell moves, searches without moves, and distinct cells."""
    assert [path.cells[0] for path in paths] == list(starts)
    cells = np.array([path.cells for path in paths])
    assert ((cells >= 0) & (cells < size**2)).all()
    y, x = np.divmod(cells, size)
    moved = abs(np.diff(x)) + abs(np.diff(y))
    assert (moved <= 1).all()
    assert not moved[np.array([path.searches for path in paths])].any()
    assert all(len({*column}) == len(column) for column in cells.T.tolist())
