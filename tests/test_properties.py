"""Random episodes compared with a simple, independent model of the rules and the belief."""

import random
from collections import Counter
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from helpers import INTENTS, inside, planned_actions, target_of
from hypothesis import given, settings
from hypothesis import strategies as st

from DroneSwarmSearch import Action, DroneSwarmSearch, Ending
from DroneSwarmSearch.drift import ProbabilityMatrix, dispersion_rate
from DroneSwarmSearch.persons import Drift

Cell = tuple[int, int]


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


class Belief:
    """The belief about one person, a dict of cells, by the forecast and Bayes' rule."""

    def __init__(self, grid_size: int, start: Cell, vector: Any, constant: float) -> None:
        drift = Drift(start, vector=vector, diffusion=dispersion_rate(constant))
        self.forecast = ProbabilityMatrix(grid_size, drift)
        self.mass = {start: 1.0}
        self.kept = 1.0  # the probability that no search so far finds the person

    def unsuccessful_searches(self, cells: list[Cell], detection: float) -> None:
        after = dict(self.mass)
        for cell in cells:
            if cell in after:
                after[cell] *= 1 - detection
        kept = sum(after.values())
        self.kept *= kept
        if kept > 0:
            self.mass = {cell: chance / kept for cell, chance in after.items()}

    def drift(self, step: int) -> None:
        right, left, down, up = (moves[0] for moves in self.forecast.moves(step))
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
        self.successful: set[int] = set()  # drones that have found a person
        self.ending: Ending | None = None

    def step(self, actions, shown, persons, found):
        """Return the rewards of a step. `found` are the persons found in the environment."""
        before = self.drones
        targets = [target_of(cell, a) for cell, a in zip(before, actions, strict=True)]
        left = [not inside(target, self.size) for target in targets]
        collided = [
            not gone and targets.count(target) > 1
            for target, gone in zip(targets, left, strict=True)
        ]
        searches = [i for i, action in enumerate(actions) if action == Action.SEARCH]
        searched = [before[i] for i in searches]

        # A POD of 1 is certain and one of 0 impossible; otherwise the environment decides.
        in_reach = {k for k in self.missing if persons[k] in searched}
        assert found <= in_reach
        assert found >= {k for k in in_reach if self.pod[k] == 1}
        assert not [k for k in found if self.pod[k] == 0]
        finders = {i for i in searches if any(persons[k] == before[i] for k in found)}
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
            if self.parameters["bayesian_update"]:
                belief.unsuccessful_searches(searched, self.pod[k])
            belief.drift(self.t)
        self.t += 1
        return rewards

    def info(self) -> dict[str, Any]:
        """Return each drone's info."""
        info: dict[str, Any] = {
            "Found": len(self.missing) < len(self.beliefs),
            "is_success": self.ending is Ending.FOUND,
        }
        if self.parameters["bayesian_update"]:
            kept = sum(belief.kept for belief in self.beliefs) / len(self.beliefs)
            info["probability_of_success"] = pytest.approx(1 - kept, abs=1e-9)
        return info

    def matrix(self) -> np.ndarray:
        """Return the mean belief over the missing persons, or over all if none is missing."""
        shown = self.missing or range(len(self.beliefs))
        matrix = np.zeros((self.size, self.size))
        for k in shown:
            for (x, y), chance in self.beliefs[k].mass.items():
                matrix[y, x] += chance / len(shown)
        return matrix


def check_matrix(model: Model, matrix: np.ndarray, persons: tuple[Cell, ...]) -> None:
    """Check that the matrix is a distribution, within reach, and equal to the model's."""
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
    """Compare the results of a step with the model."""
    observations, rewards, terminations, truncations, infos = result
    frame = env.frame()
    ended = model.ending is not None
    assert dict(rewards) == dict(zip(model.names, expected, strict=True))
    assert all(type(points) is float for points in rewards.values())
    assert rewards["total_reward"] == sum(expected)
    assert terminations == truncations == dict.fromkeys(model.names, ended)
    assert frame.ending is model.ending
    assert env.agents == ([] if ended else model.names)
    found = len(model.missing) < len(frame.persons)
    assert infos["Found"] is found
    assert infos == dict.fromkeys(model.names, model.info())
    assert infos.get("probability_of_success") == model.info().get("probability_of_success")
    assert list(observations) == model.names
    for name, cell in zip(model.names, model.drones, strict=True):
        assert observations[name]["observation"][0] == cell
    assert frame.drones == tuple(model.drones)
    assert frame.step == model.t
    if model.ending is Ending.TIME_LIMIT:
        for i in set(range(len(model.names))) - model.successful:
            # Exact: the rewards of an unsuccessful drone add up to -100000.
            assert model.returns[i] == -100_000


def check_episode(episode: Episode) -> None:
    """Play an episode in parallel with the model."""
    env = DroneSwarmSearch(**episode.parameters)
    observations, infos = env.reset(seed=episode.seed, drones_positions=episode.drones)
    model = Model(episode)
    rng = random.Random(episode.seed)
    assert env.agents == model.names
    assert infos == dict.fromkeys(model.names, model.info())
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
        persons = frame.persons
        matrix = result[0]["drone0"]["observation"][1]
        check_matrix(model, matrix, persons)
    assert model.t <= model.limit


def scene(plans: list[tuple[int, ...]], drones: list[Cell], persons: list[Cell]) -> Episode:
    """Return an episode on a 3 x 3 grid in which every search of the right cell succeeds."""
    parameters = {
        "grid_size": 3,
        "n_drones": len(drones),
        "person_initial_position": persons,
        "vector": (0.0, 0.0),
        "disperse_constant": 10.0,
        "timestep_limit": 4,
        "bayesian_update": True,
        "probability_of_detection": 1.0,
    }
    return Episode(parameters, tuple(drones), tuple(plans), 0)


LEFT, RIGHT, UP, DOWN, SEARCH = ((int(action),) for action in list(Action)[:5])
RARE = [
    # Three drones collide in the centre.
    scene([RIGHT, DOWN, UP], [(0, 1), (1, 0), (1, 2)], [(2, 2)]),
    # One drone leaves the grid, two collide, and one finds a person.
    scene([UP, RIGHT, LEFT, SEARCH], [(0, 0), (0, 1), (2, 1), (2, 2)], [(2, 2), (1, 0)]),
    # Two drones find a person each, in the same step.
    scene([SEARCH, SEARCH], [(0, 0), (2, 2)], [(0, 0), (2, 2)]),
    # Two drones exchange cells.
    scene([RIGHT, LEFT], [(0, 0), (1, 0)], [(2, 2)]),
]
"""Episodes with events that are rare among random ones."""


@pytest.mark.parametrize("episode", RARE)
def test_rare_events_follow_the_rules(episode):
    check_episode(episode)


@pytest.mark.thorough
@settings(max_examples=200, derandomize=True)
@given(episodes())
def test_random_episodes_follow_the_rules(episode):
    check_episode(episode)
