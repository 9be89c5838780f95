"""Ray RLlib (extra ``rllib``): a batch of drones, a masked network, and the success rate.

See examples/train_rllib.py.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from gymnasium.vector import VectorWrapper
from numpy.typing import NDArray

from DroneSwarmSearch._internal.extras import imports_of
from DroneSwarmSearch.adapters.trained_policy import LEAST_LOGIT
from DroneSwarmSearch.single_drone_env import make_drones

with imports_of("rllib"):
    import torch
    from ray.rllib.algorithms.ppo.torch.default_ppo_torch_rl_module import DefaultPPOTorchRLModule
    from ray.rllib.core import (
        COMPONENT_LEARNER,
        COMPONENT_LEARNER_GROUP,
        COMPONENT_RL_MODULE,
        DEFAULT_MODULE_ID,
    )
    from ray.rllib.core.columns import Columns
    from ray.rllib.core.rl_module.rl_module import RLModule

__all__ = ["DroneBatch", "MaskedPPOModule", "log_success", "logits"]

OBSERVATION = "observation"
ACTION_MASK = "action_mask"
"""The keys of masked observations."""

SEED_STRIDE = 10**9  # the distance between the seeds of env runners


class DroneBatch(VectorWrapper):
    """A `DroneVectorEnv` for RLlib's ``gym_env_vectorize_mode="vector_entry_point"``.

    Every sub-environment is a drone, and all share one policy, on RLlib's single-agent path.
    ``num_envs_per_env_runner`` is a multiple of the number of drones in a swarm, and RLlib counts
    the steps of single drones.

    Args:
        config: RLlib's `env_config`: keywords of `DroneVectorEnv`, by default with
            ``observation="flat"`` and ``action_mask="observation"``. RLlib adds "num_envs".

    Raises:
        TypeError: a keyword is unknown or has the wrong type.
        ValueError: a keyword is out of its limits, "num_envs" is missing or not a multiple of
            the number of drones.
    """

    def __init__(self, config: Mapping[str, Any]) -> None:
        if "num_envs" not in config:
            raise ValueError(
                "num_envs is missing: DroneBatch needs "
                'env_runners(gym_env_vectorize_mode="vector_entry_point")'
            )
        usual = {"action_mask": OBSERVATION, "separate_flags": False}
        super().__init__(make_drones(**{**usual, **config}))

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin episodes; env runners get consecutive seeds, and play different episodes."""
        return self.env.reset(seed=None if seed is None else seed * SEED_STRIDE, options=options)


class MaskedPPOModule(DefaultPPOTorchRLModule):
    """PPO's default network, which never chooses a masked action.

    It takes observations {"observation": ..., "action_mask": ...}; its `model_config` is that
    of RLlib's default, for example ``DefaultModelConfig``. Masks also apply in training, so that
    probabilities and entropies are those of the allowed actions.

    Raises:
        ValueError: the observation space has no masks.
    """

    def __init__(self, *, observation_space: Any, **keywords: Any) -> None:
        if ACTION_MASK not in getattr(observation_space, "spaces", ()):
            raise ValueError(
                f"observation_space must have {ACTION_MASK!r}, got {observation_space}"
            )
        super().__init__(observation_space=observation_space[OBSERVATION], **keywords)
        self.observation_space = observation_space  # saved in checkpoints

    def _forward(self, batch: dict[str, Any], **keywords: Any) -> dict[str, Any]:
        return _masked(super()._forward, batch, **keywords)

    def _forward_train(self, batch: dict[str, Any], **keywords: Any) -> dict[str, Any]:
        return _masked(super()._forward_train, batch, **keywords)

    def compute_values(self, batch: dict[str, Any], embeddings: Any = None) -> Any:
        """The critic's values of a batch; the masks play no part."""
        return super().compute_values(_without_masks(batch), embeddings)


def _masked(
    forward: Callable[..., dict[str, Any]], batch: dict[str, Any], **keywords: Any
) -> dict[str, Any]:
    """The output of a forward method, with masked logits."""
    output = forward(_without_masks(batch), **keywords)
    forbidden = batch[Columns.OBS][ACTION_MASK] == 0
    masked = output[Columns.ACTION_DIST_INPUTS].masked_fill(forbidden, LEAST_LOGIT)
    return {**output, Columns.ACTION_DIST_INPUTS: masked}


def _without_masks(batch: dict[str, Any]) -> dict[str, Any]:
    return {**batch, Columns.OBS: batch[Columns.OBS][OBSERVATION]}


def log_success(*, episode: Any, metrics_logger: Any, **_: Any) -> None:
    """Log the success of episodes: ``AlgorithmConfig.callbacks(on_episode_end=log_success)``.

    ``results["env_runners"]["success_rate"]`` is the fraction of the episodes since the last
    results that ended with success. If the infos hold it, "probability_of_success" is the mean at
    the episodes' ends. With several env runners, both are means over the runners. RLlib
    passes the `metrics_logger`, and the `episode` of one drone or of all drones of a swarm.
    """
    infos = episode.get_infos(-1)
    if "is_success" not in infos:  # a dict with the infos of every drone
        infos = next(iter(infos.values()))
    metrics_logger.log_value("success_rate", float(infos["is_success"]), reduce="mean")
    if (probability := infos.get("probability_of_success")) is not None:
        metrics_logger.log_value("probability_of_success", float(probability), reduce="mean")


def logits(
    checkpoint: str | Path, module_id: str = DEFAULT_MODULE_ID
) -> Callable[[Mapping[str, Any]], NDArray[Any]]:
    """The masked network in a `checkpoint`, for `TrainedPolicy`.

    ``Algorithm.save_to_path`` wrote the folder. `module_id` is the name of the RLModule, by
    default on the single-agent path.
    """
    learner = Path(checkpoint).absolute() / COMPONENT_LEARNER_GROUP / COMPONENT_LEARNER
    module = RLModule.from_checkpoint(learner / COMPONENT_RL_MODULE / module_id)

    def masked_logits(observations: Mapping[str, Any]) -> NDArray[Any]:
        batch = {key: torch.from_numpy(array) for key, array in observations.items()}
        output = module.forward_inference({Columns.OBS: batch})
        values: NDArray[Any] = output[Columns.ACTION_DIST_INPUTS].numpy()
        return values

    return masked_logits
