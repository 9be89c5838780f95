"""PPO with Ray RLlib: one network for all drones, on this machine or on a cluster.

    pip install "DroneSwarmSearchEnvironment[rllib,evaluation]"
    python examples/train_rllib.py --out runs/rllib
    python examples/train_rllib.py --out runs/rllib2 --num-env-runners 2
    python examples/train_rllib.py --out runs/rllib3 --num-env-runners 32 --address auto

Without runners everything happens in this process. With some, each plays in a process of
its own on a processor of its own, wherever the cluster has one; this package must be
installed there. The network learns in this process, which also keeps the folder.
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
from DroneSwarmSearch.wrappers import ActionMask, FlatObservation, ScaledRewards

SEARCH = training.TRAINING_TASK

NETWORK = "drone"
"""The name of the network that all drones share."""

OBSERVATION, MASK = "observations", "action_mask"
"""The keys of an observation that RLlib's masking module looks for."""

SCALE = 2.0**-17
"""Of the rewards: 100,000 points become less than one."""

APART = 10**9
"""Between the seeds of two runners: RLlib's are neighbours, which would share their seas."""


class SearchEnv(ParallelPettingZooEnv):
    """The environment as RLlib's runners play it; moves that may end in a crash are masked."""

    def __init__(self, context: EnvContext) -> None:
        # The limit ends a search like all else: drones see it come, and pay for it.
        env = FlatObservation(ScaledRewards(DroneSwarmSearch(**SEARCH), scale=SCALE))
        super().__init__(ActionMask(env, in_observation=True, right_of_way=True))
        self.first_seed = APART * (1 + context.worker_index)  # beyond the evaluation's
        self.observation_space = spaces.Dict(
            {
                drone: spaces.Dict({OBSERVATION: each["observation"], MASK: each["action_mask"]})
                for drone, each in self.observation_space.items()
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
    """Observations with masks, by the keys that RLlib's masking module looks for."""
    return {
        drone: {OBSERVATION: seen["observation"], MASK: seen["action_mask"]}
        for drone, seen in observations.items()
    }


def count_episode(
    *,
    episode: MultiAgentEpisode,
    prev_episode_chunks: Sequence[MultiAgentEpisode],
    metrics_logger: Any,
    **_: Any,
) -> None:
    """Count an episode that has ended; a long one is sampled in several chunks."""
    parts = [*prev_episode_chunks, episode]
    points = sum(part.get_return() for part in parts) / SCALE / len(episode.agent_ids)
    found = any(info["Found"] for info in episode.get_infos(-1).values())
    metrics_logger.log_dict({"ended": 1, "found": int(found), "points": points}, reduce="sum")


def algorithm(options: Namespace, seed: int) -> Algorithm:
    """PPO, not yet trained."""
    layers = DefaultModelConfig(
        fcnet_hiddens=[128, 128], fcnet_activation="tanh", vf_share_layers=False
    )
    config = (
        PPOConfig()
        .environment(SearchEnv)
        .env_runners(
            num_env_runners=options.num_env_runners,
            num_envs_per_env_runner=options.num_envs_per_env_runner,
        )
        .multi_agent(policies={NETWORK}, policy_mapping_fn=lambda drone, *_, **__: NETWORK)
        .rl_module(rl_module_spec=RLModuleSpec(ActionMaskingTorchRLModule, model_config=layers))
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
        .callbacks(on_episode_end=count_episode)
        .debugging(seed=seed, log_level="ERROR")
    )
    return config.build_algo()


class TrainedPolicy:
    """The network of a checkpoint, as `DroneSwarmSearch.evaluation` takes policies.

    Args:
        path: of the checkpoint; nothing else of the training is needed to play.
    """

    def __init__(self, path: Path) -> None:
        learner = path.absolute() / COMPONENT_LEARNER_GROUP / COMPONENT_LEARNER
        self.module = RLModule.from_checkpoint(learner / COMPONENT_RL_MODULE / NETWORK)
        self.reset(seed=0)

    def reset(self, seed: int | Sequence[int], rows: None = None) -> None:
        """Begin the random numbers anew, as `evaluation` does before it plays episodes."""
        self.rng = np.random.default_rng(seed)

    def __call__(self, seen: NDArray[np.float32]) -> NDArray[np.int64]:
        """An action for every drone, shape (drones,), drawn as in training.

        The likeliest one, always taken, would let drones go round in circles that have not
        been trained for long.
        """
        masks = training.masks_of_flat(seen, SEARCH).astype(np.int8)
        shown = {OBSERVATION: torch.from_numpy(seen), MASK: torch.from_numpy(masks)}
        with torch.no_grad():
            output = self.module.forward_inference({Columns.OBS: shown})
        logits = output[Columns.ACTION_DIST_INPUTS].numpy()
        # The greatest of logits with Gumbel noise is a draw from their softmax.
        actions: NDArray[np.int64] = (logits + self.rng.gumbel(size=logits.shape)).argmax(axis=1)
        return actions


def train(run: training.Run, options: Namespace) -> Path:
    """Train until the steps are done; returns the checkpoint's path."""

    def save() -> None:
        with run.saving_folder(f"checkpoint_{run.steps_done}") as path:
            learning.save_to_path(path)

    learning = algorithm(options, options.seed + run.steps_done)  # resumed, in other seas
    if run.resuming:
        learning.restore_from_path(run.checkpoint.absolute())
        counted = (ENV_RUNNER_RESULTS, NUM_ENV_STEPS_SAMPLED_LIFETIME)
        played = learning.metrics.peek(counted, default=0)  # nothing is counted at the beginning
        run.resume_from(int(played))
    else:
        save()
    while run.steps_done < run.total_steps:
        got = learning.train()[ENV_RUNNER_RESULTS]
        save()
        ended = got.get("ended", 0)
        run.log(
            int(got[NUM_ENV_STEPS_SAMPLED_LIFETIME]),
            reward=got["points"] / ended if ended else None,
            found=got["found"] / ended if ended else None,
        )
    learning.stop()
    return run.checkpoint


def main() -> None:
    """Train, then compare the result with the baselines."""
    parser = training.arguments(__doc__, steps=200_000, short=1_000)
    parser.add_argument(
        "--num-env-runners", type=int, default=0, metavar="N", help="processes that play (0)"
    )
    parser.add_argument(
        "--num-envs-per-env-runner",
        type=int,
        default=16,
        metavar="N",
        help="environments that each plays at a time (16)",
    )
    parser.add_argument(
        "--batch", type=int, default=4_000, metavar="N", help="steps between updates (4,000)"
    )
    parser.add_argument(
        "--address",
        default="local",
        help="of a running Ray cluster, or auto: the one that this machine belongs to; without "
        "it Ray begins on this machine alone",
    )
    options = parser.parse_args()

    with training.Run(options, "PPO with RLlib", "checkpoint") as run:
        ray.init(address=options.address, log_to_driver=False, logging_level="error")
        path = train(run, options)
        ray.shutdown()
    training.compare_with_baselines(
        TrainedPolicy(path),
        SEARCH,
        episodes=options.episodes,
        name="rllib-ppo",
        folder=run.folder,
    )


if __name__ == "__main__":
    main()
