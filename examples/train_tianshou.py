"""Train drones with Tianshou's PPO.

    pip install "DroneSwarmSearchEnvironment[tianshou]"
    python examples/train_tianshou.py --out runs/tianshou

Every drone of every search is a sub-environment, and all share one network. Masks prevent crashes.
"""

from __future__ import annotations

import argparse
from os.path import relpath

import numpy as np
import torch
from tianshou.algorithm import PPO
from tianshou.algorithm.modelfree.reinforce import DiscreteActorPolicy
from tianshou.algorithm.optim import AdamOptimizerFactory
from tianshou.data import Collector, VectorReplayBuffer
from tianshou.utils.net.common import Net
from tianshou.utils.torch_utils import policy_within_training_step
from training_script import begin, finish

from DroneSwarmSearch import Scenario, training
from DroneSwarmSearch.adapters import TrainedPolicy, tianshou
from DroneSwarmSearch.evaluation import View
from DroneSwarmSearch.training import TRAINING_TASK
from DroneSwarmSearch.vector import DroneVectorEnv

DRONES = TRAINING_TASK["n_drones"]

LAYOUT = "crops"

ROLLOUT = 64  # steps of each drone between updates


def make_envs(searches: int) -> tianshou.DroneVenv:
    """A batch of searches for Tianshou; each sub-environment is one drone."""
    return tianshou.DroneVenv(
        DroneVectorEnv(
            searches,
            observation=LAYOUT,
            action_mask="observation",
            right_of_way=True,
            autoreset_mode="Disabled",  # Tianshou resets
            mission="coverage",  # nobody is found: a search pays the probability of success
            shared_reward=True,  # so that drones cooperate
            **TRAINING_TASK,
        )
    )


def make_ppo(envs: tianshou.DroneVenv) -> PPO:
    """PPO with separate networks for the policy and the values."""
    inputs = envs.env.single_observation_space["observation"].shape[0]

    def network() -> Net:
        return Net(state_shape=inputs, hidden_sizes=[128, 128], activation=torch.nn.Tanh)

    actor = tianshou.MaskedActor(preprocess_net=network())
    return PPO(
        policy=DiscreteActorPolicy(actor=actor, action_space=envs.env.single_action_space),
        critic=tianshou.MaskedCritic(preprocess_net=network()),
        optim=AdamOptimizerFactory(lr=5e-4),
        gamma=0.99,
        gae_lambda=0.95,
        ent_coef=0.002,
        max_grad_norm=0.5,
        max_batchsize=4096,
        advantage_normalization=True,
    )


class Trained(TrainedPolicy):
    """The saved network, for `evaluate`, `record` and `play`; it samples actions."""

    def __init__(self, scenario: Scenario, path: str) -> None:
        torch.set_num_threads(1)
        ppo = make_ppo(make_envs(1))
        ppo.load_state_dict(torch.load(path))
        view = View("drone", LAYOUT, action_mask=True, right_of_way=True, bayesian_update=True)
        super().__init__(tianshou.logits(ppo.policy), view=view)


def train(options: argparse.Namespace) -> None:
    """Train for all steps, and save the network."""
    torch.manual_seed(options.seed)
    np.random.seed(options.seed)  # for the order of minibatches
    envs = make_envs(options.num_envs)
    envs.seed(options.seed)
    ppo = make_ppo(envs)
    buffer = VectorReplayBuffer(ROLLOUT * len(envs), len(envs))
    collector = Collector(ppo, envs, buffer, collect_stats_class=tianshou.SuccessStats)
    collector.reset()
    steps = 0
    while steps < options.steps:
        with policy_within_training_step(ppo.policy):
            stats = collector.collect(n_step=ROLLOUT * len(envs))
            ppo.update(buffer, batch_size=1024, repeat=6)
        collector.reset_buffer(keep_statistics=True)
        steps += stats.n_collected_steps // DRONES
        if stats.probabilities:
            found = float(np.mean(stats.probabilities))
            training.log_row(options.out / "curve.csv", steps=steps, found=found)
        torch.save(ppo.state_dict(), options.out / "model.pt")


def main() -> None:
    options = begin(
        "Train drones with Tianshou's PPO.",
        num_envs={"type": int, "default": 64, "help": "searches in the batch"},
        steps={"type": int, "default": 300_000, "help": "environment steps in all"},
    )
    torch.set_num_threads(options.threads)
    train(options)
    trained = f"{relpath(__file__)}:Trained:{options.out / 'model.pt'}"
    finish(trained, "tianshou-ppo", options)


if __name__ == "__main__":
    main()
