"""Train drones with BenchMARL's IPPO, MAPPO, VDN, QMIX or IQL, on a batch of searches.

    pip install "DroneSwarmSearchEnvironment[benchmarl]"
    python examples/train_benchmarl.py --out runs/ippo
    python examples/train_benchmarl.py --out runs/qmix --algorithm qmix --task wreck

All drones share one policy. Masks prevent crashes. MAPPO's critic and QMIX's mixer see the state,
which shows the persons; the policy does not. With ``--algorithm ippo-gru`` the policy of IPPO has a
memory. Other models of BenchMARL take the same task.
"""

from __future__ import annotations

import math
import warnings
from os.path import relpath
from pathlib import Path
from typing import NamedTuple

import torch
from benchmarl.algorithms import IppoConfig, IqlConfig, MappoConfig, QmixConfig, VdnConfig
from benchmarl.experiment import Callback, Experiment, ExperimentConfig
from benchmarl.models.gru import GruConfig
from benchmarl.models.mlp import MlpConfig
from tensordict import TensorDictBase
from torch import nn
from training_script import begin, finish

from DroneSwarmSearch import Scenario, training
from DroneSwarmSearch.adapters import TrainedPolicy
from DroneSwarmSearch.adapters.benchmarl import SearchTask
from DroneSwarmSearch.adapters.torchrl import logits
from DroneSwarmSearch.evaluation import View
from DroneSwarmSearch.training import TASKS, TRAINING_TASK, Task

ALGORITHMS = {
    "ippo": IppoConfig,
    "ippo-gru": IppoConfig,
    "mappo": MappoConfig,
    "vdn": VdnConfig,
    "qmix": QmixConfig,
    "iql": IqlConfig,
}


class Setting(NamedTuple):
    """What is tuned, see `docs/benchmark/tuning.csv`.

    Attributes:
        lr: the learning rate at the start.
        exploration: PPO's bonus for entropy at the start; otherwise, the last share of random
            actions.
        gamma: the discount.
        swarms: searches, each of which is flown once between two updates.
    """

    lr: float
    exploration: float
    gamma: float
    swarms: int


PPO = Setting(lr=1.5e-3, exploration=0.001, gamma=0.99, swarms=100)
VALUES = Setting(lr=5e-4, exploration=0.02, gamma=0.99, swarms=100)
SETTINGS = {
    "ippo": PPO,
    "ippo-gru": PPO,
    "mappo": PPO,
    "vdn": VALUES,
    "qmix": VALUES,
    "iql": VALUES,
}

# The most drones in a swarm that share their rewards: all are paid the mean. VDN and QMIX divide
# the value of the swarm among its drones. Other algorithms learn faster from a drone's own
# searches, but two drones of PPO cooperate better if they share.
SHARING = {"vdn": math.inf, "qmix": math.inf, "ippo": 2, "ippo-gru": 2, "mappo": 2, "iql": 0}

# A search adds about .01. Values this small vanish in the errors of a new network, and drones that
# take the largest value then follow the largest error.
VALUE_SCALE = 128.0

MEMORY = 128  # numbers that a drone remembers, with "ippo-gru"

# What the policy is shown, in training and evaluation.
SHOWN = {"observation": "crops", "right_of_way": True}

warnings.filterwarnings("ignore", module="torch")  # how BenchMARL uses TorchRL


class Annealing(Callback):
    """Lets PPO's learning rates and bonus for entropy fall to 0, and IQL's rate from half-time."""

    def __init__(self, entropy: float) -> None:
        super().__init__()
        self._entropy = entropy

    def on_batch_collected(self, batch: TensorDictBase) -> None:
        experiment = self.experiment
        left = 1 - experiment.n_iters_performed / experiment.config.max_n_iters
        if experiment.on_policy:
            experiment.losses["drones"].entropy_coeff.fill_(self._entropy * left)
        else:
            left = min(2 * left, 1.0)
        for optimiser in experiment.optimizers["drones"].values():
            optimiser.param_groups[0]["lr"] = experiment.config.lr * left


class Curve(Callback):
    """Logs the learning curve; BenchMARL's own logs have more columns."""

    def __init__(self, path: Path, column: str) -> None:
        super().__init__()
        self._path = path
        self._column = f"collection/{column}"

    def on_batch_collected(self, batch: TensorDictBase) -> None:
        logged = self.experiment.task.log_info(batch)
        if self._column in logged:  # episodes have ended
            found = logged[self._column]
            training.log_row(self._path, steps=self.experiment.total_frames, found=found)


class Trained(TrainedPolicy):
    """The saved policy, for `evaluate`, `record` and `play`.

    After IPPO or MAPPO it samples actions; otherwise it takes those of the largest values. The file
    holds BenchMARL's modules, which PyTorch unpickles: it can execute code, so only load files that
    you trust.
    """

    def __init__(self, scenario: Scenario, path: str) -> None:
        torch.set_num_threads(1)
        algorithm, policy = torch.load(path, weights_only=False)
        hidden = {"_hidden_gru_0": (1, MEMORY)} if algorithm == "ippo-gru" else {}
        view = View("drone", action_mask=True, bayesian_update=True, **SHOWN)
        greedy = not ALGORITHMS[algorithm].on_policy()
        super().__init__(logits(policy, scenario.n_drones, hidden), deterministic=greedy, view=view)


