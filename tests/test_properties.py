"""Random episodes against a slow and obvious model of the rules and of the mathematics."""

from __future__ import annotations

import random
from collections import Counter
from dataclasses import dataclass
from typing import Any

import hypothesis
import numpy as np
import pytest
from helpers import EVENTS, INTENTS, inside, planned_actions, target_of
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from DroneSwarmSearch import Action, DroneSwarmSearch, Ending
from DroneSwarmSearch.drift import ProbabilityMatrix

Cell = tuple[int, int]

# Episodes to try.


@dataclass(frozen=True)
class Episode:
    """An environment's parameters, the drones' start cells, their plans, and a seed."""

    parameters: dict[str, Any]
    drones: tuple[Cell, ...] | None
    plans: tuple[tuple[int, ...], ...]
    seed: int


@st.composite
def episodes(draw: st.DrawFn) -> Episode:
    grid_size = draw(st.integers(2, 6))
    cells = st.tuples(st.integers(0, grid_size - 1), st.integers(0, grid_size - 1))
    n_drones = draw(st.integers(1, 4))
    persons = draw(st.lists(cells, min_size=1, max_size=3))
    detection = st.sampled_from([1.0, 1.0, 0.6, 0.2, 0.0])
    drift = st.sampled_from([0.0, 0.0, 0.3, -0.5, 1.0, -2.5])
    parameters = {
        "grid_size": grid_size,
        "n_drones": n_drones,
        "person_initial_position": persons,
        "vector": (draw(drift), draw(drift)),
        "disperse_constant": draw(st.sampled_from([0.0, 1.0, 10.0, 1000.0])),
        "timestep_limit": draw(st.integers(1, 25)),
        "bayesian_update": draw(st.booleans()),
        "probability_of_detection": draw(detection | st.tuples(*[detection for _ in persons])),
    }
    all_cells = [(x, y) for y in range(grid_size) for x in range(grid_size)]
    positions = st.permutations(all_cells).map(lambda order: tuple(order[:n_drones]))
    plan = st.lists(st.sampled_from(INTENTS), min_size=1, max_size=8).map(tuple)
    return Episode(
        parameters,
        draw(st.none() | positions),
        tuple(draw(plan) for _ in range(n_drones)),
        draw(st.integers(0, 2**32)),
    )


# The model: the specification in plain Python, slow and obvious.


class Belief:
    """Where one person may be, by the forecast of the drift and Bayes' rule: a dict of cells."""

    def __init__(self, grid_size: int, start: Cell, vector: Any, constant: float) -> None:
        self.forecast = ProbabilityMatrix(grid_size, start, tuple(vector), constant)
        self.mass = {start: 1.0}

    def unsuccessful_searches(self, cells: list[Cell], detection: float) -> None:
        after = dict(self.mass)
        for cell in cells:
            if cell in after:
                after[cell] *= 1 - detection
        kept = sum(after.values())
        self.mass = {cell: chance / kept for cell, chance in after.items()}

    def drift(self, step: int) -> None:
        right, left, down, up = self.forecast.moves(step)
        after: Counter[Cell] = Counter()
        for (x, y), chance in self.mass.items():
            for dx, along_x in ((1, right[x]), (-1, left[x]), (0, 1 - right[x] - left[x])):
                for dy, along_y in ((1, down[y]), (-1, up[y]), (0, 1 - down[y] - up[y])):
                    if share := chance * along_x * along_y:
                        after[x + dx, y + dy] += share
        self.mass = dict(after)


