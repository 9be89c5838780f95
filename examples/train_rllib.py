"""Train drones with Ray RLlib's PPO: one network for all drones, on one machine or a cluster.

    pip install "DroneSwarmSearchEnvironment[rllib,evaluation]"
    python examples/train_rllib.py --out runs/rllib
    python examples/train_rllib.py --out runs/rllib2 --num-env-runners 2
    python examples/train_rllib.py --out runs/rllib3 --num-env-runners 32 --address auto

By default, everything runs in this process. With env runners, each runs in its own process on any
CPU of the cluster, where this package must be installed; this process trains the network and keeps
the folder.
"""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import ray
import torch
from gymnasium import spaces
from numpy.typing import NDArray
from ray.rllib.algorithms.algorithm import Algorithm
from ray.rllib.algorithms.ppo import PPOConfig
from ray.rllib.core import COMPONENT_LEARNER, COMPONENT_LEARNER_GROUP, COMPONENT_RL_MODULE
from ray.rllib.core.columns import Columns
from ray.rllib.core.rl_module.default_model_config import DefaultModelConfig
from ray.rllib.core.rl_module.rl_module import RLModule, RLModuleSpec
from ray.rllib.env.env_context import EnvContext
from ray.rllib.env.multi_agent_episode import MultiAgentEpisode
from ray.rllib.env.wrappers.pettingzoo_env import ParallelPettingZooEnv
from ray.rllib.examples.rl_modules.classes.action_masking_rlm import ActionMaskingTorchRLModule
from ray.rllib.utils.metrics import ENV_RUNNER_RESULTS, NUM_ENV_STEPS_SAMPLED_LIFETIME

from DroneSwarmSearch import DroneSwarmSearch, training
from DroneSwarmSearch.training import TRAINING_TASK
from DroneSwarmSearch.wrappers import ActionMask, FlatObservation, ScaledRewards

MODULE_ID = "drone"  # the RLModule that all drones share

OBSERVATIONS, ACTION_MASK = "observations", "action_mask"  # the keys that RLlib's module expects

REWARD_SCALE = 2.0**-17  # brings a return of 100,000 points below 1

SEED_STRIDE = 10**9  # RLlib gives neighbouring runners neighbouring seeds, which would overlap


class SearchEnv(ParallelPettingZooEnv):
    """The environment for RLlib, with masks against crashes."""

    def __init__(self, context: EnvContext) -> None:
        # The time limit terminates the episode: the drones observe the remaining time.
        env = FlatObservation(ScaledRewards(DroneSwarmSearch(**TRAINING_TASK), scale=REWARD_SCALE))
        super().__init__(ActionMask(env, in_observation=True, right_of_way=True))
        self.first_seed = SEED_STRIDE * (1 + context.worker_index)
        self.observation_space = spaces.Dict(
            {
                agent: spaces.Dict(
                    {OBSERVATIONS: space["observation"], ACTION_MASK: space["action_mask"]}
                )
                for agent, space in self.observation_space.items()
            }
        )

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> Any:
        if seed is not None:
            seed += self.first_seed
        observations, infos = super().reset(seed=seed, options=options)
        return renamed(observations), infos

    def step(self, actions: dict[str, int]) -> Any:
        observations, *others = super().step(actions)
        return renamed(observations), *others


def renamed(observations: dict[str, Any]) -> dict[str, Any]:
    """Observations with the keys that RLlib's module expects."""
    return {
        agent: {OBSERVATIONS: each["observation"], ACTION_MASK: each["action_mask"]}
        for agent, each in observations.items()
    }


def on_episode_end(
    *,
    episode: MultiAgentEpisode,
    prev_episode_chunks: Sequence[MultiAgentEpisode],
    metrics_logger: Any,
    **_: Any,
) -> None:
    """Record the return and the outcome; a long episode is sampled in several chunks."""
    chunks = [*prev_episode_chunks, episode]
    reward = sum(chunk.get_return() for chunk in chunks) / REWARD_SCALE / len(episode.agent_ids)
    found = any(info["Found"] for info in episode.get_infos(-1).values())
    metrics_logger.log_dict({"episodes": 1, "found": int(found), "reward": reward}, reduce="sum")


