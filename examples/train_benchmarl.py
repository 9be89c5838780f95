"""Train drones with BenchMARL's IPPO or MAPPO, on a batch of searches.

    pip install "DroneSwarmSearchEnvironment[benchmarl]"
    python examples/train_benchmarl.py --out runs/ippo
    python examples/train_benchmarl.py --out runs/mappo --algorithm mappo

All drones share one policy. Masks prevent crashes. MAPPO's critic sees the state, which shows the
person; the policy does not. Other algorithms and models of BenchMARL take the same task.
"""

from __future__ import annotations

import math
import os
import warnings
from pathlib import Path

from DroneSwarmSearch import training

training.exit_on_interrupt(__name__)  # also during the imports below
os.environ.setdefault("TQDM_DISABLE", "1")  # the run shows its own progress

import torch
from benchmarl.algorithms import IppoConfig, MappoConfig
from benchmarl.experiment import Callback, ExperimentConfig
from benchmarl.models.mlp import MlpConfig
from tensordict import TensorDictBase
from torch import nn

from DroneSwarmSearch.adapters.benchmarl import ResumableExperiment, RunCallback, SearchTask
from DroneSwarmSearch.adapters.torchrl import TrainedPolicy
from DroneSwarmSearch.evaluation import View
from DroneSwarmSearch.training import TRAINING_TASK

NUM_SWARMS, NUM_STEPS = 100, 50  # searches, and steps of each between two updates
BATCH = NUM_SWARMS * NUM_STEPS
ALGORITHMS = {"ippo": IppoConfig, "mappo": MappoConfig}
CHECKPOINTS = "*/checkpoints/checkpoint_*.pt"

# In the coverage mission nobody is found: a search pays the swarm the probability of success that
# it adds, which is less noisy than a find.
MISSION = {"mission": "coverage", "shared_reward": True}
LEARNING_RATE, ENTROPY = 1.5e-3, 0.001  # both fall to 0

# What the policy is shown, in training and evaluation.
SHOWN = {"observation": "crops", "right_of_way": True}

warnings.filterwarnings("ignore", module="torch")  # how BenchMARL uses TorchRL


class Annealing(Callback):
    """Lets the learning rates and the bonus for entropy fall to 0."""

    def on_batch_collected(self, batch: TensorDictBase) -> None:
        experiment = self.experiment
        left = 1 - experiment.n_iters_performed / experiment.config.max_n_iters
        experiment.losses["drones"].entropy_coeff.fill_(ENTROPY * left)
        for optimiser in experiment.optimizers["drones"].values():
            optimiser.param_groups[0]["lr"] = LEARNING_RATE * left


def make_config(folder: Path, steps: int, checkpoint: Path | None) -> ExperimentConfig:
    """BenchMARL's defaults, adapted to a small task and a CPU."""
    config = ExperimentConfig.get_from_yaml()
    config.max_n_frames, config.max_n_iters = None, math.ceil(steps / BATCH)
    config.on_policy_n_envs_per_worker = NUM_SWARMS
    config.on_policy_collected_frames_per_batch = config.checkpoint_interval = BATCH
    config.on_policy_n_minibatch_iters, config.on_policy_minibatch_size = 4, 1000
    config.lr, config.clip_grad_val = LEARNING_RATE, 0.5
    config.evaluation = False  # the script compares with the baselines at the end
    config.loggers, config.create_json = ["csv"], False
    config.save_folder = str(folder)
    config.restore_file = None if checkpoint is None else str(checkpoint)
    return config


def main() -> None:
    parser = training.arguments(__doc__, steps=400_000, short=2 * BATCH)
    parser.add_argument(
        "--algorithm",
        choices=list(ALGORITHMS),
        default="ippo",
        help="IPPO's critic sees the drone's observation, MAPPO's the state (ippo)",
    )
    options = parser.parse_args()
    torch.set_num_threads(options.threads)
    algorithm = ALGORITHMS[options.algorithm].get_from_yaml()
    algorithm.entropy_coef, algorithm.lmbda = ENTROPY, 0.95
    layers = {"num_cells": [128, 128], "layer_class": nn.Linear, "activation_class": nn.Tanh}
    of_state = MlpConfig(**layers, num_feature_dims=3)
    with training.Run(options, f"BenchMARL, {options.algorithm.upper()}", CHECKPOINTS) as run:
        checkpoint = run.checkpoint if run.resuming else None
        experiment = ResumableExperiment(
            task=SearchTask.SEARCH.get_task({**TRAINING_TASK, **SHOWN, **MISSION}),
            algorithm_config=algorithm,
            model_config=MlpConfig(**layers),
            critic_model_config=of_state if options.algorithm == "mappo" else None,
            seed=options.seed + run.steps_done,  # a resumed run plays new episodes
            config=make_config(run.folder, run.total_steps, checkpoint),
            callbacks=[RunCallback(run), Annealing()],
        )
        if run.resuming:
            run.resume_from(experiment.total_frames)
        experiment.run()
    training.compare_with_baselines(
        TrainedPolicy(experiment.policy, TRAINING_TASK["n_drones"]),  # samples, as in training
        TRAINING_TASK,
        view=View("drone", action_mask=True, **SHOWN),
        episodes=options.episodes,
        name=f"benchmarl-{options.algorithm}",
        folder=run.folder,
    )


if __name__ == "__main__":
    main()
