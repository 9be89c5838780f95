"""The wrappers: PettingZoo's tests, equality with the batched views, and stacks of wrappers."""

import copy
import pickle
import warnings
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pytest
from crowded_searches import SEVERAL_PERSONS as MISSION
from crowded_searches import SMALL
from gymnasium import spaces
from helpers import SCHEME_NAMES, SCHEMES, plain
from hypothesis import given, settings
from hypothesis import strategies as st
from pettingzoo import ParallelEnv
from pettingzoo.utils import BaseParallelWrapper, parallel_to_aec

import DroneSwarmSearch.wrappers as all_wrappers
from DroneSwarmSearch import Action, DroneSwarmSearch, ResetNeeded
from DroneSwarmSearch.core import Infos
from DroneSwarmSearch.vector import DroneVectorEnv
from DroneSwarmSearch.wrappers import (
    ActionMask,
    CropsObservation,
    DictObservation,
    FlatObservation,
    OtherDrones,
    PlanesObservation,
    ScaledRewards,
    SeparateFlags,
    TopCellsObservation,
    action_masks,
)

with warnings.catch_warnings():
    # PettingZoo's tests import one of its environments in a deprecated way.
    warnings.filterwarnings("ignore", category=DeprecationWarning)
    from pettingzoo.test import parallel_api_test, parallel_seed_test

Wrap = Callable[[Any], Any]


def masked(env: Any) -> ActionMask:
    return ActionMask(env, in_observation=True, right_of_way=True)


def usual(env: Any) -> ActionMask:
    """The usual stack."""
    return ActionMask(FlatObservation(ScaledRewards(SeparateFlags(env))), in_observation=True)


LAYOUTS: dict[str, Wrap] = {
    "dict": DictObservation,
    "flat": FlatObservation,
    "planes": PlanesObservation,
    "top-cells": TopCellsObservation,
    "crops": CropsObservation,
}
WRAPPERS: dict[str, Wrap] = {
    **LAYOUTS,
    "channels last": lambda env: PlanesObservation(env, channels_last=True),
    "others": OtherDrones,
    "scaled": ScaledRewards,
    "separate": SeparateFlags,
    "mask": ActionMask,
    "mask in observation": masked,
    "usual stack": usual,
    "others in dict": lambda env: OtherDrones(DictObservation(ActionMask(env))),
    "mask around others": lambda env: masked(OtherDrones(env)),
}

ALONE: dict[str, Any] = {**SMALL, "grid_size": 3, "n_drones": 1, "bayesian_update": True}
CASES = [SMALL, ALONE, MISSION]

each_wrapper = pytest.mark.parametrize("wrap", WRAPPERS.values(), ids=WRAPPERS)
each_layout = pytest.mark.parametrize(("layout", "wrap"), LAYOUTS.items(), ids=LAYOUTS)
each_case = pytest.mark.parametrize("case", CASES, ids=["small", "alone", "mission"])

unknown_option_is_warned_about = pytest.mark.filterwarnings(
    "ignore:options may hold .* 'options':UserWarning"
)
other_names_are_recommended = pytest.mark.filterwarnings(
    "ignore:We recommend agents to be named in the format:UserWarning"
)


def random_action(rng: np.random.Generator) -> int:
    """An action; moves are rare, since they end most episodes."""
    return int(rng.choice(len(Action), p=[0.02, 0.06, 0.02, 0.06, 0.44, 0.4]))


def episodes(env: Any, seeds: range, policy_seed: int = 0) -> list[Any]:
    """Everything that some episodes return, as plain data."""
    rng = np.random.default_rng(policy_seed)
    log = []
    for seed in seeds:
        log.append(plain(env.reset(seed=seed)))
        while env.agents:
            actions = {agent: random_action(rng) for agent in env.agents}
            log.append(plain(env.step(actions)))
    return log


