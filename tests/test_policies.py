"""What all policies share: single and batch observations, memories, seeds, safety."""

import pickle
import zlib
from typing import Any

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given, settings
from small_searches import parameters

from DroneSwarmSearch import Action, Drift, DroneSwarmSearch, Ending, Person, Scenario
from DroneSwarmSearch.core import Cell
from DroneSwarmSearch.policies import POLICIES, RandomPolicy, SwarmPolicy, make
from DroneSwarmSearch.vector import SearchBatch

NAMES = list(POLICIES)


def scenario(**changes: Any) -> Scenario:
    return Scenario(**{"grid_size": 5, "n_drones": 2, **changes})


def shown(batch: SearchBatch, rows: np.ndarray) -> dict[str, np.ndarray]:
    return {
        "positions": batch.positions[rows],
        "probability_matrix": batch.matrices_of(rows),
        "row": rows,
    }


def play_batch(policy, batch, seed):
    """The actions of every row's episode, step by step, and the endings."""
    batch.reset(seeds=[seed + row for row in range(batch.num_rows)])
    policy.reset(seed=seed)
    taken: list[list[list[int]]] = [[] for _ in range(batch.num_rows)]
    endings = np.zeros(batch.num_rows, np.int8)
    while len(live := np.flatnonzero(endings == 0)):
        actions = np.full((batch.num_rows, batch.scenario_of(0).n_drones), int(Action.IDLE))
        actions[live] = policy(shown(batch, live))
        batch.step(actions)
        endings[live] = batch.endings[live]
        for row in live.tolist():
            taken[row].append(actions[row].tolist())
    return taken, endings


@pytest.mark.parametrize(
    ("name", "of", "error", "message"),
    [
        ("best", scenario(), ValueError, r"name must be one of random, .*, got 'best'"),
        ("random", 7, TypeError, r"scenario must be a Scenario, got 7"),
    ],
)
def test_make_rejects_anything_but_names_and_scenarios(name, of, error, message):
    with pytest.raises(error, match=message):
        make(name, of)


KNOWN: dict[str, Any] = {
    "vector": (0.3, 0.1),
    "person_initial_position": [(2, 2), (4, 4)],
    "probability_of_detection": (0.8, 1.0),
}
UNCERTAIN: dict[str, Any] = {
    "persons": [
        Person(
            [
                Drift((1, 1), vector=(0.2, 0), vector_sd=0.1, diffusion=0.1),
                Drift((6, 5), start_sd=0.5, adrift=2),
            ]
        ),
        Person(Drift(np.tri(8), diffusion=0.2), probability_of_detection=0.7),
    ]
}


COVERAGE = {**UNCERTAIN, "mission": "coverage"}
LONG = ("imitation", "planner")  # take as long as all others together


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("name", "persons", "bayesian_update"),
    [
        (name, persons, update)
        for name in NAMES
        for persons, usual in ((KNOWN, False), (UNCERTAIN, True), (COVERAGE, False))
        for update in ((False, True) if name == "greedy-matrix" else (usual,))
    ],
)
def test_a_batch_gets_the_same_actions_as_single_searches(name, persons, bayesian_update):
    search: dict[str, Any] = {
        "grid_size": 8,
        "n_drones": 3,
        "timestep_limit": 12,
        "bayesian_update": bayesian_update,
        **persons,
    }
    batch = SearchBatch(2 if name in LONG else 4, **search)
    taken, endings = play_batch(make(name, batch.scenario_of(0)), batch, 11)
    assert Ending.COLLISION not in endings
    env = DroneSwarmSearch(**search)
    policy = make(name, env.scenario)
    for row, expected in enumerate(taken):
        observations, _ = env.reset(11 + row)
        policy.reset(seed=11 + row)
        mine = []
        while env.agents:
            actions = policy(observations)
            assert list(actions) == env.possible_agents
            assert all(type(action) is int for action in actions.values())
            mine.append(list(actions.values()))
            observations, *_ = env.step(actions)
        assert mine == expected


@pytest.mark.thorough
@pytest.mark.parametrize("name", NAMES)
def test_copies_continue_identically_and_independently(name):
    persons = [(0, 0), (5, 5)]
    batch = SearchBatch(
        4, grid_size=6, n_drones=2, person_initial_position=persons, timestep_limit=16
    )
    policy = make(name, batch.scenario_of(0))
    batch.reset(seeds=range(4))
    rows = np.arange(4)
    for _ in range(5):
        batch.step(policy(shown(batch, rows)))
    twin = pickle.loads(pickle.dumps(policy))
    history = []
    for _ in range(8):
        seen = shown(batch, rows)
        history.append((seen, policy(seen)))
        batch.step(history[-1][1])
    for seen, actions in history:
        assert np.array_equal(twin(seen), actions)


@pytest.mark.thorough
@pytest.mark.parametrize("name", NAMES)
def test_no_drone_ever_collides_or_leaves_the_grid(name):
    @settings(max_examples=2 if name == "planner" else 5, derandomize=True)
    @given(parameters(most_cells=12, most_drones=8), st.data())
    def whole_episodes(search: dict[str, Any], data: st.DataObject) -> None:
        size = search["grid_size"]
        drones = search["n_drones"]
        starts = st.permutations([(x, y) for y in range(size) for x in range(size)])
        positions = np.array([data.draw(starts)[:drones] for _ in range(2)])
        batch = SearchBatch(2, drones_positions=positions, **search)
        _, endings = play_batch(make(name, batch.scenario_of(0)), batch, drones)
        assert set(endings) <= {Ending.FOUND, Ending.COVERED, Ending.TIME_LIMIT}

    whole_episodes()


