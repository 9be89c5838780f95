"""A batch beside single environments that play the same searches: shared by tests."""

import random
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from batches import AXES, CONSTANT, DRONES, NAN, PERSON, POD
from helpers import (
    INTENTS,
    SCHEMES,
    inside,
    plain,
    planned_actions,
    target_of,
    without_history,
)

from DroneSwarmSearch import DroneSwarmSearch
from DroneSwarmSearch.core import Frame
from DroneSwarmSearch.vector import SearchBatch, beliefs


def of_row(parameters: Mapping[str, Any], row: int) -> dict[str, Any]:
    """The parameters of one row, as the single environment takes them."""
    own = dict(parameters)
    for name, axes in AXES.items():
        if own.get(name) is not None:
            array = np.asarray(own[name])
            own[name] = (array[row % len(array)] if array.ndim > axes else array).tolist()
    return own


class Twins:
    """A batch, and for each row the single environment that it must reproduce."""

    def __init__(self, rows: int, parameters: Mapping[str, Any]) -> None:
        self.batch = SearchBatch(rows, **parameters)
        self.parameters = [of_row(parameters, row) for row in range(rows)]
        self.drones = [parameters_of.pop(DRONES, None) for parameters_of in self.parameters]
        self.situations = parameters.get("situations")
        for parameters_of in self.parameters:
            parameters_of.pop("situation", None)
            if parameters_of.pop("situations", None) is not None:
                parameters_of["persons"] = self.situations[0]
        self.envs = [DroneSwarmSearch(**parameters_of) for parameters_of in self.parameters]
        self.names = self.envs[0].possible_agents
        self.rewards = np.zeros((rows, len(self.names)))
        self.seeds: list[int | None] = [None] * rows
        self.episodes = [0] * rows
        self.frames: list[Frame] = []
        self.compared = 0

    def reset(self, seeds=None, rows=None, given=None):
        which = range(len(self.envs)) if rows is None else rows
        self.batch.reset(seeds, None if rows is None else np.array(rows), **(given or {}))
        self.situations = (given or {}).get("situations", self.situations)
        for k, row in enumerate(which):
            self._begin(row, None if seeds is None else seeds[k], of_row(given or {}, row))
            self.rewards[row] = 0.0
        self.compare()

    def _begin(self, row: int, seed: int | None, given: Mapping[str, Any]) -> None:
        self.seeds[row] = self.seeds[row] if seed is None else seed
        self.episodes[row] = 0 if seed is not None else self.episodes[row] + 1
        options = {DRONES: self.drones[row], **given}
        options.pop("situations", None)
        if self.situations is not None:
            number = self.batch.situation[row]
            assert number == options.pop("situation", number)
            options["persons"] = self.situations[number]
        self.envs[row].reset(seed=seed, options=options)

    def step(self, actions: Any) -> None:
        ended = self.batch.ended.tolist()
        self.batch.step(actions)
        for row, env in enumerate(self.envs):
            if ended[row]:
                self._begin(row, None, {})
                self.rewards[row] = 0.0
            else:
                rewards = env.step(dict(zip(self.names, actions[row], strict=True)))[1]
                self.rewards[row] = [rewards[name] for name in self.names]
        self.compare()

    def compare(self) -> None:
        batch = self.batch
        size = self.envs[0].grid_size
        self.frames = frames = [env.frame() for env in self.envs]
        every = np.arange(len(frames))
        expected = np.stack([frame.matrix for frame in frames])
        matrices = np.full_like(expected, NAN)
        batch.write_matrices(matrices)
        assert matrices.tobytes() == expected.tobytes()
        for rows in (every, every[self.compared % 2 :: 2]):
            assert batch.matrices_of(rows).tobytes() == expected[rows].tobytes()
        assert batch.rewards.tobytes() == self.rewards.tobytes()
        endings = [frame.ending for frame in frames]
        assert batch.endings.tolist() == [ending or 0 for ending in endings]
        assert batch.ended.tolist() == [ending is not None for ending in endings]
        drones = [[list(cell) for cell in frame.drones] for frame in frames]
        assert batch.positions.tolist() == drones
        assert batch.cells.tolist() == [[y * size + x for x, y in cells] for cells in drones]
        missing = batch.missing
        if self.envs[0].scenario.mission == "coverage":
            assert missing.all()
        else:
            assert missing.tolist() == [[not f for f in frame.found] for frame in frames]
            persons = [[y * size + x for x, y in frame.persons] for frame in frames]
            assert (batch.person_cells == persons)[missing].all()
        success = [frame.probability_of_success for frame in frames]
        shown = batch.probability_of_success
        assert success == ([None] * len(frames) if shown is None else shown.tolist())
        assert batch.found.tolist() == [any(frame.found) for frame in frames]
        assert batch.searching.tolist() == [list(frame.searching) for frame in frames]
        assert batch.steps.tolist() == [frame.step for frame in frames]
        row = self.compared % len(frames)
        assert plain(vars(batch.frame(row))) == without_history(frames[row])
        own = np.stack([env.snapshot().matrices[: batch.observers] for env in self.envs])
        assert batch.matrices_by_drone().tobytes() == own.tobytes()
        assert batch.matrices_by_drone([row]).tobytes() == own[row].tobytes()
        if self.envs[0].scenario.radio_range is not None:
            self._compare_radio(row)
        assert batch.state_planes()[row].tobytes() == self.envs[row].state().tobytes()
        self.compared += 1

    def _compare_radio(self, row: int) -> None:
        batch = self.batch
        moments = [env.snapshot() for env in self.envs]
        assert batch.heard.tolist() == [moment.heard.tolist() for moment in moments]
        assert batch.last_heard.cells.tolist() == [
            moment.last_heard.cells.tolist() for moment in moments
        ]
        assert batch.last_heard.ages.tolist() == [
            moment.last_heard.ages.tolist() for moment in moments
        ]
        drone = self.compared % len(self.names)
        expected = without_history(self.envs[row].frame(drone))
        assert plain(vars(batch.frame(row, drone))) == expected