class Model:
    """An episode, implemented independently from the specification."""

    def __init__(self, episode: Episode) -> None:
        self.parameters = episode.parameters
        self.size = self.parameters["grid_size"]
        self.limit = self.parameters["timestep_limit"]
        self.names = [f"drone{i}" for i in range(self.parameters["n_drones"])]
        self.t = 0
        self.drones = list(
            episode.drones or [divmod(i, self.size)[::-1] for i in range(len(self.names))]
        )
        persons = self.parameters["person_initial_position"]
        pod = self.parameters["probability_of_detection"]
        self.pod = pod if isinstance(pod, tuple) else (pod,) * len(persons)
        self.missing = set(range(len(persons)))
        self.beliefs = [
            Belief(self.size, cell, self.parameters["vector"], self.parameters["disperse_constant"])
            for cell in persons
        ]
        self.returns = [0.0] * len(self.names)
        self.successful: set[int] = set()  # drones that have found somebody
        self.ending: Ending | None = None
        self.events: set[str] = set()

    def step(
        self, actions: list[Action], shown: np.ndarray, persons: tuple[Cell, ...], found: set[int]
    ) -> list[float]:
        """Rewards of a step. `found` says whose search the chance let succeed."""
        before = self.drones
        targets = [target_of(cell, a) for cell, a in zip(before, actions, strict=True)]
        left = [not inside(target, self.size) for target in targets]
        collided = [
            not gone and targets.count(target) > 1
            for target, gone in zip(targets, left, strict=True)
        ]
        searches = [i for i, action in enumerate(actions) if action == Action.SEARCH]
        searched = [before[i] for i in searches]

        # Who is found: certain at a POD of 1, impossible at 0, else what chance says.
        in_reach = {k for k in self.missing if persons[k] in searched}
        assert found <= in_reach
        assert found >= {k for k in in_reach if self.pod[k] == 1}
        assert not [k for k in found if self.pod[k] == 0]
        finders = {i for i in searches if any(persons[k] == before[i] for k in found)}
        self.note(before, targets, left, collided, finders, found, in_reach, persons, searches)
        self.missing -= found

        time_limit_reached = self.t == self.limit - 1
        rewards = []
        for i, (x, y) in enumerate(before):
            p = float(shown[y, x])
            if collided[i] or left[i]:
                points = -100_000.0
            elif i in finders:
                points = 10_000 + 10_000 * (1 - self.t / self.limit)
            elif time_limit_reached and i not in self.successful:
                points = -self.returns[i] - 100_000
            elif i in searches:
                points = 10_000 * p if 100 * p > 1 else -100.0
                self.events.add(f"search of {'a likely' if 100 * p > 1 else 'an unlikely'} cell")
            else:
                points = 1.0
            rewards.append(points)
            self.returns[i] += points

        self.successful |= finders
        if not self.missing:
            self.ending = Ending.FOUND
        elif any(collided):
            self.ending = Ending.COLLISION
        elif any(left):
            self.ending = Ending.LEFT_GRID
        elif time_limit_reached:
            self.ending = Ending.TIME_LIMIT
        self.drones = [
            cell if gone else target
            for cell, target, gone in zip(before, targets, left, strict=True)
        ]
        for k, belief in enumerate(self.beliefs):
            if self.parameters["bayesian_update"] and k in self.missing:
                belief.unsuccessful_searches(searched, self.pod[k])
            belief.drift(self.t)
        self.t += 1
        return rewards

    def matrix(self) -> np.ndarray:
        """The mean of the beliefs about those still missing, or about all."""
        shown = self.missing or range(len(self.beliefs))
        matrix = np.zeros((self.size, self.size))
        for k in shown:
            for (x, y), chance in self.beliefs[k].mass.items():
                matrix[y, x] += chance / len(shown)
        return matrix

    def note(
        self, before, targets, left, collided, finders, found, in_reach, persons, searches
    ) -> None:
        """Remember what happens in a step, of the things in EVENTS."""
        n, several = len(before), len(persons) > 1
        exchanges = any(
            targets[i] == before[j] and targets[j] == before[i]
            for i in range(n)
            for j in range(i)
            if targets[i] != before[i]
        )
        entered = any(left[i] and before[i] in targets for i in range(n))
        last = self.t == self.limit - 1
        crashed = any(left) or any(collided)
        where_found = {persons[k] for k in range(len(persons)) if k not in self.missing}
        happened = {
            "collision": any(collided),
            "collision of three": any(
                targets.count(targets[i]) > 2 for i in range(n) if collided[i]
            ),
            "left the grid": any(left),
            "left and collided in one step": any(left) and any(collided),
            "a drone entered the cell of one that left": entered,
            "a drone left beside a find": any(left) and bool(found),
            "exchange of cells": exchanges,
            "time up": last and not crashed and not finders,
            "time up, somebody had found somebody": last and not crashed and bool(self.successful),
            "find in the last step": last and bool(finders),
            "find": bool(finders),
            "two persons found by one search": len(found) > len({persons[k] for k in found}),
            "two drones found in one step": len(finders) > 1,
            "one of several found": several and bool(found) and found < self.missing,
            "all of several found": several and bool(found) and found == self.missing,
            "find beside a collision": bool(found) and any(collided),
            "missed in the right cell": bool(in_reach - found),
            "search of a cell where somebody was found": any(
                before[i] in where_found and i not in finders for i in searches
            ),
        }
        assert happened.keys() <= set(EVENTS)
        self.events |= {event for event, did in happened.items() if did}


