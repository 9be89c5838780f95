"""PettingZoo's tests, the spaces, the names, and the side effects of importing."""

import copy
import importlib
import pickle
import random
import subprocess
import sys
import warnings
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces
from helpers import careful_actions
from pettingzoo.utils import parallel_to_aec

import DroneSwarmSearch.env as env_module
from DroneSwarmSearch import (
    Drift,
    DroneSwarmSearch,
    Ending,
    MarkovDrift,
    Person,
    RewardScheme,
)
from DroneSwarmSearch.core import Infos, Rewards
from DroneSwarmSearch.wrappers import FlatObservation

with warnings.catch_warnings():
    # PettingZoo's tests import one of its environments in a deprecated way.
    warnings.filterwarnings("ignore", category=DeprecationWarning)
    from pettingzoo.test import (
        api_test,
        parallel_api_test,
        parallel_seed_test,
        render_test,
        seed_test,
    )

UNCERTAIN = [
    Person([Drift((3, 3), start_sd=1, vector=(0.2, 0.1)), Drift((5, 4), diffusion=0.2)], 0.7),
    Person(Drift(np.eye(7), vector_sd=0.05, diffusion=0.1)),
]
PARAMETERS: dict[str, dict[str, Any]] = {
    "defaults": {},
    "smallest grid, full": {"grid_size": 2, "n_drones": 4},
    "one step": {"n_drones": 2, "timestep_limit": 1},
    "swarm": {"grid_size": 12, "n_drones": 9, "vector": (0.4, 0.7), "timestep_limit": 30},
    "persons": {
        "n_drones": 3,
        "person_initial_position": [(1, 1), (5, 5), (5, 5)],
        "probability_of_detection": [0.2, 0.7, 1.0],
    },
    "posterior": {
        "n_drones": 4,
        "bayesian_update": True,
        "probability_of_detection": 0.6,
        "person_initial_position": [(3, 3), (2, 4)],
    },
    "gale": {"vector": (1e300, -1e300), "grid_size": 9, "person_initial_position": (4, 4)},
    "expected": {"persons": UNCERTAIN, "reward_scheme": RewardScheme.expected()},
    "coverage": {"n_drones": 3, "persons": UNCERTAIN, "mission": "coverage"},
    "shared drift": {
        "n_drones": 3,
        "persons": [UNCERTAIN[0], UNCERTAIN[0]],
        "shared_drift": True,
        "bayesian_update": True,
        "crash": "block",
    },
    "passing": {"grid_size": 3, "n_drones": 5, "crash": "pass", "bayesian_update": True},
    "radio": {
        "n_drones": 4,
        "persons": [UNCERTAIN[0], UNCERTAIN[0]],
        "shared_drift": True,
        "bayesian_update": True,
        "crash": "block",
        "radio_range": 1.5,
    },
    "in flight": {
        "grid_size": 3,
        "n_drones": 4,
        "crash": "pass",
        "radio_range": 0,
        "search_in_flight": True,
        "persons": Person(MarkovDrift((1, 1), np.full((9, 9), 1 / 9)), 0.5),
    },
}

each_parameters = pytest.mark.parametrize("parameters", PARAMETERS.values(), ids=PARAMETERS)

unknown_option_is_warned_about = pytest.mark.filterwarnings(
    "ignore:options may hold .* 'options':UserWarning"
)
other_names_are_recommended = pytest.mark.filterwarnings(
    "ignore:We recommend agents to be named in the format:UserWarning"
)


@unknown_option_is_warned_about
@each_parameters
def test_parallel_api(parameters):
    parallel_api_test(DroneSwarmSearch(**parameters))


@each_parameters
def test_parallel_seed(parameters):
    parallel_seed_test(lambda: DroneSwarmSearch(**parameters))


@unknown_option_is_warned_about
@other_names_are_recommended
@each_parameters
def test_aec_api(parameters):
    env = FlatObservation(DroneSwarmSearch(**parameters))  # it needs arrays
    api_test(parallel_to_aec(env), num_cycles=100)


@each_parameters
def test_aec_seed(parameters):
    seed_test(lambda: env_module.env(**parameters), num_cycles=100)


def test_aec_render(monkeypatch):
    pytest.importorskip("pygame")
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    monkeypatch.setitem(DroneSwarmSearch.metadata, "render_fps", 1000)
    render_test(lambda **mode: env_module.env(grid_size=10, n_drones=2, **mode))


