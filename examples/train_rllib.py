"""Train drones with Ray RLlib's PPO, on one machine or a cluster.

    pip install "DroneSwarmSearchEnvironment[rllib]"
    python examples/train_rllib.py --out runs/rllib
    python examples/train_rllib.py --out runs/rllib2 --num-env-runners 2
    python examples/train_rllib.py --out runs/rllib3 --num-env-runners 32 --address auto

Every drone of every search is a sub-environment, and all share one network. Masks prevent crashes.
By default, everything runs in this process. With env runners, each runs in its own process on any
CPU of the cluster, where this package must be installed; this process trains the network and keeps
the folder.
"""

from __future__ import annotations

import argparse
from os.path import relpath

import ray
import torch
from ray.rllib.algorithms.algorithm import Algorithm
from ray.rllib.algorithms.ppo import PPOConfig
from ray.rllib.core.rl_module.default_model_config import DefaultModelConfig
from ray.rllib.core.rl_module.rl_module import RLModuleSpec
from ray.rllib.utils.metrics import ENV_RUNNER_RESULTS, NUM_ENV_STEPS_SAMPLED_LIFETIME
from training_script import begin, finish

from DroneSwarmSearch import Scenario, training
from DroneSwarmSearch.adapters import TrainedPolicy, rllib
from DroneSwarmSearch.evaluation import View
from DroneSwarmSearch.training import TRAINING_TASK

LAYOUT = "crops"

ENV_CONFIG = {
    **TRAINING_TASK,
    "observation": LAYOUT,
    "right_of_way": True,
    "mission": "coverage",  # nobody is found: a search pays the probability of success it adds
    "shared_reward": True,  # so that drones cooperate
}

DRONES = TRAINING_TASK["n_drones"]


def build_algorithm(options: argparse.Namespace) -> Algorithm:
    network = DefaultModelConfig(
        fcnet_hiddens=[128, 128], fcnet_activation="tanh", vf_share_layers=False
    )
    config = (
        PPOConfig()
        .environment(rllib.DroneBatch, env_config=ENV_CONFIG)
        .env_runners(
            num_env_runners=options.num_env_runners,
            num_envs_per_env_runner=options.num_envs * DRONES,
            gym_env_vectorize_mode="vector_entry_point",
            sample_timeout_s=600,  # a busy machine may need more than the default, a minute
        )
        .rl_module(rl_module_spec=RLModuleSpec(rllib.MaskedPPOModule, model_config=network))
        .training(
            lr=[[0, 1e-3], [options.steps * DRONES, 1e-4]],
            gamma=0.99,
            lambda_=0.95,
            entropy_coeff=0.002,
            use_kl_loss=False,
            grad_clip=0.5,
            train_batch_size_per_learner=options.batch * DRONES,
            minibatch_size=min(1024, options.batch),
            num_epochs=6,
        )
        .callbacks(on_episode_end=rllib.log_success)
        .debugging(seed=options.seed, log_level="ERROR")
    )
    return config.build_algo()


class Trained(TrainedPolicy):
    """The network of a checkpoint, for `evaluate`, `record` and `play`; it samples actions."""

    def __init__(self, scenario: Scenario, checkpoint: str) -> None:
        torch.set_num_threads(1)
        view = View("drone", LAYOUT, action_mask=True, right_of_way=True, bayesian_update=True)
        super().__init__(rllib.logits(checkpoint), view=view)


def train(options: argparse.Namespace) -> None:
    """Train for all steps, and save a checkpoint."""
    checkpoint = options.out.absolute() / "checkpoint"
    algorithm = build_algorithm(options)
    steps = 0
    while steps < options.steps:
        results = algorithm.train()[ENV_RUNNER_RESULTS]
        steps = int(results[NUM_ENV_STEPS_SAMPLED_LIFETIME]) // DRONES  # RLlib counts drones' steps
        if "probability_of_success" in results:
            found = float(results["probability_of_success"])
            training.log_row(options.out / "curve.csv", steps=steps, found=found)
        algorithm.save_to_path(checkpoint)
    algorithm.stop()


def main() -> None:
    number = {"type": int, "metavar": "N"}
    options = begin(
        "Train drones with RLlib's PPO.",
        num_env_runners={"default": 0, "help": "remote env runners", **number},
        num_envs={"default": 64, "help": "searches of each runner", **number},
        batch={"default": 4_096, "help": "environment steps between updates", **number},
        address={"default": "local", "help": "of a Ray cluster; 'auto' for this machine's"},
        steps={"default": 300_000, "help": "environment steps in all", **number},
    )
    torch.set_num_threads(options.threads)
    ray.init(address=options.address, log_to_driver=False, logging_level="error")
    try:
        train(options)
    finally:
        ray.shutdown()
    trained = f"{relpath(__file__)}:Trained:{options.out / 'checkpoint'}"
    finish(trained, "rllib-ppo", options)


if __name__ == "__main__":
    main()
