"""Determinism: episodes can be repeated, copied, pickled and rendered without change."""

import copy
import pickle
import random
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from helpers import careful_actions, observed, overwrite, plain, play, play_on

from DroneSwarmSearch import DroneSwarmSearch

PARAMETERS: dict[str, dict[str, Any]] = {
    "persons": {
        "n_drones": 2,
        "person_initial_position": [(2, 2), (6, 1), (2, 2)],
        "probability_of_detection": [0.1, 0.5, 1.0],
    },
    "everything": {
        "grid_size": 9,
        "n_drones": 4,
        "person_initial_position": [(2, 2), (6, 1)],
        "probability_of_detection": [0.1, 0.5],
        "bayesian_update": True,
        "disperse_constant": 30,
        "vector": (0.3, 0.2),
    },
}

each_parameters = pytest.mark.parametrize("parameters", PARAMETERS.values(), ids=PARAMETERS)


def make_env(parameters: dict[str, Any], **changes: Any) -> DroneSwarmSearch:
    return DroneSwarmSearch(**{"timestep_limit": 60, **parameters, **changes})


EVERYTHING = PARAMETERS["everything"]


@each_parameters
def test_same_seed_same_episode(parameters):
    env = make_env(parameters)
    other = make_env(parameters)
    play(other, 5, seed=99)  # episodes before the seed have no effect
    for seed in range(2):
        assert play(env, seed, seed=seed) == play(other, seed, seed=seed)
        assert play(env, seed) == play(other, seed)


def path(env: DroneSwarmSearch, steps: int = 20, **reset: Any) -> tuple[Any, ...]:
    """Return the persons' cells while a drone idles."""
    env.reset(**reset)
    cells = [env.frame().persons]
    for _ in range(steps):
        env.step(dict.fromkeys(env.agents, 5))
        cells.append(env.frame().persons)
    return tuple(cells)


def test_unseeded_environments_differ():
    env = make_env({})
    other = make_env({})
    assert [path(env) for _ in range(3)] != [path(other) for _ in range(3)]


def idle(env: DroneSwarmSearch, rng: random.Random) -> dict[str, int]:
    return dict.fromkeys(env.agents, 5)


def careful(env: DroneSwarmSearch, rng: random.Random) -> dict[str, int]:
    return careful_actions(rng, observed(env), env.grid_size)


def careless(env: DroneSwarmSearch, rng: random.Random) -> dict[str, int]:
    return {agent: rng.randrange(6) for agent in env.agents}


def hunt(env: DroneSwarmSearch, rng: random.Random) -> dict[str, int]:
    """Drone 0 moves to the true cell of the first missing person and searches; others idle."""
    frame = env.frame()
    x, y = frame.drones[0]
    goal = next(cell for cell, found in zip(frame.persons, frame.found, strict=True) if not found)
    action = 4
    if goal != (x, y):
        action = (0 if goal[0] < x else 1) if goal[0] != x else (2 if goal[1] < y else 3)
    return {**dict.fromkeys(env.agents, 5), "drone0": action}


POLICIES: list[Callable[..., dict[str, int]]] = [idle, careless, hunt]


def paths_under(env: DroneSwarmSearch, policy: Any, episodes: int) -> list[list[Any]]:
    """The cells of the persons (None once found) after each step of an episode with a seed and
    of some episodes after it."""

    def cells() -> list[Any]:
        frame = env.frame()
        pairs = zip(frame.persons, frame.found, strict=True)
        return [None if found else cell for cell, found in pairs]

    rng = random.Random(1)
    paths = []
    for episode in range(episodes):
        env.reset(seed=5 if episode == 0 else None)
        paths.append([cells()])
        while env.agents:
            env.step(policy(env, rng))
            paths[-1].append(cells())
    return paths


@each_parameters
def test_drift_does_not_depend_on_actions(parameters):
    env = make_env(parameters)
    longest = paths_under(env, idle, episodes=5)
    assert all(len(cells) == 61 for cells in longest)
    shorter = 0
    for policy in POLICIES[1:]:
        for cells, expected in zip(paths_under(env, policy, episodes=5), longest, strict=True):
            for here, there in zip(cells, expected, strict=False):
                assert all(a in (None, b) for a, b in zip(here, there, strict=True))
            shorter += len(cells) < len(expected)
    assert shorter > 5  # drones crashed or found a person early