def build_algorithm(options: Namespace, seed: int) -> Algorithm:
    network = DefaultModelConfig(
        fcnet_hiddens=[128, 128], fcnet_activation="tanh", vf_share_layers=False
    )
    config = (
        PPOConfig()
        .environment(SearchEnv)
        .env_runners(
            num_env_runners=options.num_env_runners,
            num_envs_per_env_runner=options.num_envs_per_env_runner,
        )
        .multi_agent(policies={MODULE_ID}, policy_mapping_fn=lambda agent, *_, **__: MODULE_ID)
        .rl_module(rl_module_spec=RLModuleSpec(ActionMaskingTorchRLModule, model_config=network))
        .training(
            lr=5e-4,
            gamma=0.99,
            lambda_=0.95,
            entropy_coeff=0.005,
            use_kl_loss=False,
            train_batch_size_per_learner=min(options.batch, options.steps),
            minibatch_size=min(512, options.batch, options.steps),
            num_epochs=8,
        )
        .callbacks(on_episode_end=on_episode_end)
        .debugging(seed=seed, log_level="ERROR")
    )
    return config.build_algo()


class TrainedPolicy:
    """The policy for `evaluate`, loaded from a checkpoint.

    Args:
        path: path of the checkpoint; only its RLModule is loaded.
    """

    def __init__(self, path: Path) -> None:
        learner = path.absolute() / COMPONENT_LEARNER_GROUP / COMPONENT_LEARNER
        self.module = RLModule.from_checkpoint(learner / COMPONENT_RL_MODULE / MODULE_ID)
        self.reset(seed=0)

    def reset(self, seed: int | Sequence[int], rows: None = None) -> None:
        """Seed the sampling of actions; `evaluate` calls this before it plays episodes."""
        self.rng = np.random.default_rng(seed)

    def __call__(self, observations: dict[str, NDArray[Any]]) -> NDArray[np.int64]:
        """Sample actions, shape (drones,), for flat observations with masks.

        After a short training, the most likely actions would often lead drones in circles.
        """
        batch = {
            OBSERVATIONS: torch.from_numpy(observations["observation"]),
            ACTION_MASK: torch.from_numpy(observations["action_mask"]),
        }
        with torch.no_grad():
            output = self.module.forward_inference({Columns.OBS: batch})
        logits = output[Columns.ACTION_DIST_INPUTS].numpy()
        # The largest of logits with Gumbel noise is a sample from their softmax.
        actions: NDArray[np.int64] = (logits + self.rng.gumbel(size=logits.shape)).argmax(axis=1)
        return actions


def train(run: training.Run, options: Namespace) -> Path:
    """Train for all steps; returns the path of the last checkpoint."""

    def save(steps: int) -> None:
        with run.saving_folder(f"checkpoint_{steps}") as path:
            algorithm.save_to_path(path)

    algorithm = build_algorithm(options, options.seed + run.steps_done)  # resumed: new episodes
    if run.resuming:
        algorithm.restore_from_path(run.checkpoint.absolute())
        counter = (ENV_RUNNER_RESULTS, NUM_ENV_STEPS_SAMPLED_LIFETIME)
        run.resume_from(int(algorithm.metrics.peek(counter, default=0)))
    else:
        save(0)
    while run.steps_done < run.total_steps:
        results = algorithm.train()[ENV_RUNNER_RESULTS]
        steps = int(results[NUM_ENV_STEPS_SAMPLED_LIFETIME])
        save(steps)
        episodes = results.get("episodes", 0)
        run.log(
            steps,
            reward=results["reward"] / episodes if episodes else None,
            found=results["found"] / episodes if episodes else None,
        )
    algorithm.stop()
    return run.checkpoint


def main() -> None:
    parser = training.arguments(__doc__, steps=200_000, short=1_000)
    parser.add_argument(
        "--num-env-runners", type=int, default=0, metavar="N", help="remote env runners (0)"
    )
    parser.add_argument(
        "--num-envs-per-env-runner",
        type=int,
        default=16,
        metavar="N",
        help="environments of each runner (16)",
    )
    parser.add_argument(
        "--batch", type=int, default=4_000, metavar="N", help="steps between updates (4,000)"
    )
    parser.add_argument(
        "--address",
        default="local",
        help="address of a Ray cluster; 'auto' for the one that this machine belongs to; by "
        "default, a new one on this machine",
    )
    options = parser.parse_args()

    with training.Run(options, "PPO with RLlib", "checkpoint_*") as run:
        ray.init(address=options.address, log_to_driver=False, logging_level="error")
        path = train(run, options)
        ray.shutdown()
    training.compare_with_baselines(
        TrainedPolicy(path),
        TRAINING_TASK,
        action_mask=True,
        right_of_way=True,
        episodes=options.episodes,
        name="rllib-ppo",
        folder=run.folder,
    )


if __name__ == "__main__":
    main()