class Historian(SwarmPolicy):
    """A policy whose actions are a hash of all observations in the episode."""

    calls = 0

    def begin(self) -> list[bytes]:
        return []

    def choose(self, memory: list[bytes], cells: list[Cell], matrix: Any) -> list[int]:
        self.calls += 1
        memory.append(bytes(value for cell in cells for value in cell) + matrix.tobytes())
        return actions_after(memory)


def actions_after(seen: list[bytes]) -> list[int]:
    digest = zlib.crc32(b"|".join(seen))
    return [digest % 6, digest // 6 % 6]


def identical(rows: int) -> dict[str, np.ndarray]:
    """Identical observations of some searches."""
    return {
        "positions": np.tile(np.array([[0, 0], [1, 0]]), (rows, 1, 1)),
        "probability_matrix": np.full((rows, 5, 5), 1 / 25, np.float32),
    }


@settings(max_examples=30, derandomize=True)
@given(st.data())
def test_rows_have_separate_memories(data):
    policy = Historian(scenario())
    histories: dict[int, list[bytes]] = {}
    row_sets = st.sets(st.integers(0, 5)).map(sorted)
    for _ in range(data.draw(st.integers(1, 12))):
        if data.draw(st.integers(0, 4)) == 0:
            gone = data.draw(st.none() | row_sets)
            policy.reset(rows=gone)
            for row in list(histories) if gone is None else gone:
                histories.pop(row, None)
        rows = data.draw(row_sets)
        # Few different views, so that many rows have identical observations.
        views = [data.draw(st.integers(0, 2)) for _ in rows]
        seen_by = identical(len(rows)) | {"row": np.array(rows, np.int64)}
        positions = seen_by["positions"]
        matrices = seen_by["probability_matrix"]
        for place, view in enumerate(views):
            positions[place, 1, 1] = view % 2
            matrices[place] = view // 2
        actions = policy(seen_by)
        assert actions.shape == (len(rows), 2) and actions.dtype == np.int64
        for place, row in enumerate(rows):
            seen = bytes([0, 0, 1, views[place] % 2]) + matrices[place].tobytes()
            histories.setdefault(row, []).append(seen)
            assert actions[place].tolist() == actions_after(histories[row])


@pytest.mark.parametrize(
    ("changes", "error", "message"),
    [
        ({"positions": np.zeros((3, 2, 2))}, TypeError, "positions must be integers, got float64"),
        (
            {"positions": np.zeros((3, 4, 2), int)},
            ValueError,
            r"positions must be of shape \(2, 2\) for each search, got \(4, 2\)",
        ),
        (
            {"probability_matrix": np.zeros((2, 5, 5), np.float32)},
            ValueError,
            "probability_matrix must have the length of positions, 3, got 2",
        ),
        ({"row": np.array([0, 1, 1])}, ValueError, "row must be different integers of at least 0"),
        ({"row": np.zeros(3)}, TypeError, "row must be different integers .*, got float64"),
    ],
)
def test_rejects_bad_observations(changes, error, message):
    with pytest.raises(error, match=message):
        Historian(scenario())({**identical(3), **changes})


def test_rejects_observations_without_a_matrix_or_of_another_size():
    policy = Historian(scenario())
    with pytest.raises(ValueError, match="observations must hold a probability_matrix, got pos"):
        policy({"positions": identical(1)["positions"]})
    observations, _ = DroneSwarmSearch(grid_size=6, n_drones=2).reset(0)
    with pytest.raises(ValueError, match=r"matrix must be of shape \(5, 5\)"):
        policy(observations)


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"seed": -1}, ValueError, "seed must be an integer of at least 0, got -1"),
        ({"seed": [1, "a"]}, TypeError, r"seed\[1\] must be an integer .*, got 'a'"),
        ({"seed": [1, 2], "rows": [3]}, ValueError, "seed must be 1 integers, one for each row"),
        ({"rows": [-3]}, ValueError, "rows must be different integers .*-3"),
    ],
)
def test_rejects_bad_resets(arguments, error, message):
    with pytest.raises(error, match=message):
        make("random", scenario()).reset(**arguments)


class TestRandom:
    @staticmethod
    def draws(policy: RandomPolicy, rows: list[int], steps: int = 20) -> np.ndarray:
        """The actions of some rows whose drones never move."""
        seen = {**identical(len(rows)), "row": np.array(rows)}
        return np.stack([policy(seen) for _ in range(steps)], axis=1)

    def test_a_row_depends_only_on_its_seed(self):
        policy = RandomPolicy(scenario())
        policy.reset(seed=40)
        together = self.draws(policy, [0, 1, 2, 3])
        policy.reset(seed=40)
        assert np.array_equal(self.draws(policy, [3, 1]), together[[3, 1]])
        policy.reset(seed=[42, 40])
        assert np.array_equal(self.draws(policy, [0, 1]), together[[2, 0]])
        policy.reset(seed=[41], rows=[7])
        assert np.array_equal(self.draws(policy, [7]), together[[1]])
