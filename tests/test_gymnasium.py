"""The id "DroneSwarmSearch-v0" of Gymnasium: one drone, and batches of drones."""

import inspect
import subprocess
import sys
from collections.abc import Iterator
from typing import Any

import gymnasium
import numpy as np
import pygame
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import SyncVectorEnv
from helpers import plain

from DroneSwarmSearch import Action, Drift, DroneSwarmSearch, Ending, Person, Scenario
from DroneSwarmSearch.layouts import LAYOUTS
from DroneSwarmSearch.single_drone_env import SingleDroneEnv
from DroneSwarmSearch.vector import DroneVectorEnv

ID = "DroneSwarmSearch-v0"

SMALL: dict[str, Any] = {
    "grid_size": 4,
    "vector": (0.3, -0.2),
    "person_initial_position": (2, 1),
    "timestep_limit": 9,
    "bayesian_update": True,
}

CHANCES = [0.04, 0.16, 0.04, 0.16, 0.4, 0.2]


def made(**arguments: Any) -> gymnasium.Env[Any, Any]:
    return gymnasium.make(ID, **{**SMALL, **arguments})


def episodes(env: Any, seed: int, count: int = 3) -> Iterator[Any]:
    """Everything that some episodes with random actions return."""
    rng = np.random.default_rng(seed)
    for episode in range(count):
        yield plain(env.reset(seed=seed if episode == 0 else None))
        done = False
        while not done:
            step = env.step(rng.choice(len(Action), p=CHANCES))
            done = step[2] or step[3]
            yield plain(step)


