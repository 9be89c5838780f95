"""The adapters for Tianshou: the batch in its collectors, masked networks, the success rate."""

import importlib.util
from typing import Any

import numpy as np
import pytest
from helpers import TWO_DRONES

from DroneSwarmSearch.core.rules import Ending
from DroneSwarmSearch.vector import DroneVectorEnv

if importlib.util.find_spec("tianshou") is None:  # the import is slow
    pytest.skip("tianshou is not installed", allow_module_level=True)

import torch
from tianshou.algorithm import DQN, PPO
from tianshou.algorithm.modelfree.dqn import DiscreteQLearningPolicy
from tianshou.algorithm.modelfree.reinforce import DiscreteActorPolicy
from tianshou.algorithm.optim import AdamOptimizerFactory
from tianshou.data import Collector, VectorReplayBuffer
from tianshou.utils.net.common import Net
from tianshou.utils.torch_utils import policy_within_training_step

from DroneSwarmSearch.adapters import TrainedPolicy
from DroneSwarmSearch.adapters.tianshou import (
    DroneVenv,
    MaskedActor,
    MaskedCritic,
    SuccessStats,
    logits,
)

pytestmark = pytest.mark.filterwarnings("default")  # from Tianshou

MASKED = {"observation": "flat", "action_mask": "observation", "right_of_way": True, **TWO_DRONES}

INPUTS = 2 * 2 + 1 + 25


def vector_env(searches: int = 4, **keywords: Any) -> DroneVectorEnv:
    return DroneVectorEnv(searches, autoreset_mode="Disabled", **{**MASKED, **keywords})


def dqn_for(envs: DroneVenv, epsilon: float) -> DQN:
    torch.manual_seed(0)
    np.random.seed(0)
    network = Net(state_shape=INPUTS, action_shape=6, hidden_sizes=[16])
    policy = DiscreteQLearningPolicy(
        model=network, action_space=envs.env.single_action_space, eps_training=epsilon
    )
    return DQN(policy=policy, optim=AdamOptimizerFactory(lr=1e-3), n_step_return_horizon=2)


def ppo_for(envs: DroneVenv) -> PPO:
    torch.manual_seed(0)
    actor, critic = (Net(state_shape=INPUTS, hidden_sizes=[16]) for _ in range(2))
    return PPO(
        policy=DiscreteActorPolicy(
            actor=MaskedActor(preprocess_net=actor), action_space=envs.env.single_action_space
        ),
        critic=MaskedCritic(preprocess_net=critic),
        optim=AdamOptimizerFactory(lr=1e-3),
    )


def collector_of(algorithm: Any, envs: DroneVenv, steps: int = 100) -> Collector[SuccessStats]:
    buffer = VectorReplayBuffer(steps * len(envs), len(envs))
    collector = Collector(
        algorithm, envs, buffer, exploration_noise=True, collect_stats_class=SuccessStats
    )
    collector.reset()
    return collector


def test_a_collector_plays_the_episodes_of_the_vector_environment():
    envs = DroneVenv(vector_env())
    envs.seed(7)
    collector = collector_of(dqn_for(envs, 1.0), envs)
    with policy_within_training_step(collector.policy):
        stats = collector.collect(n_step=90 * 8)
    buffer = collector.buffer
    played = vector_env()
    shown, _ = played.reset(seed=7)
    successes = 0
    for step in range(90):
        index = np.arange(8) * buffer.buffers[0].maxsize + step
        assert buffer.obs.obs[index].tobytes() == shown["observation"].tobytes()
        assert buffer.obs.mask[index].tobytes() == shown["action_mask"].tobytes()
        actions = buffer.act[index].astype(int)
        assert shown["action_mask"][np.arange(8), actions].all()
        shown, rewards, terminated, truncated, infos = played.step(actions)
        assert buffer.obs_next.obs[index].tobytes() == shown["observation"].tobytes()
        assert (buffer.rew[index] == rewards).all()
        assert (buffer.terminated[index] == terminated).all()
        assert (buffer.truncated[index] == truncated).all()
        successes += int((infos["ending"] == Ending.FOUND).sum())
        if terminated.any():
            shown, _ = played.reset(options={"reset_mask": terminated})
    assert successes > 0
    assert sum(stats.successes) == successes
    assert len(stats.successes) == len(stats.probabilities) == stats.n_collected_episodes
    assert 0 < np.mean(stats.probabilities) < 1


def test_some_sub_environments():
    envs = DroneVenv(vector_env())
    envs.reset()
    observations, rewards, terminated, truncated, infos = envs.step([5, 5], [2, 3])
    assert len(observations) == len(rewards) == len(terminated) == len(truncated) == 2
    assert [{*info} for info in infos] == [{"is_success", "probability_of_success"}] * 2
    observations, infos = envs.reset([0, 1, 4, 5, 6, 7])
    assert len(observations) == len(infos) == 6
    assert len(envs.step(np.full(8, 5))[0]) == 8
    with pytest.raises(ValueError, match="id must hold all 2 drones of a swarm or none"):
        envs.step([5], [0])
    with pytest.raises(ValueError, match="env_id must hold all 2 drones of a swarm or none"):
        envs.reset([1, 2])


def test_attributes_and_other_environments():
    envs = DroneVenv(vector_env())
    assert envs.action_space == [envs.env.single_action_space] * 8
    assert envs.get_env_attr("num_envs", [0, 1]) == [8, 8]
    with pytest.raises(ValueError, match="autoreset_mode='Disabled', got 'NextStep'"):
        DroneVenv(DroneVectorEnv(2, **TWO_DRONES))


def test_dqn_and_ppo_learn():
    for make in (lambda envs: dqn_for(envs, 0.5), ppo_for):
        envs = DroneVenv(vector_env())
        algorithm = make(envs)
        collector = collector_of(algorithm, envs)
        before = [each.detach().clone() for each in algorithm.policy.parameters()]
        with policy_within_training_step(algorithm.policy):
            collector.collect(n_step=20 * 8)
            if isinstance(algorithm, PPO):
                algorithm.update(collector.buffer, batch_size=32, repeat=1)
            else:
                algorithm.update(collector.buffer, sample_size=32)
        after = algorithm.policy.parameters()
        assert any((old != new).any() for old, new in zip(before, after, strict=True))


def test_trained_policies_choose_allowed_actions():
    env = vector_env(64)
    envs = DroneVenv(env)
    observations, _ = env.reset(seed=0)
    allowed = observations["action_mask"] == 1
    for algorithm in (ppo_for(envs), dqn_for(envs, 0.0)):
        network = logits(algorithm.policy)
        for deterministic in (False, True):
            actions = TrainedPolicy(network, deterministic)(observations)
            assert actions.shape == (128,) and allowed[np.arange(128), actions].all()
        assert algorithm.policy.training  # as it was
