"""AgileRL: PPO on the batch, and multi-agent algorithms whose drones share networks."""

from __future__ import annotations

import importlib.util
import warnings
from typing import Any

import numpy as np
import pytest
from helpers import TWO_DRONES
from pettingzoo import ParallelEnv

from DroneSwarmSearch import DroneSwarmSearch
from DroneSwarmSearch.adapters.agilerl import SharedNames
from DroneSwarmSearch.vector import DroneVectorEnv
from DroneSwarmSearch.wrappers import ActionMask, FlatObservation, ScaledRewards, SeparateFlags

with warnings.catch_warnings():
    # PettingZoo's tests import one of its environments in a deprecated way.
    warnings.simplefilter("ignore", DeprecationWarning)
    from pettingzoo.test import parallel_api_test

pytestmark = pytest.mark.filterwarnings("default")  # from AgileRL


def needs_agilerl(test: Any) -> Any:
    missing = importlib.util.find_spec("agilerl") is None  # the import is slow
    test = pytest.mark.skipif(missing, reason="agilerl is not installed")(test)
    return pytest.mark.slow(test)


NETWORK = {"encoder_config": {"hidden_size": [16]}, "head_config": {"hidden_size": [16]}}


def wrapped(masked: bool = True) -> ParallelEnv[str, Any, int]:
    """The environment, wrapped as in the documentation for AgileRL."""
    env = FlatObservation(ScaledRewards(SeparateFlags(DroneSwarmSearch(**TWO_DRONES))))
    return SharedNames(ActionMask(env, right_of_way=True) if masked else env)


def spaces_of(env: ParallelEnv[str, Any, int]) -> dict[str, Any]:
    names = env.possible_agents
    return {
        "observation_spaces": [env.observation_space(name) for name in names],
        "action_spaces": [env.action_space(name) for name in names],
        "agent_ids": list(names),
    }


def weights(agent: Any) -> list[np.ndarray]:
    return [
        parameter.detach().cpu().numpy().copy()
        for actor in agent.actors.values()
        for parameter in actor.parameters()
    ]


def changed(before: list[np.ndarray], agent: Any) -> bool:
    after = weights(agent)
    assert all(np.isfinite(each).all() for each in after)
    return any((old != new).any() for old, new in zip(before, after, strict=True))


def test_drones_are_renamed() -> None:
    env, plain = wrapped(), DroneSwarmSearch(**TWO_DRONES)
    parallel_api_test(env, num_cycles=30)
    assert env.possible_agents == ["drone_0", "drone_1"]
    observations, infos = env.reset(seed=3)
    plain.reset(seed=3)
    assert [*observations] == [*infos] == env.agents == env.possible_agents
    assert env.observation_space("drone_1") is env.observation_space("drone_1")
    rng = np.random.default_rng(0)
    while env.agents:
        first, second = rng.integers(6, size=2).tolist()
        _, rewards, *flags, infos = env.step({"drone_0": first, "drone_1": second})
        _, expected, *expected_flags, expected_infos = plain.step(
            {"drone0": first, "drone1": second}
        )
        scale = ScaledRewards(plain).scale
        assert [*rewards.values()] == [value * scale for value in expected.values()]
        assert infos["drone_1"]["is_success"] == expected_infos["drone1"]["is_success"]
        assert all({*flag} == {"drone_0", "drone_1"} for flag in flags)
        ended = any(any(flag.values()) for flag in expected_flags)
        assert any(any(flag.values()) for flag in flags) == ended
    env.reset()
    with pytest.raises(ValueError, match="drone7"):
        env.step({"drone7": 0})


@needs_agilerl
def test_ppo_learns_on_the_batch_and_respects_the_masks() -> None:
    from agilerl.algorithms import PPO
    from agilerl.training.train_on_policy import train_on_policy

    envs = DroneVectorEnv(
        8,
        observation="flat",
        action_mask="info",
        right_of_way=True,
        autoreset_mode="SameStep",
        **TWO_DRONES,
    )
    agent = PPO(
        envs.single_observation_space,
        envs.single_action_space,
        num_envs=16,
        learn_step=128,
        batch_size=64,
        net_config=NETWORK,
    )
    before = [each.detach().numpy().copy() for each in agent.actor.parameters()]
    chosen = []
    step = envs.step
    masks = envs.action_masks

    def checked(actions: Any) -> Any:
        assert masks()[np.arange(16), actions].all()
        chosen.append(actions)
        return step(actions)

    envs.step = checked  # type: ignore[method-assign]
    agents, fitnesses = train_on_policy(
        envs,
        "drone_swarm_search",
        "PPO",
        [agent],
        max_steps=512,
        evo_steps=256,
        eval_steps=12,
        verbose=False,
    )
    after = [each.detach().numpy() for each in agents[0].actor.parameters()]
    assert any((old != new).any() for old, new in zip(before, after, strict=True))
    assert np.isfinite(fitnesses).all() and len(chosen) >= 512 // 16


@needs_agilerl
def test_ippo_learns() -> None:
    from agilerl.algorithms import IPPO
    from agilerl.training.train_multi_agent_on_policy import train_multi_agent_on_policy

    env = wrapped(masked=False)  # IPPO of AgileRL 2.58 fails with any masks
    agent = IPPO(**spaces_of(env), learn_step=48, batch_size=16, net_config=NETWORK)
    before = weights(agent)
    agents, fitnesses = train_multi_agent_on_policy(
        env,
        "drone_swarm_search",
        "IPPO",
        [agent],
        max_steps=96,
        evo_steps=48,
        eval_steps=12,
        eval_loop=1,
        verbose=False,
    )
    assert changed(before, agents[0]) and np.isfinite(fitnesses).all()
    assert [*agents[0].actors] == ["drone"]  # shared


@needs_agilerl
def test_maddpg_learns_and_respects_the_masks() -> None:
    from agilerl.algorithms import MADDPG
    from agilerl.components import ReplayBuffer
    from agilerl.training.train_multi_agent_off_policy import train_multi_agent_off_policy
    from agilerl.vector.pz_async_vec_env import AsyncPettingZooVecEnv

    env = AsyncPettingZooVecEnv([wrapped for _ in range(2)])  # one process each
    try:
        single = wrapped()
        agent = MADDPG(
            **spaces_of(single), vect_noise_dim=2, learn_step=4, batch_size=16, net_config=NETWORK
        )
        before = weights(agent)
        agents, fitnesses = train_multi_agent_off_policy(
            env,
            "drone_swarm_search",
            "MADDPG",
            [agent],
            ReplayBuffer(max_size=200),
            max_steps=96,
            evo_steps=48,
            eval_steps=12,
            eval_loop=1,
            learning_delay=16,
            verbose=False,
        )
        assert changed(before, agents[0]) and np.isfinite(fitnesses).all()
    finally:
        env.close()

    agents[0].set_training_mode(False)  # no noise, whose shape is that of two environments
    observations, infos = single.reset(seed=0)
    masked_out = 0
    while single.agents:
        batch = {name: each[None] for name, each in observations.items()}
        actions = agents[0].get_action(batch, infos=infos)[0]
        chosen = {name: int(np.asarray(each).item()) for name, each in actions.items()}
        for name, action in chosen.items():
            mask = infos[name]["action_mask"]
            assert mask[action]
            masked_out += int((mask == 0).sum())
        observations, _, _, _, infos = single.step(chosen)
    assert masked_out > 0