ARGUMENTS: dict[str, dict[str, Any]] = {
    **{layout: {"observation": layout} for layout in LAYOUTS},
    "masks in observations": {"action_mask": "observation"},
    "masks in dict observations": {"observation": "dict", "action_mask": "observation"},
    "without masks": {"action_mask": None},
    "both flags": {"separate_flags": False},
    "scaled rewards": {"reward_scale": 2.0**-17},
    "several persons": {"person_initial_position": [(2, 1), (1, 1)]},
    "coverage": {"mission": "coverage"},
}
all_arguments = pytest.mark.parametrize("arguments", ARGUMENTS.values(), ids=ARGUMENTS)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    "arguments",
    [{}, *({"observation": layout} for layout in LAYOUTS), {"action_mask": "observation"}, SMALL],
    ids=str,
)
def test_gymnasiums_checker_passes(arguments, monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")  # it opens a window
    env = gymnasium.make(ID, **arguments)
    check_env(env.unwrapped)
    assert isinstance(env.unwrapped, SingleDroneEnv)
    assert env.spec is not None and env.spec.id == ID


def test_gymnasiums_checker_passes_without_a_screen(monkeypatch):
    pygame.quit()
    monkeypatch.setenv("SDL_VIDEODRIVER", "there_is_no_such_driver")
    with pytest.warns(UserWarning, match="no window can be opened"):
        check_env(gymnasium.make(ID).unwrapped)


@all_arguments
def test_the_batch_equals_gymnasiums_vector_of_single_drones(arguments):
    """Observations, rewards, flags and infos, with their names."""
    how = {**SMALL, **arguments}
    in_observations = arguments.get("action_mask") == "observation"
    batch = gymnasium.make_vec(ID, num_envs=4, **how)
    assert isinstance(batch, DroneVectorEnv)
    vector = gymnasium.make_vec(ID, 4, vectorization_mode="sync", **how)
    assert isinstance(vector, SyncVectorEnv)
    assert batch.single_observation_space == vector.single_observation_space
    assert batch.single_action_space == vector.single_action_space
    assert batch.observation_space == vector.observation_space
    seen, infos = batch.reset(seed=3)
    wanted, their_infos = vector.reset(seed=3)
    rng = np.random.default_rng(1)
    ended = 0
    for _ in range(30):
        assert plain(seen) == plain(wanted)
        if in_observations:  # single drones have them in the infos, too
            masks = their_infos.pop("action_mask"), their_infos.pop("_action_mask")
            assert masks[0].tolist() == wanted["action_mask"].tolist() and masks[1].all()
        check_infos(infos, their_infos)
        actions = rng.choice(len(Action), 4, p=CHANCES)
        seen, *results, infos = batch.step(actions)
        wanted, *their_results, their_infos = vector.step(actions)
        assert plain(results) == plain(their_results)
        ended += int((results[1] | results[2]).sum())
    assert ended > 3


def check_infos(infos: dict[str, Any], wanted: dict[str, Any]) -> None:
    assert {*infos} == {*wanted}
    for name in wanted:
        if not name.startswith(("_", "final")):
            meant = wanted[f"_{name}"]
            assert infos[f"_{name}"].tolist() == meant.tolist()
            assert infos[name][meant].tolist() == wanted[name][meant].tolist(), name


def test_num_envs_counts_drones():
    envs = gymnasium.make_vec(ID, num_envs=12, n_drones=3, right_of_way=True)
    assert isinstance(envs, DroneVectorEnv)
    assert (envs.num_envs, envs.batch.num_rows, envs.right_of_way) == (12, 4, True)
    assert envs.reset(seed=1)[1]["action_mask"].shape == (12, 6)
    assert envs.spec is not None and envs.spec.id == ID
    scenario = Scenario(n_drones=2)
    assert gymnasium.make_vec(ID, num_envs=6, scenario=scenario).unwrapped.batch.num_rows == 3
    assert gymnasium.make_vec(ID, num_envs=1024).num_envs == 1024
    for wrong, error, words in (
        ({"num_envs": 7, "n_drones": 3}, ValueError, "num_envs must be a multiple of n_drones, 3,"),
        ({"num_envs": 3, "scenario": scenario}, ValueError, "num_envs must be a multiple of n_dr"),
        ({"num_envs": 0}, ValueError, "num_envs must be an integer of at least 1, got 0"),
        ({"num_envs": 2, "n_drones": "2"}, TypeError, "n_drones must be an integer .* got '2'"),
    ):
        with pytest.raises(error, match=words):
            gymnasium.make_vec(ID, **wrong)


def test_options_and_parameters_are_those_of_the_environment():
    env = gymnasium.make(ID, scenario=Scenario(grid_size=6, timestep_limit=3), observation="dict")
    seen, _ = env.reset(seed=0, options={"drones_positions": [(4, 2)], "vector": (1, 0)})
    assert seen["position"].tolist() == [4, 2]
    search = env.unwrapped.search
    assert (search.grid_size, search.vector) == (6, (1.0, 0.0))
    persons = [Person(Drift((2, 2), start_sd=1.0))]
    uncertain = gymnasium.make(ID, persons=persons, grid_size=5)
    uncertain.reset(seed=0)
    assert uncertain.unwrapped.search.scenario.persons == tuple(persons)
    with pytest.raises(ValueError, match=r"drones_positions\[0\]"):
        env.reset(options={"drones_positions": [(6, 6)]})


def test_wrappers_read_the_time_limit_and_nothing_enforces_it_again():
    env = gymnasium.make(ID, timestep_limit=9)
    assert env.spec is not None and env.spec.max_episode_steps == 9
    assert "TimeLimit" not in str(env)
    aware = gymnasium.wrappers.TimeAwareObservation(env, normalize_time=False)
    aware.reset(seed=0, options={"drones_positions": [(6, 6)]})
    for step in range(1, 10):
        observation, _, terminated, truncated, info = aware.step(Action.SEARCH)
        assert observation[-1] == step and not terminated
        assert truncated == (step == 9)
    assert info["ending"] == Ending.TIME_LIMIT


@pytest.mark.parametrize(
    ("arguments", "error", "words"),
    [
        ({"n_drones": 2}, ValueError, "n_drones must be 1 in a SingleDroneEnv, got 2; for several"),
        ({"observation": "pixels"}, ValueError, "observation must be one of 'dict', 'flat'"),
        ({"observation": "top-cells", "top_cells": 50}, ValueError, "top_cells must be .* 1 to 49"),
        ({"action_mask": True}, TypeError, "action_mask must be one of None, 'observation', 'inf"),
        ({"separate_flags": 1}, TypeError, "separate_flags must be True or False, got 1"),
        ({"reward_scale": 0}, ValueError, "reward_scale must be a finite number above 0, got 0"),
        ({"speed": 1}, TypeError, "unexpected keyword argument 'speed'"),
    ],
)
def test_wrong_arguments_are_refused(arguments, error, words):
    with pytest.raises(error, match=words):
        SingleDroneEnv(**arguments)


@pytest.mark.parametrize(
    ("action", "error"),
    [(6, ValueError), (-1, ValueError), (2.0, TypeError), (True, TypeError), (None, TypeError)],
)
def test_wrong_actions_are_refused(action, error):
    env = SingleDroneEnv(**SMALL)
    env.reset(seed=0)
    with pytest.raises(error, match=rf"^action must be an integer from 0 to 5, got {action}$"):
        env.step(action)
    assert env.step(np.array(Action.IDLE))[4]["step"] == 1


def test_the_signature_shows_every_keyword():
    shown = inspect.signature(SingleDroneEnv).parameters
    for name, parameter in inspect.signature(DroneSwarmSearch).parameters.items():
        assert name in shown
        if name != "render_mode":
            assert shown[name].default == parameter.default
    defaults = {name: parameter.default for name, parameter in shown.items()}
    assert [*episodes(SingleDroneEnv(**defaults), 2)] == [*episodes(SingleDroneEnv(), 2)]


def test_the_id_with_the_module_needs_no_import():
    program = """
import gymnasium
env = gymnasium.make("DroneSwarmSearch:DroneSwarmSearch-v0", grid_size=5)
envs = gymnasium.make_vec("DroneSwarmSearch:DroneSwarmSearch-v0", num_envs=3, grid_size=5)
print(env.reset(seed=1)[0].shape, envs.reset(seed=1)[0].shape, type(envs).__name__)
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.stdout == "(28,) (3, 28) DroneVectorEnv\n", done.stderr
