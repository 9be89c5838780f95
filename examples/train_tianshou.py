"""Train drones with Tianshou's DQN, and compare them with the baselines.

    python examples/train_tianshou.py --out runs/tianshou

Tianshou uses PettingZoo's AEC API: the drones choose one after another, and the environment steps
when the last one has chosen. All drones share one network, with masks that prevent crashes. A
resumed run starts with an empty replay buffer.
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

REWARD_SCALE = 2.0**-17  # brings rewards of up to 100,000 points near 1

GAMMA = 0.98  # discount per environment step
N_STEP = 5  # environment steps of rewards in a return before bootstrapping

START_EPSILON, END_EPSILON, EXPLORATION_FRACTION = 1.0, 0.05, 0.5

EPOCH = 1000  # environment steps between rows of the curve

logging.getLogger("tianshou.data.stats").setLevel(logging.ERROR)  # warns of one return per drone


def make_env() -> PettingZooEnv:
    """One search; Tianshou's wrapper finds the masks in the observations.

    The time limit counts as termination, because the drones observe the remaining time and the
    rewards include a penalty for running out of it.
    """
    env = FlatObservation(ScaledRewards(DroneSwarmSearch(**TRAINING_TASK), REWARD_SCALE))
    return PettingZooEnv(parallel_to_aec(ActionMask(env, in_observation=True, right_of_way=True)))


def make_dqn() -> DQN:
    """The DQN that all drones share.

    One environment step consists of one transition per drone, and the rewards come with the last
    one. So returns must cover a multiple of DRONES transitions: they then contain whole steps,
    and bootstrap from the same drone's next observation.
    """
    env = make_env()
    inputs, actions = env.observation_space["observation"].shape[0], int(env.action_space.n)
    network = Net(state_shape=inputs, action_shape=actions, hidden_sizes=[128, 128])
    policy = DiscreteQLearningPolicy(model=network, action_space=env.action_space)
    return DQN(
        policy=policy,
        optim=AdamOptimizerFactory(lr=5e-4),
        gamma=GAMMA ** (1 / DRONES),
        n_step_return_horizon=N_STEP * DRONES,
        target_update_freq=500,
    )


class CurveLogger(LazyLogger):
    """Adds a row to the learning curve for each epoch, and saves the network."""

    def __init__(self, run: training.Run, dqn: DQN, first_step: int) -> None:
        super().__init__()
        self.run, self.dqn, self.first_step = run, dqn, first_step
        self.returns: list[NDArray[np.float64]] = []

    def log_training_data(self, log_data: dict[str, Any], step: int) -> None:
        self.returns += [each / REWARD_SCALE for each in log_data["returns"]]  # each (drones,)

    def save_data(self, epoch: int, env_step: int, update_step: int, *_: Any) -> None:
        steps = self.first_step + env_step // DRONES
        save(self.run, self.dqn, steps)
        # Without a find by the limit, and after a crash, a drone's return is near -100,000.
        found = [each.min() > -50_000 for each in self.returns]
        if found:
            self.run.log(steps, float(np.mean(self.returns)), float(np.mean(found)))
        else:
            self.run.log(steps)
        self.returns = []


def save(run: training.Run, dqn: DQN, steps: int) -> None:
    with run.saving(CHECKPOINT) as path:
        torch.save({"steps": steps, "dqn": dqn.state_dict()}, path)


def train(options: argparse.Namespace) -> DQN:
    """Train for all steps; returns the DQN."""
    with training.Run(options, "DQN of Tianshou", CHECKPOINT) as run:
        torch.manual_seed(options.seed)
        np.random.seed(options.seed)  # Tianshou explores with NumPy's global generator
        dqn = make_dqn()
        if run.resuming:
            checkpoint = torch.load(run.checkpoint)
            dqn.load_state_dict(checkpoint["dqn"])
            run.resume_from(checkpoint["steps"])
        else:
            save(run, dqn, 0)
        first_step = run.steps_done
        if first_step >= run.total_steps:
            return dqn

        def set_epsilon(epoch: int, env_step: int) -> None:
            steps = first_step + env_step / DRONES
            progress = steps / (EXPLORATION_FRACTION * run.total_steps)
            # In Tianshou 2.0, policies of several agents use their inference epsilon in training.
            dqn.policy.set_eps_inference(max(END_EPSILON, START_EPSILON * (1.0 - progress)))

        agents = MultiAgentOffPolicyAlgorithm(algorithms=[dqn] * DRONES, env=make_env())
        envs = DummyVectorEnv([make_env for _ in range(options.num_envs)])
        envs.seed(options.seed + first_step)  # a resumed run plays new episodes
        buffer = VectorReplayBuffer(200_000, options.num_envs)
        collector = Collector(agents.policy, envs, buffer, exploration_noise=True)
        collector.reset()
        set_epsilon(0, 0)
        first_step += collector.collect(n_episode=options.num_envs).n_collected_steps // DRONES
        remaining = max(run.total_steps - first_step, 1)
        epoch = min(EPOCH, remaining)
        agents.run_training(
            OffPolicyTrainerParams(
                training_collector=collector,
                max_epochs=-(-remaining // epoch),
                epoch_num_steps=DRONES * epoch,
                collection_step_num_env_steps=DRONES * options.num_envs,
                update_step_num_gradient_steps_per_sample=1 / 4,
                batch_size=128,
                training_fn=set_epsilon,
                logger=CurveLogger(run, dqn, first_step),
                verbose=False,
                show_progress=False,
            )
        )
    return dqn


class TrainedPolicy:
    """The network's best allowed actions, for `evaluate`."""

    def __init__(self, dqn: DQN) -> None:
        self.policy = dqn.policy.eval()

    def __call__(self, observations: dict[str, NDArray[Any]]) -> NDArray[np.int64]:
        """Actions, shape (drones,), for flat observations with masks."""
        shown = Batch(obs=observations["observation"], mask=observations["action_mask"] == 1)
        with torch.no_grad():
            return self.policy(Batch(obs=shown, info=Batch())).act


def main() -> None:
    parser = training.arguments(__doc__, steps=40_000, short=500)
    parser.add_argument(
        "--num-envs", metavar="N", type=int, default=8, help="environments to collect from (8)"
    )
    options = parser.parse_args()
    dqn = train(options)
    training.compare_with_baselines(
        TrainedPolicy(dqn),
        TRAINING_TASK,
        action_mask=True,
        right_of_way=True,
        episodes=options.episodes,
        name="dqn",
        folder=options.out,
    )


if __name__ == "__main__":
    main()