def test_detections_do_not_depend_on_earlier_searches():
    """The seed alone determines whether a search in step t succeeds."""
    fixed = {"disperse_constant": 0, "vector": (0, 0), "probability_of_detection": 0.2}

    def step_of_find(env: DroneSwarmSearch, seed: int, first: int) -> int:
        env.reset(seed=seed)
        while env.agents:
            t = env.frame().step
            env.step({"drone0": 4 if t >= first else 5})
        return env.frame().step if env.frame().found[0] else 1000

    env = make_env(fixed, timestep_limit=40)
    begins_mattered = 0
    for seed in range(30):
        in_first = step_of_find(env, seed, 0)
        for first in (1, 5, 20):
            found = step_of_find(env, seed, first)
            assert found == in_first if first < in_first else found > in_first
            begins_mattered += found != in_first
    assert begins_mattered > 30


def reloaded(env: DroneSwarmSearch) -> DroneSwarmSearch:
    return pickle.loads(pickle.dumps(env))


@pytest.mark.parametrize("copied", [copy.deepcopy, reloaded])
@pytest.mark.parametrize("steps", [0, 8])
def test_copies_during_an_episode_continue_identically(steps, copied):
    env = make_env(EVERYTHING)
    rng = random.Random(1)
    unwatched = env.reset(seed=6, options={"vector": (0.2, -0.1)})[0]
    for _ in range(steps):
        if env.agents:
            unwatched = env.step(careful_actions(rng, unwatched, env.grid_size))[0]
    other = copied(env)
    assert plain(other.state()) == plain(env.state())
    assert plain(vars(other.frame())) == plain(vars(env.frame()))
    assert other.render() == env.render()
    seen = observed(env)
    seen_by_other = observed(other)
    # One after the other, because copies share no mutable state.
    logs = [
        [*play_on(one, cells, random.Random(2)), play(one, 3), play(one, 4, seed=1), one.vector]
        for one, cells in ((env, seen), (other, seen_by_other))
    ]
    assert logs[0] == logs[1]


def test_returned_matrices_never_change_and_are_read_only():
    env = make_env(EVERYTHING)
    kept = []
    rng = random.Random(3)
    for _ in range(3):
        observations, _ = env.reset()
        while True:
            matrix = observations["drone0"]["observation"][1]
            kept.append((matrix, matrix.copy()))
            if not env.agents:
                break
            observations = env.step(careful_actions(rng, observations, env.grid_size))[0]
    for matrix, as_it_was in kept:
        np.testing.assert_array_equal(matrix, as_it_was)
        with pytest.raises(ValueError, match="read-only"):
            matrix[0, 0] = 1
        with pytest.raises(ValueError, match=r"WRITEABLE|writeable"):
            matrix.view().flags.writeable = True


def test_changing_returned_arrays_does_not_change_the_episode():
    """Neither this episode, nor a later one, nor one of a new environment."""

    def episodes(env, touch):
        log = []
        rng = random.Random(4)
        for episode in range(2):
            observations, _ = env.reset(seed=5 if episode == 0 else None)
            while env.agents:
                actions = careful_actions(rng, observations, env.grid_size)
                shown = observations["drone0"]["observation"][1]
                log.append((shown.tolist(), env.frame().matrix.tolist(), env.state().tolist()))
                for array in (shown, env.frame().matrix, env.state()):
                    touch(array)
                for forecast in env.scenario.forecasts():
                    across = forecast.marginals(3)
                    along = forecast.moves(3)
                    for array in (forecast.at(3), forecast.exact(3), *across, *along):
                        touch(array)
                observations, *results = env.step(actions)
                log.append(results)
        return log

    expected = episodes(make_env(EVERYTHING), lambda array: None)
    assert episodes(make_env(EVERYTHING), overwrite) == expected
    assert episodes(make_env(EVERYTHING), lambda array: None) == expected