def make_config(
    folder: Path, steps: int, task: Task, algorithm: str, setting: Setting
) -> ExperimentConfig:
    """BenchMARL's defaults, adapted to a small task and a CPU."""
    config = ExperimentConfig.get_from_yaml()
    drones = task.parameters["n_drones"]
    batch = setting.swarms * task.parameters["timestep_limit"]
    config.max_n_frames = None
    config.max_n_iters = math.ceil(steps / batch)
    config.on_policy_n_envs_per_worker = setting.swarms
    config.on_policy_collected_frames_per_batch = batch
    config.checkpoint_at_end = True
    config.on_policy_n_minibatch_iters = 4
    config.on_policy_minibatch_size = 1000
    config.lr = setting.lr
    config.gamma = setting.gamma
    config.clip_grad_val = 0.5
    if not ALGORITHMS[algorithm].on_policy():
        config.off_policy_n_envs_per_worker = setting.swarms
        config.off_policy_collected_frames_per_batch = batch
        config.off_policy_n_optimizer_steps = setting.swarms
        # In steps of the swarm. From a short memory, IQL forgets what other actions than the best
        # lead to; VDN, whose drones share a value, needs what the others do now.
        config.off_policy_train_batch_size = 1024 // drones
        config.off_policy_memory_size = (800_000 if algorithm == "iql" else 200_000) // drones
        config.exploration_eps_end = setting.exploration
        config.exploration_anneal_frames = steps // 2
        config.clip_grad_val = 5.0
    config.evaluation = False  # the script compares with the baselines at the end
    config.loggers = ["csv"]
    config.create_json = False
    config.save_folder = str(folder)
    return config


def main() -> None:
    options = begin(
        "Train drones with BenchMARL.",
        algorithm={
            "choices": list(ALGORITHMS),
            "default": "ippo",
            "help": "IPPO's critic sees the drone's observation, MAPPO's the state",
        },
        task={
            "choices": list(TASKS),
            "help": "of the benchmark, in place of the one of all examples",
        },
        steps={"type": int, "default": 400_000, "help": "environment steps in all"},
        lr={"type": float, "help": "learning rate; for this and the next ones, see Setting"},
        exploration={"type": float, "help": "bonus for entropy, or last share of random actions"},
        gamma={"type": float, "help": "discount"},
        swarms={"type": int, "help": "searches flown between two updates"},
    )
    torch.set_num_threads(options.threads)
    name = options.algorithm
    given = {key: getattr(options, key) for key in Setting._fields}
    setting = SETTINGS[name]._replace(**{key: x for key, x in given.items() if x is not None})
    task = TASKS[options.task] if options.task else Task(TRAINING_TASK)
    experiment = make_experiment(options.out, options.seed, options.steps, task, name, setting)
    experiment.run()
    torch.save((name, experiment.policy), options.out / "policy.pt")
    trained = f"{relpath(__file__)}:Trained:{options.out / 'policy.pt'}"
    finish(trained, f"benchmarl-{name}", options, task=task)


def make_experiment(
    folder: Path, seed: int, steps: int, task: Task, name: str, setting: Setting
) -> Experiment:
    """The training of an algorithm of `ALGORITHMS` on a task; its curve is in the folder."""
    algorithm = ALGORITHMS[name].get_from_yaml()
    drones = task.parameters["n_drones"]
    scale = drones / 2  # a drone's share of the success is the smaller, the more there are
    column = "share_found" if task.has_several_persons else "probability_of_success"
    callbacks = [Curve(folder / "curve.csv", column)]
    if algorithm.on_policy():
        algorithm.entropy_coef = setting.exploration
        algorithm.lmbda = 0.95
    else:
        scale *= VALUE_SCALE
    if algorithm.on_policy() or name == "iql":
        callbacks.insert(0, Annealing(setting.exploration))
    rewards = {"shared_reward": drones <= SHARING[name], "reward_scale": scale}
    state = {"state": name in ("mappo", "qmix")}
    layers = {"num_cells": [128, 128], "layer_class": nn.Linear, "activation_class": nn.Tanh}
    of_drones = MlpConfig(**layers)
    of_state = MlpConfig(**layers, num_feature_dims=3)
    return Experiment(
        task=SearchTask.SEARCH.get_task({**task.training, **SHOWN, **rewards, **state}),
        algorithm_config=algorithm,
        model_config=with_memory() if name == "ippo-gru" else of_drones,
        critic_model_config=of_state if name == "mappo" else of_drones,
        seed=seed,
        config=make_config(folder, steps, task, name, setting),
        callbacks=callbacks,
    )


def with_memory() -> GruConfig:
    """A policy that remembers what it has seen in the episode."""
    return GruConfig(
        hidden_size=MEMORY,
        n_layers=1,
        bias=True,
        dropout=0.0,
        compile=False,
        mlp_num_cells=[128],
        mlp_layer_class=nn.Linear,
        mlp_activation_class=nn.Tanh,
    )


if __name__ == "__main__":
    main()
