"""Train drones with BenchMARL, with IPPO or MAPPO.

    python examples/train_benchmarl.py --out runs/mappo
    python examples/train_benchmarl.py --out runs/ippo --algorithm ippo

`SearchTask` makes the environment a BenchMARL task, for its other algorithms, models and
benchmarks as well. MAPPO's critic sees the state, which contains the person; the policy does not.
Needs pip install "DroneSwarmSearchEnvironment[benchmarl,evaluation]".
"""

from __future__ import annotations

import itertools
import math
import os
import warnings
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

os.environ.setdefault("TQDM_DISABLE", "1")  # the run shows its own progress

import numpy as np
import torch
from benchmarl.algorithms import IppoConfig, MappoConfig
from benchmarl.environments import Task, TaskClass
from benchmarl.experiment import Callback, Experiment, ExperimentConfig
from benchmarl.models.mlp import MlpConfig
from numpy.typing import NDArray
from tensordict import TensorDict, TensorDictBase
from torch import nn
from torchrl.data import Composite
from torchrl.envs import EnvBase, ExplorationType, PettingZooWrapper, set_exploration_type

from DroneSwarmSearch import DroneSwarmSearch, training
from DroneSwarmSearch.training import TRAINING_TASK
from DroneSwarmSearch.wrappers import ActionMask, FlatObservation, ScaledRewards

REWARD_SCALE = 2.0**-17  # brings a return of 100,000 points below 1

NUM_ENVS, BATCH = 16, 1024  # environments, and the steps of all of them between two updates

ALGORITHMS = {"ippo": IppoConfig, "mappo": MappoConfig}

warnings.filterwarnings("ignore", module="torch")  # how BenchMARL uses TorchRL


class SearchClass(TaskClass):
    """The environment for BenchMARL; `config` holds the parameters of `DroneSwarmSearch`."""

    def get_env_fun(
        self, num_envs: int, continuous_actions: bool, seed: int | None, device: Any
    ) -> Callable[[], EnvBase]:
        seeds = itertools.count(0 if seed is None else seed)  # different for each environment

        def make() -> EnvBase:
            env: Any = DroneSwarmSearch(**self.config)
            # The time limit terminates the episode: the drones observe the remaining time.
            env = FlatObservation(ScaledRewards(env, REWARD_SCALE))
            env = ActionMask(env, right_of_way=True)  # in the infos, where TorchRL expects it
            groups = {"drones": env.possible_agents}
            return PettingZooWrapper(
                env, group_map=groups, return_state=True, seed=next(seeds), device=device
            )

        return make

    def supports_continuous_actions(self) -> bool:
        return False

    def supports_discrete_actions(self) -> bool:
        return True

    def has_render(self, env: EnvBase) -> bool:
        return False

    def max_steps(self, env: EnvBase) -> int:
        return int(env.timestep_limit)

    def group_map(self, env: EnvBase) -> dict[str, list[str]]:
        groups: dict[str, list[str]] = env.group_map
        return groups

    def action_spec(self, env: EnvBase) -> Composite:
        return env.full_action_spec

    def observation_spec(self, env: EnvBase) -> Composite:
        return spec_of_drones(env, "observation")

    def action_mask_spec(self, env: EnvBase) -> Composite:
        return spec_of_drones(env, "action_mask")

    def info_spec(self, env: EnvBase) -> Composite:
        return spec_of_drones(env, "info")

    def state_spec(self, env: EnvBase) -> Composite:
        return Composite(state=env.observation_spec["state"].clone())

    @staticmethod
    def env_name() -> str:
        return "droneswarmsearch"


class SearchTask(Task):
    """BenchMARL's task; `SearchTask.SEARCH.get_task(config)` takes any parameters."""

    SEARCH = None

    @staticmethod
    def associated_class() -> type[SearchClass]:
        return SearchClass


def spec_of_drones(env: EnvBase, key: str) -> Composite:
    """A part of the observation spec of the group of drones."""
    drones = env.observation_spec["drones"]
    return Composite(drones=Composite({key: drones[key].clone()}, shape=drones.shape))