@unknown_option_is_warned_about
@each_wrapper
def test_parallel_api_and_seed(wrap):
    parallel_api_test(wrap(DroneSwarmSearch(**SMALL)))
    parallel_seed_test(lambda: wrap(DroneSwarmSearch(**MISSION)))


@each_wrapper
@each_case
def test_spaces_contain_every_observation_and_do_not_change(wrap, case):
    env = wrap(DroneSwarmSearch(**case))
    agents = env.possible_agents
    before = [env.observation_space(agent) for agent in agents]
    assert len({id(space) for space in before}) == len(agents)  # each has a separate seed
    assert [env.action_spaces[agent] for agent in agents] == [spaces.Discrete(6)] * len(agents)
    rng = np.random.default_rng(1)
    for seed in range(3):
        observations, infos = env.reset(seed=seed)
        while True:
            assert list(observations) == list(infos) == agents
            for agent in agents:
                assert observations[agent] in env.observation_space(agent)
            if not env.agents:
                break
            actions = {agent: random_action(rng) for agent in env.agents}
            observations, *_, infos = env.step(actions)
    assert all(
        env.observation_space(agent) is space is env.observation_spaces[agent]
        for agent, space in zip(agents, before, strict=True)
    )
    for space in before:
        assert space.sample() in space


@each_wrapper
@pytest.mark.parametrize(
    "way", [lambda env: pickle.loads(pickle.dumps(env)), copy.deepcopy], ids=["pickle", "copy"]
)
def test_copies_continue_identically(wrap, way):
    env = wrap(DroneSwarmSearch(**MISSION))
    untouched = way(env)
    assert episodes(untouched, range(2)) == episodes(env, range(2))
    env.reset(seed=7)
    idle = dict.fromkeys(env.agents, Action.IDLE)
    env.step(idle)
    other = way(env)
    log = [plain(other.step(idle)), plain(other.reset())]
    assert [plain(env.step(idle)), plain(env.reset())] == log


@each_layout
def test_observations_are_writable(layout, wrap):
    """Observations share no memory with the environment or with each other."""
    env, other = (masked(wrap(DroneSwarmSearch(**SMALL))) for _ in range(2))
    results = env.reset(seed=1), other.reset(seed=1)
    while other.agents:
        for agent in other.possible_agents:
            mine, theirs = (result[0][agent] for result in results)
            assert plain(mine) == plain(theirs)
            info, also = (result[-1][agent] for result in results)
            shown = mine["observation"]
            for array in (*(shown.values() if isinstance(shown, dict) else [shown]), info):
                if isinstance(array, np.ndarray):
                    array[...] = 3
            mine["action_mask"][...] = 3
            assert plain(info) == plain(also)
            info["action_mask"][...] = 5
        idle = dict.fromkeys(other.agents, Action.IDLE)
        results = env.step(idle), other.step(idle)


@each_wrapper
def test_reset_accepts_the_environments_arguments(wrap):
    cells = [(3, 3), (0, 1), (2, 2)]
    vector = (-0.4, 0.9)
    env = wrap(DroneSwarmSearch(**SMALL))
    shown = plain(env.reset(2, {"drones_positions": cells, "vector": vector}))
    assert shown == plain(env.reset(seed=2, drones_positions=cells, vector=vector))
    assert shown != plain(env.reset(seed=2))
    assert env.vector == vector
    with pytest.warns(UserWarning, match="ignored: 'speed'"):
        env.reset(options={"speed": 3})


@each_wrapper
def test_other_attributes_are_the_environments(wrap):
    inner = DroneSwarmSearch(**SMALL)
    env = wrap(inner)
    assert isinstance(env, BaseParallelWrapper)
    assert env.unwrapped is inner
    assert env.metadata is inner.metadata
    assert (env.grid_size, env.n_drones, env.render_mode) == (4, 3, "ansi")
    assert (env.max_num_agents, env.num_agents) == (3, 0)
    env.reset(seed=1)
    assert env.scenario is inner.scenario
    assert plain(env.state()) == plain(inner.state())
    assert env.state_space is inner.state_space
    assert env.render() == inner.render()
    assert env.agents == inner.agents == env.possible_agents == env.get_agents()
    for agent in ("drone3", None):
        with pytest.raises(KeyError):
            env.observation_space(agent)
    env.close()