@pytest.mark.thorough
@each_parameters
def test_observations_have_the_documented_form(parameters):
    env = DroneSwarmSearch(**parameters)
    size = env.grid_size
    n_drones = env.n_drones
    rng = random.Random(1)

    def check(observations):
        assert list(observations) == env.possible_agents
        for agent, observation in observations.items():
            assert env.observation_space(agent).contains(observation)
        assert env.state_space.contains(env.state())
        matrix = observations["drone0"]["observation"][1]
        if env.scenario.radio_range is not None:
            matrix = env.frame().matrix
        for (x, y), shown in (observation["observation"] for observation in observations.values()):
            assert type(x) is int and type(y) is int
            assert shown is matrix or env.scenario.radio_range is not None
            assert shown.sum(dtype=np.float64) == pytest.approx(1, abs=1e-5)
        env.state()[:] = 7
        state = env.state()  # a copy
        assert state.dtype == np.float32 and state.shape == (3, size, size)
        np.testing.assert_array_equal(state[0], matrix)
        assert state[1].sum() == n_drones
        for (x, y), _ in (observation["observation"] for observation in observations.values()):
            assert state[1, y, x] >= 1
        frame = env.frame()
        missing = np.zeros((size, size))
        for (x, y), found in zip(frame.persons, frame.found, strict=True):
            missing[y, x] += not found
        np.testing.assert_array_equal(state[2], missing)

    for seed in range(3):
        observations, _ = env.reset(seed=seed)
        check(observations)
        while env.agents:
            observations = env.step(careful_actions(rng, observations, size))[0]
            check(observations)


def test_spaces_are_the_same_objects_at_every_call():
    env = DroneSwarmSearch(n_drones=3)
    agents = env.possible_agents
    before = [*map(env.observation_space, agents), *map(env.action_space, agents), env.state_space]
    env.reset(seed=1, vector=(1, 1))
    after = [*env.observation_spaces.values(), *env.action_spaces.values(), env.state_space]
    assert all(one is other for one, other in zip(before, after, strict=True))
    # Seeding one drone's space must not seed another's.
    assert len({id(space) for space in before}) == len(before)


def test_spaces_match_the_specification():
    env = DroneSwarmSearch(grid_size=5)
    assert env.action_space("drone0") == spaces.Discrete(6)
    assert env.observation_space("drone0") == spaces.Dict(
        {
            "observation": spaces.Tuple(
                (
                    spaces.Tuple((spaces.Discrete(5), spaces.Discrete(5))),
                    spaces.Box(0, 1, (5, 5), np.float32),
                )
            )
        }
    )
    assert env.state_space.shape == (3, 5, 5) and env.state_space.dtype == np.float32


def test_metadata_and_agents():
    metadata = DroneSwarmSearch.metadata
    assert metadata["render_modes"] == ["human", "ansi", "rgb_array"]
    assert metadata["is_parallelizable"] is True
    assert metadata["name"] == "drone_swarm_search_v0"
    env = DroneSwarmSearch(n_drones=3)
    assert env.possible_agents == env.get_agents() == ["drone0", "drone1", "drone2"]
    assert env.max_num_agents == 3
    assert env.agents == [] and env.num_agents == 0
    env.reset()
    env.get_agents().clear()
    env.agents.clear()
    env.reset()
    assert env.agents == env.possible_agents == env.get_agents()


def test_all_names_are_importable_from_everywhere():
    for name in ("DroneSwarmSearch", "DroneSwarmSearch.env", "DroneSwarmSearchEnvironment.env"):
        assert importlib.import_module(name).DroneSwarmSearch is DroneSwarmSearch
    package = importlib.import_module("DroneSwarmSearch")
    forward = importlib.import_module("DroneSwarmSearchEnvironment")
    assert all(getattr(package, name) is getattr(forward, name) for name in package.__all__)


SUBMODULES = """
import sys
import DroneSwarmSearch
assert "DroneSwarmSearch.evaluation" not in sys.modules
for name in "drift evaluation planning policies training vector wrappers".split():
    assert getattr(DroneSwarmSearch, name) is sys.modules["DroneSwarmSearch." + name]
    assert name in dir(DroneSwarmSearch)
assert not hasattr(DroneSwarmSearch, "nothing")
assert not {"stable_baselines3", "torch", "pygame"} & {*sys.modules}
"""


def test_submodules_are_imported_on_access():
    subprocess.run([sys.executable, "-c", SUBMODULES], check=True, timeout=60)


HEADLESS = """
import random, sys
import numpy as np
random.seed(1); np.random.seed(1)
python_state, numpy_state = random.getstate(), np.random.get_state()
import DroneSwarmSearch
from DroneSwarmSearch.env import env
for mode in ("ansi", "human", "rgb_array", None):
    DroneSwarmSearch.DroneSwarmSearch(render_mode=mode)
swarm = DroneSwarmSearch.DroneSwarmSearch(
    n_drones=2, timestep_limit=20, probability_of_detection=0.5, bayesian_update=True
)
for seed in (None, 1):
    swarm.reset(seed=seed)
    while swarm.agents:
        swarm.step({"drone0": 4, "drone1": 5})
        swarm.state(), swarm.render()
swarm.close()
assert not [name for name in sys.modules if name.split(".")[0] == "pygame"], "pygame"
assert random.getstate() == python_state, "random"
for before, after in zip(numpy_state, np.random.get_state()):
    assert np.array_equal(before, after), "numpy.random"
"""