# The comparison.


def check_matrix(model: Model, matrix: np.ndarray, persons: tuple[Cell, ...]) -> None:
    """The matrix is a distribution, within reach, and the one of the model."""
    assert matrix.dtype == np.float32 and matrix.shape == (model.size, model.size)
    assert not matrix.flags.writeable
    assert matrix.min() >= 0
    assert matrix.sum(dtype=np.float64) == pytest.approx(1, abs=1e-6)
    shown = model.missing or range(len(persons))
    starts = [model.parameters["person_initial_position"][k] for k in shown]
    for y, x in np.argwhere(matrix):
        assert any(abs(x - sx) <= model.t and abs(y - sy) <= model.t for sx, sy in starts)
    for k in model.missing:
        x, y = persons[k]
        assert matrix[y, x] > 0
    np.testing.assert_allclose(matrix, model.matrix(), atol=2e-7)


def check_step(model: Model, env: DroneSwarmSearch, result: Any, expected: list[float]) -> None:
    """What a step returned is what the model says."""
    observations, rewards, terminations, truncations, infos = result
    frame, ended = env.frame(), model.ending is not None
    assert dict(rewards) == dict(zip(model.names, expected, strict=True))
    assert all(type(points) is float for points in rewards.values())
    assert rewards["total_reward"] == sum(expected)
    assert terminations == truncations == dict.fromkeys(model.names, ended)
    assert frame.ending is model.ending
    assert env.agents == ([] if ended else model.names)
    found = len(model.missing) < len(frame.persons)
    assert infos["Found"] is found
    assert infos == {name: {"Found": found} for name in model.names}
    assert list(observations) == model.names
    for name, cell in zip(model.names, model.drones, strict=True):
        assert observations[name]["observation"][0] == cell
    assert frame.drones == tuple(model.drones)
    assert frame.step == model.t
    if model.ending is Ending.TIME_LIMIT:
        for i in set(range(len(model.names))) - model.successful:
            # The comparison is exact: what a user adds up comes to -100000, to the bit.
            assert model.returns[i] == -100_000


def check_episode(episode: Episode) -> set[str]:
    """Play an episode in parallel with the model; returns the EVENTS that happened."""
    env = DroneSwarmSearch(**episode.parameters)
    observations, infos = env.reset(seed=episode.seed, drones_positions=episode.drones)
    model = Model(episode)
    rng = random.Random(episode.seed)
    assert env.agents == model.names
    assert infos == {name: {"Found": False} for name in model.names}
    assert list(env.frame().drones) == model.drones
    persons = env.frame().persons
    assert persons == tuple(episode.parameters["person_initial_position"])
    matrix = observations["drone0"]["observation"][1]
    check_matrix(model, matrix, persons)
    while model.ending is None:
        missing = [persons[k] for k in model.missing]
        actions = planned_actions(episode.plans, model.t, model.drones, missing, model.size, rng)
        result = env.step(dict(zip(model.names, actions, strict=True)))
        frame = env.frame()
        found = {k for k in model.missing if frame.found[k]}
        check_step(model, env, result, model.step(actions, matrix, persons, found))
        # Persons drift, found or not, at most one cell along each axis.
        for (x, y), (next_x, next_y) in zip(persons, frame.persons, strict=True):
            assert abs(next_x - x) <= 1 and abs(next_y - y) <= 1
            assert inside((next_x, next_y), model.size)
        assert frame.found == tuple(k not in model.missing for k in range(len(persons)))
        persons, matrix = frame.persons, result[0]["drone0"]["observation"][1]
        check_matrix(model, matrix, persons)
    assert model.t <= model.limit
    return model.events


@settings(deadline=None, max_examples=400, derandomize=True)
@given(episodes())
def test_episodes_go_by_the_rules(episode):
    for event in check_episode(episode):
        hypothesis.event(event)


@pytest.mark.parametrize("event", EVENTS)
def test_the_episodes_tried_reach(event):
    hypothesis.find(
        episodes(),
        lambda episode: event in check_episode(episode),
        settings=settings(
            deadline=None,
            max_examples=2000,
            derandomize=True,
            database=None,
            phases=[Phase.generate],
            suppress_health_check=list(HealthCheck),
        ),
    )