def classes() -> list[type[Any]]:
    exported = [getattr(all_wrappers, name) for name in all_wrappers.__all__]
    return [each for each in exported if isinstance(each, type)]


@pytest.mark.parametrize("wrapper", classes())
def test_other_environments_are_rejected(wrapper):
    class Other(ParallelEnv):
        possible_agents: list[str] = []  # noqa: RUF012

    for other in (Other(), parallel_to_aec(DroneSwarmSearch()), None, DroneSwarmSearch):
        with pytest.raises(TypeError, match="env must be a DroneSwarmSearch, or a parallel wrap"):
            wrapper(other)


@pytest.mark.thorough
@each_layout
@settings(max_examples=12)
@given(
    case=st.sampled_from(CASES),
    seed=st.integers(0, 2**64),
    policy_seed=st.integers(0, 2**16),
    own_limit=st.integers(1, 12),
)
def test_layouts_equal_the_batched_views(layout, wrap, case, seed, policy_seed, own_limit):
    """Observations, rewards and flags of several episodes, to the last bit."""
    case = {**case, "timestep_limit": own_limit}
    env = wrap(ScaledRewards(SeparateFlags(DroneSwarmSearch(**case))))
    view = DroneVectorEnv(
        2,
        observation=layout,
        separate_flags=True,
        reward_scale=2**-17,
        autoreset_mode="Disabled",
        **case,
    )
    agents = env.possible_agents
    n = env.n_drones
    rng = np.random.default_rng(policy_seed)
    assert env.observation_space(agents[-1]) == view.single_observation_space

    def check(shown: Mapping[str, Any], batch: Any) -> None:
        for index, agent in enumerate(agents):
            seen = shown[agent]
            if layout == "dict":
                assert plain(seen) == plain({key: array[index] for key, array in batch.items()})
            else:
                assert plain(seen) == plain(batch[index])

    for episode in range(3):
        seeds = [seed, 1] if episode == 0 else None
        check(env.reset(seed=seed if episode == 0 else None)[0], view.reset(seed=seeds)[0])
        while env.agents:
            actions = [random_action(rng) for _ in agents]
            shown, rewards, *flags, _ = env.step(dict(zip(agents, actions, strict=True)))
            ended = view.batch.ended.repeat(n)
            if ended.any():
                view.reset(options={"reset_mask": ended})
            batch, paid, *ended, _ = view.step(np.array([*actions, *[Action.IDLE] * n]))
            check(shown, batch)
            assert list(rewards.values()) == paid[:n].tolist()
            for mine, theirs in zip(flags, ended, strict=True):
                assert list(mine.values()) == theirs[:n].tolist()


@pytest.mark.parametrize("inner", [lambda env: env, DictObservation], ids=["plain", "dict"])
@each_case
def test_other_drones_are_added(inner, case):
    env = OtherDrones(inner(DroneSwarmSearch(**case)))
    plainly = inner(DroneSwarmSearch(**case))
    agents = env.possible_agents
    rng = np.random.default_rng(1)
    for seed in range(4):
        shown = env.reset(seed=seed)[0]
        wanted = plainly.reset(seed=seed)[0]
        while True:
            cells = dict(zip(agents, env.frame().drones, strict=True))
            for agent in agents:
                others = [cells[other] for other in agents if other != agent]
                added = np.array(others, np.int32).reshape(-1, 2)
                assert plain(shown[agent]) == plain({**wanted[agent], "other_drones": added})
            if not env.agents:
                break
            actions = {agent: random_action(rng) for agent in agents}
            shown = env.step(actions)[0]
            wanted = plainly.step(actions)[0]


