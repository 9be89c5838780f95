"""Train drones with Tianshou's PPO.

    pip install "DroneSwarmSearchEnvironment[tianshou]"
    python examples/train_tianshou.py --out runs/tianshou

Every drone of every search is a sub-environment, and all share one network. Masks prevent crashes.
"""

from __future__ import annotations

import argparse

from DroneSwarmSearch import training

training.exit_on_interrupt(__name__)  # also during the imports below

import numpy as np
import torch
from tianshou.algorithm import PPO
from tianshou.algorithm.modelfree.reinforce import DiscreteActorPolicy
from tianshou.algorithm.optim import AdamOptimizerFactory
from tianshou.data import Collector, VectorReplayBuffer
from tianshou.utils.net.common import Net
from tianshou.utils.torch_utils import policy_within_training_step

from DroneSwarmSearch.adapters import tianshou
from DroneSwarmSearch.evaluation import View
from DroneSwarmSearch.training import TRAINING_TASK
from DroneSwarmSearch.vector import DroneVectorEnv

CHECKPOINT = "model.pt"

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


def train(options: argparse.Namespace) -> PPO:
    """Train for all steps; returns the algorithm."""
    with training.Run(options, "PPO of Tianshou", CHECKPOINT) as run:

        def save(steps: int) -> None:
            with run.saving(CHECKPOINT) as path:
                torch.save({"steps": steps, "ppo": ppo.state_dict()}, path)

        seed = options.seed + run.steps_done  # a resumed run plays new episodes
        torch.manual_seed(seed)
        np.random.seed(seed)  # for the order of minibatches
        envs = make_envs(options.num_envs)
        envs.seed(seed)
        ppo = make_ppo(envs)
        if run.resuming:
            checkpoint = torch.load(run.checkpoint)
            ppo.load_state_dict(checkpoint["ppo"])
            run.resume_from(checkpoint["steps"])
        else:
            save(0)
        buffer = VectorReplayBuffer(ROLLOUT * len(envs), len(envs))
        collector = Collector(ppo, envs, buffer, collect_stats_class=tianshou.SuccessStats)
        collector.reset()
        while run.steps_done < run.total_steps:
            with policy_within_training_step(ppo.policy):
                stats = collector.collect(n_step=ROLLOUT * len(envs))
                ppo.update(buffer, batch_size=1024, repeat=6)
            collector.reset_buffer(keep_statistics=True)
            steps = run.steps_done + stats.n_collected_steps // DRONES
            save(steps)
            if stats.n_collected_episodes:
                run.log(steps, np.mean(stats.returns), np.mean(stats.probabilities))
            else:
                run.log(steps)
    return ppo


def main() -> None:
    parser = training.arguments(__doc__, steps=300_000, short=2_000)
    parser.add_argument(
        "--num-envs", metavar="N", type=int, default=64, help="searches in the batch (64)"
    )
    options = parser.parse_args()
    torch.set_num_threads(options.threads)
    ppo = train(options)
    training.compare_with_baselines(
        tianshou.TrainedPolicy(ppo.policy),  # samples actions, as in training
        TRAINING_TASK,
        view=View("drone", LAYOUT, action_mask=True, right_of_way=True),
        episodes=options.episodes,
        name="tianshou-ppo",
        folder=options.out,
    )


if __name__ == "__main__":
    main()
