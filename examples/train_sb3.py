"""Train drones with MaskablePPO of sb3-contrib, on a batch of searches.

    pip install "DroneSwarmSearchEnvironment[sb3]"
    python examples/train_sb3.py --out runs/sb3

Every drone of every search is a sub-environment, and all share one network. Masks prevent crashes.
The drones train in the coverage mission: nobody is found, and a search pays the swarm the
probability of success that it adds, so that chance finds add no noise. They are then evaluated in
searches for a person.
"""

from __future__ import annotations

from DroneSwarmSearch import training

training.exit_on_interrupt(__name__)  # also during the imports below

import torch
from sb3_contrib import MaskablePPO
from stable_baselines3.common.vec_env import VecMonitor

from DroneSwarmSearch.adapters.sb3 import RunCallback, SB3VecEnv, TrainedPolicy
from DroneSwarmSearch.evaluation import View
from DroneSwarmSearch.training import TRAINING_TASK
from DroneSwarmSearch.vector import DroneVectorEnv

DRONES = TRAINING_TASK["n_drones"]

NUM_SWARMS, NUM_STEPS = 100, 50  # searches, and steps of each between two updates

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


def train(run: training.Run, seed: int) -> MaskablePPO:
    """Train for all steps that are left; returns the model."""
    env = make_env()
    seed += run.steps_done  # a resumed run plays new episodes
    if run.resuming:
        model = MaskablePPO.load(run.checkpoint, env, seed=seed, device="cpu")
        run.resume_from(model.num_timesteps // DRONES)
    else:
        model = MaskablePPO("MlpPolicy", env, seed=seed, **SETTINGS)
    remaining = run.total_steps - run.steps_done
    if remaining > 0:  # Stable-Baselines3 counts the steps of single drones
        model.learn(remaining * DRONES, RunCallback(run), reset_num_timesteps=not run.resuming)
    return model


def main() -> None:
    parser = training.arguments(__doc__, steps=400_000, short=NUM_SWARMS * NUM_STEPS)
    options = parser.parse_args()
    torch.set_num_threads(options.threads)
    with training.Run(options, "MaskablePPO of sb3-contrib", "model.zip") as run:
        model = train(run, options.seed)
    training.compare_with_baselines(
        TrainedPolicy(model),  # samples actions, as in training
        TRAINING_TASK,
        view=View("drone", "crops", action_mask=True, right_of_way=True),
        episodes=options.episodes,
        name="maskable-ppo",
        folder=options.out,
    )


if __name__ == "__main__":
    main()