@pytest.mark.parametrize("scheme", SCHEMES, ids=SCHEME_NAMES)
@pytest.mark.parametrize(("seed", "scale"), [(0, 2.0**-40), (1, 2.0**40)])
def test_scaled_rewards_can_be_scaled_back_to_the_last_bit(scheme, seed, scale):
    env = ScaledRewards(DroneSwarmSearch(reward_scheme=scheme, **MISSION), scale)
    plainly = DroneSwarmSearch(reward_scheme=scheme, **MISSION)
    rng = np.random.default_rng(0)
    env.reset(seed=seed)
    plainly.reset(seed=seed)
    while env.agents:
        actions = {agent: random_action(rng) for agent in env.agents}
        rewards = env.step(actions)[1]
        wanted = plainly.step(actions)[1]
        assert {agent: reward / scale for agent, reward in rewards.items()} == wanted
        assert rewards["total_reward"] / scale == wanted["total_reward"]


@pytest.mark.parametrize(("scale", "error"), [(0, ValueError), ("1", TypeError)])
def test_invalid_scales_are_rejected(scale, error):
    with pytest.raises(error, match="scale must be a finite number above 0, got"):
        ScaledRewards(DroneSwarmSearch(), scale)


@pytest.mark.parametrize("right_of_way", [False, True])
@each_case
def test_masks_are_those_of_the_cells(case, right_of_way):
    env = ActionMask(DroneSwarmSearch(**case), in_observation=True, right_of_way=right_of_way)
    plainly = DroneSwarmSearch(**case)
    size = env.grid_size
    agents = env.possible_agents
    rng = np.random.default_rng(3)
    for seed in range(5):
        shown, infos = env.reset(seed=seed)
        wanted, plain_infos = plainly.reset(seed=seed)
        while True:
            cells = [y * size + x for x, y in env.frame().drones]
            masks = action_masks(cells, size, right_of_way).astype(np.int8)
            assert isinstance(infos, Infos)
            assert infos["Found"] == plain_infos["Found"]
            for agent, mask in zip(agents, masks, strict=True):
                assert plain(shown[agent]["action_mask"]) == plain(mask)
                assert plain(shown[agent]["observation"]) == plain(wanted[agent])
                assert plain(infos[agent]) == plain({**plain_infos[agent], "action_mask": mask})
            if not env.agents:
                break
            actions = {agent: random_action(rng) for agent in agents}
            shown, *_, infos = env.step(actions)
            wanted, *_, plain_infos = plainly.step(actions)


def test_masks_require_a_reset_and_boolean_flags():
    with pytest.raises(ResetNeeded, match=r"call reset\(\) first"):
        ActionMask(DroneSwarmSearch()).action_masks()
    for name in ("in_observation", "right_of_way"):
        with pytest.raises(TypeError, match=f"{name} must be True or False, got 1"):
            ActionMask(DroneSwarmSearch(), **{name: 1})


# Conversions by other packages.


@each_wrapper
def test_returned_values_never_change(wrap):
    env = wrap(DroneSwarmSearch(**MISSION))
    results: list[Any] = [env.reset(seed=3)]
    as_it_was = [plain(results[0])]
    while env.agents:
        results.append(env.step(dict.fromkeys(env.agents, Action.SEARCH)))
        as_it_was.append(plain(results[-1]))
    assert [plain(result) for result in results] == as_it_was


def test_channels_last_transposes_the_planes():
    first = PlanesObservation(DroneSwarmSearch(**SMALL))
    last = PlanesObservation(DroneSwarmSearch(**SMALL), channels_last=True)
    assert last.observation_space("drone0").shape == (4, 4, 4)
    shown, _ = first.reset(seed=2)
    turned, _ = last.reset(seed=2)
    for drone, planes in shown.items():
        assert plain(np.moveaxis(planes, 0, -1)) == plain(turned[drone])
    with pytest.raises(TypeError, match="channels_last must be True or False, got 1"):
        PlanesObservation(DroneSwarmSearch(**SMALL), channels_last=1)  # type: ignore[arg-type]
