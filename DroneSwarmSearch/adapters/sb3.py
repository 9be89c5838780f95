"""Stable-Baselines3 and sb3-contrib (extra ``sb3``): a vector environment, and evaluation.

Every drone is a sub-environment, and all drones share one policy; see examples/train_sb3.py.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from DroneSwarmSearch._internal.extras import imports_of
from DroneSwarmSearch.adapters.trained_policy import TrainedPolicy, listed
from DroneSwarmSearch.core.scenario import Scenario
from DroneSwarmSearch.layouts.view import View
from DroneSwarmSearch.vector.engine import SearchBatch
from DroneSwarmSearch.vector.observations import BatchObservations
from DroneSwarmSearch.vector.vector_env import DroneVectorEnv, SwarmVectorEnv

with imports_of("sb3"):
    import torch
    from stable_baselines3.common.base_class import BaseAlgorithm
    from stable_baselines3.common.callbacks import BaseCallback
    from stable_baselines3.common.policies import ActorCriticPolicy
    from stable_baselines3.common.save_util import load_from_zip_file
    from stable_baselines3.common.vec_env import VecEnv

__all__ = ["LogSuccess", "SB3Policy", "SB3VecEnv", "logits"]


class SB3VecEnv(VecEnv):
    """Adapts a vector environment to Stable-Baselines3.

    When an episode ends, the next one begins in the same step. The sub-environment's info then
    holds "terminal_observation" and "TimeLimit.truncated", which is True if the environment
    truncates without terminating (separate_flags=True). Every info holds "is_success", of which
    Stable-Baselines3 logs the rate, and "probability_of_success" if the environment's infos do.
    ``VecMonitor`` adds episode returns.

    `env_method("action_masks")` returns a mask for each sub-environment, as sb3-contrib's
    ``MaskablePPO`` expects; `right_of_way` is the environment's.

    Args:
        env: a `SwarmVectorEnv` or a `DroneVectorEnv` with autoreset_mode="SameStep" and copy=True,
            the default, because collectors keep the last observations over a step.

    Raises:
        ValueError: `env` has another autoreset mode.
    """

    def __init__(self, env: SwarmVectorEnv | DroneVectorEnv) -> None:
        mode = env.metadata["autoreset_mode"]
        if mode is not AutoresetMode.SAME_STEP:
            raise ValueError(f"env must have autoreset_mode='SameStep', got {mode.value!r}")
        self.env = env
        self.metadata = env.metadata
        super().__init__(env.num_envs, env.single_observation_space, env.single_action_space)

    def reset(self) -> Any:
        """Begin episodes in all sub-environments; returns the observations."""
        # The base class sets consecutive seeds, and equal options; the first ones are enough.
        observations, infos = self.env.reset(seed=self._seeds[0], options=self._options[0] or None)
        self._reset_seeds()
        self._reset_options()
        self.reset_infos: list[dict[str, Any]] = listed(infos)
        return observations

    def step_async(self, actions: NDArray[Any]) -> None:
        self._actions = actions

    def step_wait(self) -> tuple[Any, NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        """Make the step; returns observations, rewards, dones and infos."""
        observations, rewards, terminated, truncated, infos = self.env.step(self._actions)
        dones = terminated | truncated
        listed_infos = listed(infos)
        ended = dones.nonzero()[0].tolist()
        final = listed(infos["final_info"]) if ended else []
        for index in ended:
            listed_infos[index] = {
                **final[index],
                "terminal_observation": infos["final_obs"][index],
                "TimeLimit.truncated": bool(truncated[index] and not terminated[index]),
            }
        return observations, rewards.astype(np.float32), dones, listed_infos

    def get_images(self) -> list[Any]:
        """A picture for every drone or swarm, if the environment has render_mode="rgb_array"."""
        return list(self.env.render() or ())

    def close(self) -> None:
        self.env.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """An attribute of the environment, once for each of these sub-environments."""
        return [getattr(self.env, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        setattr(self.env, attr_name, value)

    def env_method(
        self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any
    ) -> list[Any]:
        """Call a method of the environment once; returns its result for each sub-environment.

        Of the result of "action_masks", each sub-environment gets its own row.
        """
        result = getattr(self.env, method_name)(*args, **kwargs)
        is_split = method_name == "action_masks"
        return [result[index] if is_split else result for index in self._get_indices(indices)]

    def env_is_wrapped(self, wrapper_class: type, indices: Any = None) -> list[bool]:
        return [False for _ in self._get_indices(indices)]


class LogSuccess(BaseCallback):
    """Logs "rollout/probability_of_success": its mean at the end of the rollout's episodes.

    In the coverage mission it is the policy's success. Stable-Baselines3 logs success itself.
    """

    def _on_step(self) -> bool:
        for index in self.locals["dones"].nonzero()[0]:
            success = self.locals["infos"][index]["probability_of_success"]
            self.logger.record_mean("rollout/probability_of_success", success)
        return True


def logits(model: BaseAlgorithm | ActorCriticPolicy) -> Callable[[Any], NDArray[Any]]:
    """The network of a trained model, for `TrainedPolicy`.

    `model` is an actor-critic model of Stable-Baselines3, or sb3-contrib's MaskablePPO, which uses
    the masks in the observations; or its policy.
    """
    policy = model.policy if isinstance(model, BaseAlgorithm) else model
    space = policy.observation_space
    names = [*space.spaces] if isinstance(space, spaces.Dict) else []
    uses_masks = _uses_masks(policy)

    def masked_logits(observations: Any) -> NDArray[Any]:
        inputs = observations
        masks = None
        if isinstance(observations, dict) and "action_mask" in observations:
            masks = observations["action_mask"]
            if "action_mask" not in names:
                inputs = observations["observation"]
        if names:  # `evaluate` adds "row" to a swarm's dict
            inputs = {name: inputs[name] for name in names}
        policy.set_training_mode(False)
        masking = {"action_masks": masks} if uses_masks else {}
        with torch.no_grad():
            chosen = policy.get_distribution(policy.obs_to_tensor(inputs)[0], **masking)
        parts = getattr(chosen, "distributions", None) or chosen.distribution  # one for each drone
        by_drone = parts if isinstance(parts, list) else [parts]
        values = np.stack([part.logits.cpu().numpy() for part in by_drone], axis=1)
        return values if isinstance(parts, list) else values[:, 0]

    return masked_logits


class SB3Policy(TrainedPolicy):
    """An actor-critic model, or a MaskablePPO, that Stable-Baselines3 has saved.

    It samples actions, as in training, and has no memory, so it observes the posterior. A model
    with another layout needs a subclass with its own attribute `view`::

        class Flat(SB3Policy):
            view = View("drone", "flat", bayesian_update=True)

    On the command line, it is ``file.py:SB3Policy:model.zip`` with a file that imports it.

    Args:
        scenario: the search to steer.
        path: the file, .zip; it can execute code, so only load files that you trust.

    Raises:
        OSError: the file cannot be read.
        ValueError: it holds no such model, or one that observes something else.
    """

    view = View("drone", "crops", action_mask=True, right_of_way=True, bayesian_update=True)

    def __init__(self, scenario: Scenario, path: str) -> None:
        data, params, _ = load_from_zip_file(path, device="cpu")
        kind: Any = (data or {}).get("policy_class")
        if data is None or not hasattr(kind, "get_distribution"):
            raise ValueError(f"{path} must hold an actor-critic model, got {kind}")
        space = data["observation_space"]
        policy = kind(space, data["action_space"], lambda _: 0.0, **data["policy_kwargs"])
        policy.load_state_dict(params["policy"])
        batch = SearchBatch(1, scenario=scenario)
        views = (
            replace(self.view, action_mask=True),
            replace(self.view, action_mask=False, right_of_way=False),
        )
        known = [_shapes(BatchObservations(batch, view).space) for view in views]
        if _shapes(space) not in known:
            raise ValueError(
                f"the model must observe a search like this as {self.view}, got {space}"
            )
        super().__init__(logits(policy), view=self.view)


def _shapes(space: spaces.Space[Any]) -> Any:
    if isinstance(space, spaces.Dict):
        return {name: _shapes(part) for name, part in space.items()}
    return space.shape


def _uses_masks(policy: ActorCriticPolicy) -> bool:
    return "action_masks" in inspect.signature(policy.predict).parameters