class CurveCallback(Callback):
    """Adds rows to the learning curve, and the optimisers to BenchMARL's checkpoints."""

    def __init__(self, run: training.Run) -> None:
        super().__init__()
        self.run = run

    def on_batch_collected(self, batch: TensorDictBase) -> None:
        ended = batch["next"][batch["next", "done"].squeeze(-1)]
        statistics = {}
        if len(ended):
            statistics["reward"] = float(ended["drones", "episode_reward"].mean()) / REWARD_SCALE
            statistics["found"] = float(ended["drones", "info", "Found"].amax(dim=-1).mean())
        self.run.log(self.experiment.total_frames, **statistics)

    def on_state_dict(self, state_dict: dict[str, Any]) -> None:
        state_dict["optimisers"] = {name: each.state_dict() for name, each in self._optimisers()}

    def on_load_state_dict(self, state_dict: dict[str, Any]) -> None:
        for name, each in self._optimisers():
            each.load_state_dict(state_dict["optimisers"][name])

    def _optimisers(self) -> Iterable[tuple[str, torch.optim.Optimizer]]:
        optimisers: dict[str, torch.optim.Optimizer] = self.experiment.optimizers["drones"]
        return optimisers.items()

    def __reduce__(self) -> tuple[Any, ...]:
        """BenchMARL pickles its callbacks; leave out the run."""
        return Callback, ()


class TrainedPolicy:
    """The policy's most likely actions, for `evaluate`."""

    def __init__(self, policy: nn.Module) -> None:
        self.policy = policy

    def __call__(self, observations: dict[str, NDArray[Any]]) -> NDArray[np.int64]:
        """Actions, shape (drones,), for flat observations with masks."""
        n = TRAINING_TASK["n_drones"]
        seen, masks = observations["observation"], observations["action_mask"] == 1
        drones = {
            "observation": torch.from_numpy(seen.reshape(-1, n, seen.shape[1])),
            "action_mask": torch.from_numpy(masks.reshape(-1, n, masks.shape[1])),
        }
        batch = TensorDict({"drones": drones}, batch_size=len(seen) // n)
        with torch.no_grad(), set_exploration_type(ExplorationType.DETERMINISTIC):
            actions: torch.Tensor = self.policy(batch)["drones", "action"]
        return actions.flatten().numpy()


def make_config(options: Any, checkpoint: Path | None) -> ExperimentConfig:
    """BenchMARL's defaults, adapted to a small task and a CPU."""
    config = ExperimentConfig.get_from_yaml()
    config.max_n_frames, config.max_n_iters = None, math.ceil(options.steps / BATCH)
    config.on_policy_n_envs_per_worker = NUM_ENVS
    config.on_policy_collected_frames_per_batch = BATCH
    config.on_policy_n_minibatch_iters = 6
    config.on_policy_minibatch_size = 256
    config.lr = 1e-3
    config.evaluation = False  # the script compares with the baselines at the end
    config.loggers = []
    config.create_json = False
    config.save_folder = str(options.out)
    config.checkpoint_interval = BATCH
    config.restore_file = None if checkpoint is None else str(checkpoint)
    return config


class AtomicExperiment(Experiment):
    """An experiment that deletes a checkpoint if it is interrupted while writing it."""

    def _save_experiment(self) -> None:
        try:
            super()._save_experiment()
        except BaseException:
            name = f"checkpoint_{self.total_frames}.pt"
            (self.folder_name / "checkpoints" / name).unlink(missing_ok=True)
            raise


def main() -> None:
    parser = training.arguments(__doc__, steps=200_000, short=2 * BATCH)
    parser.add_argument(
        "--algorithm",
        choices=list(ALGORITHMS),
        default="mappo",
        help="MAPPO's critic sees the state, IPPO's the drone's observation (mappo)",
    )
    options = parser.parse_args()

    algorithm = ALGORITHMS[options.algorithm].get_from_yaml()
    algorithm.entropy_coef, algorithm.lmbda = 0.001, 0.95
    network = {"num_cells": [128, 128], "layer_class": nn.Linear, "activation_class": nn.Tanh}
    state_network = MlpConfig(**network, num_feature_dims=3)
    title = f"BenchMARL, {options.algorithm.upper()}"
    with training.Run(options, title, "*/checkpoints/checkpoint_*.pt") as run:
        experiment = AtomicExperiment(
            task=SearchTask.SEARCH.get_task(TRAINING_TASK),
            algorithm_config=algorithm,
            model_config=MlpConfig(**network),
            critic_model_config=state_network if options.algorithm == "mappo" else None,
            seed=options.seed + run.steps_done,  # a resumed run plays new episodes
            config=make_config(options, run.checkpoint if run.resuming else None),
            callbacks=[CurveCallback(run)],
        )
        if run.resuming:
            run.resume_from(experiment.total_frames)
        else:
            experiment._save_experiment()
        experiment.run()
    training.compare_with_baselines(
        TrainedPolicy(experiment.policy),
        TRAINING_TASK,
        action_mask=True,
        right_of_way=True,
        episodes=options.episodes,
        name=f"benchmarl-{options.algorithm}",
        folder=run.folder,
    )


if __name__ == "__main__":
    main()