def test_headless_use_is_quiet_and_has_no_side_effects():
    run = subprocess.run(
        [sys.executable, "-W", "error::UserWarning:DroneSwarmSearch", "-c", HEADLESS],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert (run.returncode, run.stdout, run.stderr) == (0, "", "")


def test_an_episode_must_begin_with_a_reset():
    with pytest.raises(gymnasium.error.ResetNeeded) as caught:
        DroneSwarmSearch().step({"drone0": 4})
    assert isinstance(caught.value, RuntimeError)


def last_mappings() -> tuple[Rewards, Infos]:
    """Rewards and infos of a step in which one of three drones finds the person."""
    env = DroneSwarmSearch(n_drones=3, disperse_constant=0, vector=(0, 0))
    env.reset(seed=1)
    _, rewards, _, _, infos = env.step({"drone0": 4, "drone1": 4, "drone2": 5})
    return rewards, infos


VALUES = {"drone0": 20_000.0, "drone1": -100.0, "drone2": 1.0}

FACTS = {
    "Found": True,
    "is_success": True,
    "persons_found": (True,),
    "ending": Ending.FOUND,
    "step": 1,
}

COPIES = {
    "itself": lambda mapping: mapping,
    "copy.copy": copy.copy,
    ".copy()": lambda mapping: mapping.copy(),
    "deepcopy": copy.deepcopy,
    "pickle": lambda mapping: pickle.loads(pickle.dumps(mapping)),
}


@pytest.mark.parametrize("make", COPIES.values(), ids=COPIES)
@pytest.mark.parametrize(
    ("which", "name", "answer", "values"),
    [
        (0, "total_reward", 19_901.0, VALUES),
        *(
            (1, name, answer, {a: {"Found": True, "is_success": True} for a in VALUES})
            for name, answer in FACTS.items()
        ),
    ],
    ids=["total_reward", *FACTS],
)
def test_mappings_look_up_further_names_without_listing_them(which, name, answer, values, make):
    mapping = make(last_mappings()[which])
    assert isinstance(mapping, dict)
    # Look-up finds the further name ...
    assert mapping[name] == answer
    assert mapping.get(name) == mapping.get(name, "default") == answer
    assert name in mapping
    # ... but nothing lists it.
    assert list(mapping) == list(mapping.keys()) == list(values)
    assert len(mapping) == len(values)
    assert list(mapping.values()) == list(values.values())
    assert list(mapping.items()) == list(values.items())
    assert mapping == dict(mapping) == {**mapping} == values
    # Other names are those of a dict.
    assert "drone0" in mapping and "drone9" not in mapping
    assert mapping.get("drone9") is None and mapping.get("drone9", 7) == 7
    with pytest.raises(KeyError, match="drone9"):
        mapping["drone9"]


def test_values_set_in_a_mapping_are_returned():
    rewards, infos = last_mappings()
    assert infos.pop("Found", None) is True and rewards.pop("total_reward") == 19_901.0
    rewards["drone0"] = 5.0
    assert rewards["total_reward"] == -94.0
    del rewards["drone1"]
    assert rewards["total_reward"] == 6.0
    for info in infos.values():
        info["Found"] = False
    assert infos["Found"] is False
    infos["drone2"]["Found"] = True
    assert infos["Found"] is True


def test_what_reset_returns_looks_up_drones():
    start = copy.deepcopy(DroneSwarmSearch(n_drones=2).reset(seed=1))
    observations, infos = start
    assert isinstance(start, tuple) and len(start) == 2 and list(start) == [*start]
    assert start[0] is observations and start[-1] is infos and start[:1] == (observations,)
    assert start["drone1"] is observations["drone1"]
    assert dict(start.items()) == dict(zip(start.keys(), start.values(), strict=True))
    assert list(start.keys()) == ["drone0", "drone1"]
    assert "drone1" in start and "drone2" not in start and infos in start
    with pytest.raises(KeyError, match="drone2"):
        start["drone2"]
    with pytest.raises(IndexError):
        start[2]


def test_infos_state_the_facts_of_the_episode():
    env = DroneSwarmSearch(
        n_drones=2, person_initial_position=[(0, 0), (6, 6)], disperse_constant=0, vector=(0, 0)
    )

    def facts(infos: Infos) -> dict[str, object]:
        return {name: infos[name] for name in FACTS}

    def everyone(found: bool) -> dict[str, dict[str, bool]]:
        return {agent: {"Found": found, "is_success": False} for agent in env.possible_agents}

    nobody = {"Found": False, "persons_found": (False, False)}
    first = {**nobody, "is_success": False, "ending": None, "step": 0}
    _, before = env.reset(seed=1)
    assert before == everyone(False) and facts(before) == first
    infos = env.step({"drone0": 4, "drone1": 5})[4]
    found = {**first, "Found": True, "persons_found": (True, False), "step": 1}
    assert infos == everyone(True) and facts(infos) == found
    assert facts(env.step({"drone0": 5, "drone1": 5})[4]) == {**found, "step": 2}
    assert facts(env.step({"drone0": 2, "drone1": 5})[4]) == {
        **found,
        "ending": Ending.LEFT_GRID,
        "step": 3,
    }
    _, infos = env.reset()
    assert facts(infos) == facts(before) == first
