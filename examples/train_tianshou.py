"""Train drones with Tianshou's DQN, and compare them with the baselines.

    python examples/train_tianshou.py --out runs/tianshou

Tianshou takes PettingZoo environments in their AEC form, in which the drones choose one
after another and the environment makes its step when the last has chosen. All drones share
one network, and masks keep them on the grid and out of each other's way. Interrupted, the
same command with `--resume` goes on from the last checkpoint, with an empty replay buffer.
"""

from __future__ import annotations

import argparse
import logging
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from pettingzoo.utils import parallel_to_aec
from tianshou.algorithm import DQN
from tianshou.algorithm.modelfree.dqn import DiscreteQLearningPolicy
from tianshou.algorithm.multiagent.marl import MultiAgentOffPolicyAlgorithm
from tianshou.algorithm.optim import AdamOptimizerFactory
from tianshou.data import Batch, Collector, VectorReplayBuffer
from tianshou.env import DummyVectorEnv, PettingZooEnv
from tianshou.trainer import OffPolicyTrainerParams
from tianshou.utils.logger.logger_base import LazyLogger
from tianshou.utils.net.common import Net

from DroneSwarmSearch import DroneSwarmSearch, training
from DroneSwarmSearch.training import TRAINING_TASK
from DroneSwarmSearch.wrappers import ActionMask, FlatObservation, ScaledRewards

CHECKPOINT = "model.pt"

DRONES = TRAINING_TASK["n_drones"]

SCALE = 2.0**-17
"""Of the rewards: brings those of up to 100 000 points near 1, as networks want them."""

DISCOUNT = 0.98
"""Of rewards one environment step later."""

HORIZON = 5
"""Environment steps whose rewards are added up before the network is asked for the rest."""

EXPLORATION, LEAST, FALLING = 1.0, 0.05, 0.5
"""The share of random actions in the beginning and in the end, and how much of the training
it takes to get there."""

EPOCH = 1000
"""Environment steps between rows of the curve."""


logging.getLogger("tianshou.data.stats").setLevel(logging.ERROR)  # a return for each drone is meant


def search() -> PettingZooEnv:
    """One search as Tianshou wants it: its own wrapper finds the masks in the observations.

    The drones see how many steps are left and are punished when there are none: the time limit
    is a true end of their task, after which there is no value to be estimated.
    """
    env = FlatObservation(ScaledRewards(DroneSwarmSearch(**TRAINING_TASK), SCALE))
    return PettingZooEnv(parallel_to_aec(ActionMask(env, in_observation=True, right_of_way=True)))


def learner() -> DQN:
    """A DQN that all drones share.

    A step of the environment is a choice by each of its drones. Everybody is paid when the
    last has chosen, so returns must reach over as many choices as there are drones, or a
    multiple of them: then they hold the step's reward, and what follows is the same drone's
    next turn.
    """
    env = search()
    size, actions = env.observation_space["observation"].shape[0], int(env.action_space.n)
    network = Net(state_shape=size, action_shape=actions, hidden_sizes=[128, 128])
    policy = DiscreteQLearningPolicy(model=network, action_space=env.action_space)
    return DQN(
        policy=policy,
        optim=AdamOptimizerFactory(lr=5e-4),
        gamma=DISCOUNT ** (1 / DRONES),
        n_step_return_horizon=HORIZON * DRONES,
        target_update_freq=500,
    )


class Record(LazyLogger):
    """Notes how episodes end, in a row of the curve for each epoch, and keeps the network."""

    def __init__(self, run: training.Run, dqn: DQN, begun: int) -> None:
        super().__init__()
        self.run, self.dqn, self.begun = run, dqn, begun
        self.returns: list[NDArray[np.float64]] = []

    def log_training_data(self, log_data: dict[str, Any], step: int) -> None:
        self.returns += [each / SCALE for each in log_data["returns"]]  # (drones,) each

    def save_data(self, epoch: int, env_step: int, update_step: int, *_: Any) -> None:
        steps = self.begun + env_step // DRONES
        save(self.run, self.dqn, steps)
        # Whoever has found nobody by the limit, or crashes, has a return near -100 000.
        found = [each.min() > -50_000 for each in self.returns]
        reward = float(np.mean(self.returns)) if found else None
        self.run.log(steps, reward, float(np.mean(found)) if found else None)
        self.returns = []


def save(run: training.Run, dqn: DQN, steps: int) -> None:
    """Keep what `--resume` needs."""
    with run.saving(CHECKPOINT) as path:
        torch.save({"steps": steps, "dqn": dqn.state_dict()}, path)


def train(options: argparse.Namespace) -> DQN:
    """Train until all steps wanted are done."""
    with training.Run(options, "DQN of Tianshou", CHECKPOINT) as run:
        torch.manual_seed(options.seed)
        np.random.seed(options.seed)  # Tianshou explores with NumPy's global numbers
        dqn = learner()
        if run.resuming:
            kept = torch.load(run.checkpoint)
            dqn.load_state_dict(kept["dqn"])
            run.resume_from(kept["steps"])
        else:
            save(run, dqn, 0)
        begun = run.steps_done
        if begun >= run.total_steps:
            return dqn

        def explore(epoch: int, env_step: int) -> None:
            progress = (begun + env_step / DRONES) / (FALLING * run.total_steps)
            # Tianshou 2.0 does not tell the policies of a swarm when they are being trained.
            dqn.policy.set_eps_inference(max(LEAST, EXPLORATION * (1.0 - progress)))

        swarm = MultiAgentOffPolicyAlgorithm(algorithms=[dqn] * DRONES, env=search())
        envs = DummyVectorEnv([search for _ in range(options.num_envs)])
        envs.seed(options.seed + begun)
        buffer = VectorReplayBuffer(200_000, options.num_envs)
        collector = Collector(swarm.policy, envs, buffer, exploration_noise=True)
        collector.reset()
        explore(0, 0)
        begun += collector.collect(n_episode=options.num_envs).n_collected_steps // DRONES
        left = max(run.total_steps - begun, 1)
        epoch = min(EPOCH, left)
        swarm.run_training(
            OffPolicyTrainerParams(
                training_collector=collector,
                max_epochs=-(-left // epoch),
                epoch_num_steps=DRONES * epoch,
                collection_step_num_env_steps=DRONES * options.num_envs,
                update_step_num_gradient_steps_per_sample=1 / 4,
                batch_size=128,
                training_fn=explore,
                logger=Record(run, dqn, begun),
                verbose=False,
                show_progress=False,
            )
        )
    return dqn


class Trained:
    """What the network holds for the best allowed action, as the evaluation asks for it."""

    def __init__(self, dqn: DQN) -> None:
        self.policy = dqn.policy.eval()

    def __call__(self, seen: NDArray[np.float32]) -> NDArray[np.int64]:
        """Actions, shape (drones,), for flat observations, one for each drone."""
        masks = training.masks_of_flat(seen, TRAINING_TASK)
        with torch.no_grad():
            return self.policy(Batch(obs=Batch(obs=seen, mask=masks), info=Batch())).act


def main() -> None:
    """Train, and compare the result with the baselines."""
    parser = training.arguments(__doc__, steps=40_000, short=500)
    parser.add_argument(
        "--num-envs", metavar="N", type=int, default=8, help="searches at a time (8)"
    )
    options = parser.parse_args()
    dqn = train(options)
    training.compare_with_baselines(
        Trained(dqn), TRAINING_TASK, episodes=options.episodes, name="dqn", folder=options.out
    )


if __name__ == "__main__":
    main()