def random_actions(rng: random.Random, twins: Twins) -> list[list[int]]:
    """Random actions, mostly searches and moves that stay on the grid."""
    size = twins.envs[0].grid_size
    chosen = []
    for frame in twins.frames:
        actions = [rng.choice([4, 4, 4, 5, rng.randrange(4)]) for _ in frame.drones]
        chosen.append(
            [
                action if inside(target_of(cell, action), size) or rng.random() < 0.1 else 5
                for cell, action in zip(frame.drones, actions, strict=True)
            ]
        )
    return chosen


@dataclass(frozen=True)
class Case:
    """A batch's parameters, how it computes, and what is done with it."""

    rows: int
    parameters: dict[str, Any]
    tile_rows: int
    plans: list[list[int]]
    seed: int
    steps: int
    resets: float  # the probability of a reset after a step


def random_drones(rng: random.Random, rows: int, size: int, n: int) -> Any:
    """Start cells for all rows, or an array with those of each."""
    cells = [(x, y) for x in range(size) for y in range(size)]
    if rng.random() < 0.7:
        return rng.sample(cells, n)
    return np.array([rng.sample(cells, n) for _ in range(rows)])


def random_case(rng: random.Random) -> Case:
    size = rng.randint(2, 7)
    rows = rng.randint(1, 6)
    n = rng.randint(1, min(5, size**2))
    persons = rng.randint(1, 3)
    detections = [1.0, 1.0, 0.6, 0.2, 0.0]
    each = tuple(rng.choice(detections) for _ in range(persons))
    drifts = [0.0, -0.0, 0.3, -0.5, 1.0, -2.5]
    pool = [(rng.randrange(size), rng.randrange(size)) for _ in range(2)]  # some start together
    parameters = {
        "grid_size": size,
        "n_drones": n,
        "vector": [rng.choice(drifts), rng.choice(drifts)],
        PERSON: [rng.choice(pool) for _ in range(persons)],
        CONSTANT: rng.choice([0, 1.0, 10, 1000.0]),
        "timestep_limit": rng.randint(1, 25),
        POD: rng.choice([each[0], each]),
        "bayesian_update": rng.random() < 0.5,
        "reward_scheme": rng.choice(SCHEMES),
        "crash": rng.choice(["end", "end", "block", "pass"]),
        "radio_range": rng.choice([None, None, 0, 1.5, 3]),
        "search_in_flight": rng.random() < 0.25,
        DRONES: random_drones(rng, rows, size, n) if rng.random() < 0.6 else None,
    }
    return Case(
        rows,
        parameters,
        tile_rows=rng.choice([1, 2, 3, 256]),
        plans=[[rng.choice(INTENTS) for _ in range(rng.randint(1, 6))] for _ in range(n)],
        seed=rng.randrange(2**32),
        steps=rng.randint(4, 28),
        resets=rng.choice([0.0, 0.0, 0.15]),
    )


def planned(plans: list[list[int]], frame: Frame, turn: int, rng: random.Random) -> list[int]:
    """What the drones' plans come to in a step."""
    missing = [cell for cell, f in zip(frame.persons, frame.found, strict=True) if not f]
    actions = planned_actions(plans, turn, frame.drones, missing, frame.grid_size, rng)
    return list(map(int, actions))


def use_tiles(patch: pytest.MonkeyPatch, case: Case) -> None:
    """Divide the beliefs into the tiles of a case, however small."""
    patch.setattr(beliefs, "_LEAST_COLUMNS", 1)
    patch.setattr(beliefs, "_MOST_COLUMNS", case.tile_rows)


def play(twins: Twins, steps: int, seed: int = 0) -> None:
    rng = random.Random(seed)
    for _ in range(steps):
        twins.step(np.array(random_actions(rng, twins)))
