"""AgileRL trains on the wrapped environment without an adapter."""

from __future__ import annotations

import importlib.util
from typing import Any

import numpy as np
import pytest
from pettingzoo import ParallelEnv

from DroneSwarmSearch import DroneSwarmSearch
from DroneSwarmSearch.wrappers import ActionMask, FlatObservation, ScaledRewards, SeparateFlags

if importlib.util.find_spec("agilerl") is None:  # the import is slow
    pytest.skip("agilerl is not installed", allow_module_level=True)

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("default")]  # from AgileRL

SMALL: dict[str, Any] = {
    "grid_size": 5,
    "n_drones": 2,
    "vector": (0.1, 0.1),
    "person_initial_position": (2, 2),
    "disperse_constant": 2,
    "timestep_limit": 12,
    "bayesian_update": True,
}

NETWORK = {"encoder_config": {"hidden_size": [16]}, "head_config": {"hidden_size": [16]}}


def wrapped(masked: bool = True) -> ParallelEnv[str, Any, int]:
    """The environment, wrapped as in the documentation for AgileRL."""
    env = FlatObservation(ScaledRewards(SeparateFlags(DroneSwarmSearch(**SMALL))))
    return ActionMask(env, right_of_way=True) if masked else env


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