def test_results_of_step_can_be_changed_by_the_caller():
    logs: list[list[Any]] = [[], []]
    for spoils, log in enumerate(logs):
        env = make_env(EVERYTHING)
        rng = random.Random(5)
        results: Any = env.reset(seed=2)
        while log.append(plain(results)) or env.agents:
            actions = careful_actions(rng, results[0], env.grid_size)
            for mapping in results if spoils else ():
                for value in mapping.values():
                    if isinstance(value, dict):
                        value.clear()
                mapping.clear()
            results = env.step(actions)
            actions.clear()
    assert logs[0] == logs[1]


def test_changing_arguments_afterwards_has_no_effect():
    persons = np.array([[3, 3], [5, 1]])
    vector = [0.5, 0.5]
    cells = [[1, 1], [2, 2]]
    env = make_env({"n_drones": 2}, person_initial_position=persons, vector=vector)
    options = {"drones_positions": cells, "person_initial_position": persons}
    env.reset(seed=1, options=options)
    persons[:] = 0
    vector[0] = -1
    cells[0][0] = 6
    options.clear()
    assert env.frame().persons == ((3, 3), (5, 1))
    assert env.frame().drones == ((1, 1), (2, 2))
    assert env.vector == (0.5, 0.5)
    env.reset()
    assert env.frame().persons == ((3, 3), (5, 1))


def test_a_vector_is_kept_until_the_next_one():
    env = make_env({}, person_initial_position=(3, 3), vector=(1, 0), disperse_constant=0)

    def drift(**reset: Any) -> tuple[int, int]:
        env.reset(**reset)
        env.step({"drone0": 5})
        x, y = env.frame().persons[0]
        assert env.frame().vector == env.vector
        return x - 3, y - 3

    assert drift() == (1, 0)
    assert drift(vector=(0, -1)) == (0, -1)
    assert drift() == drift(seed=4) == (0, -1)
    assert drift(options={"vector": [-1, 1]}) == (-1, 1)
    assert drift() == drift(options={}) == (-1, 1)


def test_start_cells_apply_to_one_episode():
    env = make_env({"n_drones": 3, "person_initial_position": (4, 4)})
    rows = ((0, 0), (1, 0), (2, 0))
    cells = ((6, 6), (0, 3), (2, 5))
    env.reset(drones_positions=cells)
    assert env.frame().drones == cells
    env.reset()
    assert env.frame().drones == rows
    env.reset(options={"drones_positions": cells, "person_initial_position": (1, 2)})
    assert (env.frame().drones, env.frame().persons) == (cells, ((1, 2),))
    env.reset()
    assert (env.frame().drones, env.frame().persons) == (rows, ((4, 4),))


def test_unknown_options_are_warned_about_and_ignored():
    env = make_env(EVERYTHING)
    twin = make_env(EVERYTHING)
    with pytest.warns(UserWarning, match="'wind'") as caught:
        seen = play(env, seed=1, options={"wind": 3, "vector": (0, 1)})
    assert len(caught) == 1
    assert caught[0].filename.endswith("helpers.py")  # the caller's line, not the library's
    assert seen == play(twin, seed=1, options={"vector": (0, 1)})


@pytest.mark.parametrize("mode", ["rgb_array", "human"])
def test_rendering_never_changes_the_episode(mode, monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    monkeypatch.setitem(DroneSwarmSearch.metadata, "render_fps", 1000)
    parameters = {**EVERYTHING, "timestep_limit": 6}
    unseen = make_env(parameters, render_mode=None)
    seen = make_env(parameters, render_mode=mode)
    rng = random.Random(1)
    rng_of_seen = random.Random(1)
    for arguments in ({"seed": 4}, {}):
        assert plain(seen.reset(**arguments)) == plain(unseen.reset(**arguments))
        while unseen.agents:
            seen.render()
            result = unseen.step(careful(unseen, rng))
            assert plain(seen.step(careful(seen, rng_of_seen))) == plain(result)
            seen.render()
            assert plain(seen.state()) == plain(unseen.state())
    seen.close()
