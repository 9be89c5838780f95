"""Train drones with Stable-Baselines3's PPO, and compare them with the baselines.

    python examples/train_sb3.py --out runs/sb3

The searches are stepped together by the batched engine; `--supersuit` steps the single
environment through the wrappers and SuperSuit instead, with the same network. All drones
share one policy, and each sees the search from its own place. With `--mask` the policy never
leaves the grid nor collides (MaskablePPO of sb3-contrib). Interrupted, the same command with
`--resume` goes on from the last checkpoint.
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

from DroneSwarmSearch import DroneSwarmSearch, training
from DroneSwarmSearch.rules import RewardScheme
from DroneSwarmSearch.training import TRAINING_TASK
from DroneSwarmSearch.vector import DroneVectorEnv
from DroneSwarmSearch.vector.sb3 import SB3VecEnv
from DroneSwarmSearch.wrappers import FlatObservation, ScaledRewards

CHECKPOINT = "model.zip"

DRONES = TRAINING_TASK["n_drones"]

SCALE = 2.0**-17
"""Of the rewards: brings those of up to 100 000 points near 1, which PPO's critic needs."""

FIND = SCALE * RewardScheme().find
"""The least that a drone is paid for a find, scaled; nothing else is worth as much. (Nor is a
find in the step of a collision, which rarely happens.)"""

PARAMETERS = {
    "n_steps": 64,
    "batch_size": 2048,
    "n_epochs": 4,
    "learning_rate": 1e-3,
    "gamma": 0.99,
    "gae_lambda": 0.95,
    "ent_coef": 0.002,
    # In rollouts without a find all that differs is that unsuccessful searches cost a little.
    # Normalised, that little would teach the drones not to search at all.
    "normalize_advantage": False,
    "policy_kwargs": {"net_arch": [128, 128]},
    "device": "cpu",
}


def batched(swarms: int, seed: int) -> VecEnv:
    """Many searches, stepped together; a slot for each drone.

    The drones see how many steps are left and are punished when there are none: the time limit
    is a true end of their task, after which there is no value to be estimated. So its
    truncation is not told apart from termination (`separate_flags` is left at False).
    """
    env = SB3VecEnv(
        DroneVectorEnv(
            swarms,
            observation="flat",
            autoreset_mode="SameStep",
            reward_scale=SCALE,
            **TRAINING_TASK,
        ),
        right_of_way=True,  # of the masks, if they are asked for
    )
    env.seed(seed)
    return VecMonitor(env)


def wrapped(swarms: int, seed: int) -> VecEnv:
    """The same from single environments, through the wrappers and SuperSuit."""
    import supersuit

    env = FlatObservation(ScaledRewards(DroneSwarmSearch(**TRAINING_TASK), SCALE))
    slots = supersuit.pettingzoo_env_to_vec_env_v1(env)
    together = supersuit.concat_vec_envs_v1(slots, swarms, base_class="stable_baselines3")
    together.venv.reset(seed=seed)  # SuperSuit's form for Stable-Baselines3 takes no seeds
    return VecMonitor(together)


class Record(BaseCallback):
    """Notes how episodes end, in a row of the curve for each rollout, and keeps the model."""

    def __init__(self, run: training.Run) -> None:
        super().__init__()
        self.run = run
        self.returns: list[float] = []
        self.found: list[bool] = []

    def _on_step(self) -> bool:
        over = self.locals["dones"]
        if over.any():
            infos = self.locals["infos"]
            self.returns += [infos[slot]["episode"]["r"] / SCALE for slot in over.nonzero()[0]]
            best = self.locals["rewards"].reshape(-1, DRONES).max(axis=1)
            self.found += (best[over[::DRONES]] >= FIND).tolist()
        return True

    def _on_rollout_end(self) -> None:
        self.run.log(self.num_timesteps // DRONES, _mean(self.returns), _mean(self.found))
        self.returns, self.found = [], []

    def _on_rollout_start(self) -> None:  # before the first, then what has been learnt
        self.save()

    def _on_training_end(self) -> None:
        self.save()

    def save(self) -> None:
        with self.run.saving(CHECKPOINT) as path:
            self.model.save(path)


def _mean(values: list[float] | list[bool]) -> float | None:
    return float(np.mean(values)) if values else None


class Trained:
    """What the model does where it is surest, as the evaluation asks for it."""

    def __init__(self, model: Any, masked: bool) -> None:
        self.model, self.masked = model, masked

    def __call__(self, seen: NDArray[np.float32]) -> NDArray[np.int64]:
        """Actions, shape (drones,), for flat observations, one for each drone."""
        masks = {"action_masks": training.masks_of_flat(seen, TRAINING_TASK)} if self.masked else {}
        return self.model.predict(seen, deterministic=True, **masks)[0]


def _algorithm(masked: bool) -> Any:
    if not masked:
        return PPO
    from sb3_contrib import MaskablePPO

    return MaskablePPO


def train(options: argparse.Namespace) -> Any:
    """Train until all steps wanted are done; returns the model."""
    algorithm = _algorithm(options.mask)
    title = f"{algorithm.__name__} of Stable-Baselines3"
    with training.Run(options, title, CHECKPOINT) as run:
        seed = options.seed + run.steps_done  # a resumed run is to meet new seas
        set_random_seed(seed)
        env = (wrapped if options.supersuit else batched)(options.num_envs, seed)
        if run.resuming:
            model = algorithm.load(run.checkpoint, env, device="cpu")
            run.resume_from(model.num_timesteps // DRONES)
        else:
            model = algorithm("MlpPolicy", env, **PARAMETERS)
        left = run.total_steps - run.steps_done
        if left > 0:
            model.learn(left * DRONES, Record(run), reset_num_timesteps=not run.resuming)
    return model


def main() -> None:
    """Train, and compare the result with the baselines."""
    parser = training.arguments(__doc__, steps=1_000_000, short=4_000)
    way = parser.add_mutually_exclusive_group()
    way.add_argument(
        "--supersuit", action="store_true", help="step single environments through SuperSuit"
    )
    way.add_argument("--mask", action="store_true", help="mask actions that lead to crashes")
    parser.add_argument(
        "--num-envs", metavar="N", type=int, default=32, help="searches at a time (32)"
    )
    options = parser.parse_args()
    model = train(options)
    training.compare_with_baselines(
        Trained(model, options.mask),
        TRAINING_TASK,
        episodes=options.episodes,
        name="ppo",
        folder=options.out,
    )


if __name__ == "__main__":
    main()
