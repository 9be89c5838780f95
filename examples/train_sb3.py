"""Train drones with MaskablePPO of sb3-contrib, on a batch of searches.

    pip install "DroneSwarmSearchEnvironment[sb3]"
    python examples/train_sb3.py --out runs/sb3

Every drone of every search is a sub-environment, and all share one network. Masks prevent crashes.
The drones train in the coverage mission: nobody is found, and a search pays the swarm the
probability of success that it adds, so that chance finds add no noise. They are then evaluated in
searches for a person.
"""

from __future__ import annotations

import argparse
from os.path import relpath

import torch
from sb3_contrib import MaskablePPO
from stable_baselines3.common.callbacks import CheckpointCallback
from stable_baselines3.common.logger import CSVOutputFormat, Logger
from stable_baselines3.common.vec_env import VecMonitor
from training_script import begin, finish

from DroneSwarmSearch.adapters.sb3 import LogSuccess, SB3Policy, SB3VecEnv
from DroneSwarmSearch.evaluation import View
from DroneSwarmSearch.training import TRAINING_TASK
from DroneSwarmSearch.vector import DroneVectorEnv

DRONES = TRAINING_TASK["n_drones"]

# searches, and steps of each between two updates
NUM_SWARMS = 100
NUM_STEPS = 50

SETTINGS = {
    "n_steps": NUM_STEPS,
    "batch_size": 1000,
    "n_epochs": 4,
    "learning_rate": lambda remaining: 2e-3 * remaining,  # falls to 0 at the end
    "gamma": 0.99,
    "gae_lambda": 0.95,
    "ent_coef": 0.002,
    "policy_kwargs": {"net_arch": [128, 128]},
    "device": "cpu",
}


class Trained(SB3Policy):
    """A trained model, for the command line: examples/train_sb3.py:Trained:model.zip."""

    view = View("drone", "crops", action_mask=True, right_of_way=True, bayesian_update=True)


def make_env() -> VecMonitor:
    """A batch of searches for Stable-Baselines3; each sub-environment is one drone."""
    drones = DroneVectorEnv(
        NUM_SWARMS,
        observation="crops",
        right_of_way=True,
        autoreset_mode="SameStep",
        mission="coverage",
        shared_reward=True,  # so that drones cooperate
        **TRAINING_TASK,
    )
    return VecMonitor(SB3VecEnv(drones))


def train(options: argparse.Namespace) -> None:
    """Train for all steps that are left, and save the model."""
    env = make_env()
    folder = options.out
    if options.resume:
        newest = max(folder.glob("model*.zip"), key=lambda path: path.stat().st_mtime)
        model = MaskablePPO.load(newest, env, device="cpu")
        model.set_random_seed(options.seed + model.num_timesteps)  # plays new episodes
    else:
        model = MaskablePPO("MlpPolicy", env, seed=options.seed, **SETTINGS)
    # Stable-Baselines3 counts the steps of single drones.
    csv = CSVOutputFormat(str(folder / f"progress_{model.num_timesteps:09}.csv"))
    model.set_logger(Logger(None, [csv]))
    callbacks = [LogSuccess(), CheckpointCallback(10 * NUM_STEPS, str(folder), "model")]
    remaining = options.steps * DRONES - model.num_timesteps
    if remaining > 0:
        model.learn(remaining, callbacks, reset_num_timesteps=not options.resume)
    model.save(folder / "model.zip")


def main() -> None:
    options = begin(
        "Train drones with MaskablePPO of sb3-contrib.",
        "model*.zip",
        steps={"type": int, "default": 400_000, "help": "environment steps in all"},
    )
    torch.set_num_threads(options.threads)
    train(options)
    finish(
        f"{relpath(__file__)}:Trained:{options.out / 'model.zip'}",  # samples, as in training
        "maskable-ppo",
        options,
        *sorted(options.out.glob("progress_*.csv")),
        steps="time/total_timesteps",
        columns=["rollout/probability_of_success"],
    )


if __name__ == "__main__":
    main()
