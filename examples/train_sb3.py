"""Train drones with Stable-Baselines3's PPO, and compare them with the baselines.

    python examples/train_sb3.py --out runs/sb3

All drones share one policy, and each one's observation is its own. The searches run as a batch;
`--supersuit` steps single environments through the wrappers and SuperSuit instead. `--mask` uses
MaskablePPO of sb3-contrib, with masks that prevent crashes.
"""

from __future__ import annotations

import argparse
from typing import Any

import numpy as np
from numpy.typing import NDArray
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.utils import set_random_seed
from stable_baselines3.common.vec_env import VecEnv, VecMonitor

from DroneSwarmSearch import DroneSwarmSearch, RewardScheme, training
from DroneSwarmSearch.adapters.sb3 import SB3VecEnv
from DroneSwarmSearch.training import TRAINING_TASK
from DroneSwarmSearch.vector import DroneVectorEnv
from DroneSwarmSearch.wrappers import FlatObservation, ScaledRewards

CHECKPOINT = "model.zip"

DRONES = TRAINING_TASK["n_drones"]

REWARD_SCALE = 2.0**-17  # brings rewards of up to 100,000 points near 1, for the critic

FIND_REWARD = REWARD_SCALE * RewardScheme().find
"""The smallest reward for a find. All others are smaller, as is that for a find in the step of a
collision, which is rare."""

PPO_SETTINGS = {
    "n_steps": 64,
    "batch_size": 2048,
    "n_epochs": 4,
    "learning_rate": 1e-3,
    "gamma": 0.99,
    "gae_lambda": 0.95,
    "ent_coef": 0.002,
    # In rollouts without a find, rewards differ only by the small cost of searches. Normalised,
    # that cost would teach the drones not to search.
    "normalize_advantage": False,
    "policy_kwargs": {"net_arch": [128, 128]},
    "device": "cpu",
}


def make_batch(num_swarms: int, seed: int) -> VecEnv:
    """A batch of searches; each sub-environment is one drone.

    The time limit counts as termination (`separate_flags=False`), because the drones observe
    the remaining time and the rewards include a penalty for running out of it.
    """
    env = SB3VecEnv(
        DroneVectorEnv(
            num_swarms,
            observation="flat",
            right_of_way=True,  # of the masks, which only MaskablePPO uses
            autoreset_mode="SameStep",
            reward_scale=REWARD_SCALE,
            **TRAINING_TASK,
        )
    )
    env.seed(seed)
    return VecMonitor(env)


def make_supersuit(num_swarms: int, seed: int) -> VecEnv:
    """The same with single environments, through the wrappers and SuperSuit."""
    import supersuit

    env = FlatObservation(ScaledRewards(DroneSwarmSearch(**TRAINING_TASK), REWARD_SCALE))
    drones = supersuit.pettingzoo_env_to_vec_env_v1(env)
    envs = supersuit.concat_vec_envs_v1(drones, num_swarms, base_class="stable_baselines3")
    envs.venv.reset(seed=seed)  # SuperSuit's environment for Stable-Baselines3 takes no seeds
    return VecMonitor(envs)


class CurveCallback(BaseCallback):
    """Adds a row to the learning curve for each rollout, and saves the model."""

    def __init__(self, run: training.Run) -> None:
        super().__init__()
        self.run = run
        self.returns: list[float] = []
        self.found: list[bool] = []

    def _on_step(self) -> bool:
        dones = self.locals["dones"]
        if dones.any():
            infos = self.locals["infos"]
            self.returns += [infos[i]["episode"]["r"] / REWARD_SCALE for i in dones.nonzero()[0]]
            best = self.locals["rewards"].reshape(-1, DRONES).max(axis=1)
            self.found += (best[dones[::DRONES]] >= FIND_REWARD).tolist()
        return True

    def _on_rollout_end(self) -> None:
        steps = self.num_timesteps // DRONES
        if self.found:
            self.run.log(steps, float(np.mean(self.returns)), float(np.mean(self.found)))
        else:
            self.run.log(steps)
        self.returns, self.found = [], []

    def _on_rollout_start(self) -> None:  # before the first, then after every update
        self.save()

    def _on_training_end(self) -> None:
        self.save()

    def save(self) -> None:
        with self.run.saving(CHECKPOINT) as path:
            self.model.save(path)


class TrainedPolicy:
    """The model's most likely actions, for `evaluate`."""

    def __init__(self, model: Any, masked: bool) -> None:
        self.model, self.masked = model, masked

    def __call__(self, observations: dict[str, NDArray[Any]]) -> NDArray[np.int64]:
        """Actions, shape (drones,), for flat observations with masks."""
        masks = {"action_masks": observations["action_mask"]} if self.masked else {}
        return self.model.predict(observations["observation"], deterministic=True, **masks)[0]


def algorithm_of(options: argparse.Namespace) -> Any:
    if not options.mask:
        return PPO
    from sb3_contrib import MaskablePPO

    return MaskablePPO


def train(options: argparse.Namespace) -> Any:
    """Train for all steps; returns the model."""
    algorithm = algorithm_of(options)
    title = f"{algorithm.__name__} of Stable-Baselines3"
    with training.Run(options, title, CHECKPOINT) as run:
        seed = options.seed + run.steps_done  # a resumed run plays new episodes
        set_random_seed(seed)
        env = (make_supersuit if options.supersuit else make_batch)(options.num_envs, seed)
        if run.resuming:
            model = algorithm.load(run.checkpoint, env, device="cpu")
            run.resume_from(model.num_timesteps // DRONES)
        else:
            model = algorithm("MlpPolicy", env, **PPO_SETTINGS)
        remaining = run.total_steps - run.steps_done
        if remaining > 0:
            model.learn(
                remaining * DRONES, CurveCallback(run), reset_num_timesteps=not run.resuming
            )
    return model


def main() -> None:
    parser = training.arguments(__doc__, steps=1_000_000, short=4_000)
    choice = parser.add_mutually_exclusive_group()
    choice.add_argument(
        "--supersuit", action="store_true", help="step single environments through SuperSuit"
    )
    choice.add_argument("--mask", action="store_true", help="mask actions that lead to crashes")
    parser.add_argument(
        "--num-envs", metavar="N", type=int, default=32, help="searches in the batch (32)"
    )
    options = parser.parse_args()
    model = train(options)
    training.compare_with_baselines(
        TrainedPolicy(model, options.mask),
        TRAINING_TASK,
        action_mask=True,
        right_of_way=True,
        episodes=options.episodes,
        name="ppo",
        folder=options.out,
    )


if __name__ == "__main__":
    main()
