"""Stable-Baselines3 and sb3-contrib (extra ``sb3``): a vector environment, runs, and evaluation.

Every drone is a sub-environment, and all drones share one policy::

    masks = {"right_of_way": True}
    drones = DroneVectorEnv(
        64, observation="flat", autoreset_mode="SameStep", **masks, **TRAINING_TASK
    )
    with training.Run(options, "MaskablePPO", "model.zip") as run:
        model = MaskablePPO("MlpPolicy", VecMonitor(SB3VecEnv(drones)))
        model.learn(200_000, RunCallback(run))
    view = View("drone", "flat", action_mask=True, **masks)
    evaluate(TrainedPolicy(model), search, view=view)
"""

from __future__ import annotations

import inspect
from copy import deepcopy
from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecEnv

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch.adapters._sampling import SamplingPolicy
from DroneSwarmSearch.training.run import Run
from DroneSwarmSearch.vector.drone_vector_env import DroneVectorEnv
from DroneSwarmSearch.vector.swarm_vector_env import SwarmVectorEnv

__all__ = ["RunCallback", "SB3VecEnv", "TrainedPolicy"]

_INFOS = ("is_success", "probability_of_success")
"""The infos that Stable-Baselines3 gets, if the environment has them."""


class SB3VecEnv(VecEnv):
    """Adapts a vector environment to Stable-Baselines3.

    For example::

        env = DroneVectorEnv(
            64, observation="flat", autoreset_mode="SameStep", **TRAINING_TASK
        )
        model = PPO("MlpPolicy", SB3VecEnv(env))

    When an episode ends, the next one begins in the same step. The sub-environment's info then
    holds "terminal_observation" and "TimeLimit.truncated", which is True if the environment
    truncates without terminating (separate_flags=True). Every info holds "is_success", from
    which Stable-Baselines3 logs success rates, and "probability_of_success" if the
    environment's infos do. `env.batch` has the rest of the state. ``VecMonitor`` adds episode
    returns.

    `env_method("action_masks")` returns a mask for each sub-environment, as sb3-contrib's
    ``MaskablePPO`` expects; `right_of_way` is the environment's.

    Args:
        env: a `SwarmVectorEnv` or a `DroneVectorEnv` with autoreset_mode="SameStep".

    Raises:
        TypeError: `env` is not one of these.
        ValueError: `env` has another autoreset mode, or rewards too large for float32, the
            type that Stable-Baselines3 uses.
    """

    def __init__(self, env: SwarmVectorEnv | DroneVectorEnv) -> None:
        if not isinstance(env, (SwarmVectorEnv, DroneVectorEnv)):
            raise TypeError(f"env must be a SwarmVectorEnv or a DroneVectorEnv, got {env!r}")
        mode = env.metadata["autoreset_mode"]
        if mode is not AutoresetMode.SAME_STEP:
            raise ValueError(f"env must have autoreset_mode='SameStep', got {mode.value!r}")
        largest = env.largest_reward
        if largest > float(np.finfo(np.float32).max):
            raise ValueError(
                f"env must have rewards that float32 can hold, got rewards up to {largest:g} "
                "(see reward_scale)"
            )
        self.env = env
        self.metadata = env.metadata
        self._actions: NDArray[Any] | None = None
        super().__init__(env.num_envs, env.single_observation_space, env.single_action_space)

    @property
    def batch(self) -> Any:
        """The `SearchBatch` of the environment."""
        return self.env.batch

    def reset(self) -> Any:
        """Begin episodes in all sub-environments; returns the observations."""
        if any(not _equal(options, self._options[0]) for options in self._options):
            raise ValueError("options must be the same for all sub-environments")
        # The base class's `seed` sets consecutive seeds; the first is enough.
        observations, infos = self.env.reset(seed=self._seeds[0], options=self._options[0] or None)
        self._reset_seeds()
        self._reset_options()
        self.reset_infos: list[dict[str, Any]] = self._listed(infos)
        return self._kept(observations)

    def step_async(self, actions: NDArray[Any]) -> None:
        """Set the actions of the next step."""
        self._actions = actions

    def step_wait(self) -> tuple[Any, NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        """Make the step; returns observations, rewards, dones and infos."""
        if self._actions is None:
            raise RuntimeError("step_wait: no actions have been given; call step_async() first")
        observations, rewards, terminated, truncated, infos = self.env.step(self._actions)
        dones = terminated | truncated
        listed = self._listed(infos)
        ended = dones.nonzero()[0].tolist()
        final = self._listed(infos["final_info"]) if ended else []
        for index in ended:
            listed[index] = {
                **final[index],
                "terminal_observation": infos["final_obs"][index],
                "TimeLimit.truncated": bool(truncated[index] and not terminated[index]),
            }
        return self._kept(observations), rewards.astype(np.float32), dones, listed

    def _listed(self, infos: dict[str, Any]) -> list[dict[str, Any]]:
        """An info for each sub-environment."""
        names = [name for name in _INFOS if name in infos]
        columns = [infos[name].tolist() for name in names]
        return [dict(zip(names, values, strict=True)) for values in zip(*columns, strict=True)]

    def _kept(self, observations: Any) -> Any:
        """Observations that the next step does not overwrite: the caller keeps the last ones."""
        return deepcopy(observations) if not self.env.copies else observations

    def get_images(self) -> list[Any]:
        """A picture of every swarm, if the environment has render_mode="rgb_array"."""
        return list(self.env.render() or ())

    def close(self) -> None:
        """Close the environment."""
        self.env.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """An attribute of the environment, once for each of these sub-environments."""
        return [getattr(self.env, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Set an attribute of the environment."""
        setattr(self.env, attr_name, value)

    def env_method(
        self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any
    ) -> list[Any]:
        """Call a method of the environment once; returns its result for each sub-environment.

        The result of "action_masks" is split: each sub-environment gets its own row.
        """
        chosen = self._get_indices(indices)
        if method_name == "action_masks":
            masks = self.env.action_masks(*args, **kwargs)
            return [masks[index] for index in chosen]
        result = getattr(self.env, method_name)(*args, **kwargs)
        return [result for _ in chosen]

    def env_is_wrapped(self, wrapper_class: type, indices: Any = None) -> list[bool]:
        """Whether sub-environments are wrapped: False for each."""
        return [False for _ in self._get_indices(indices)]


class RunCallback(BaseCallback):
    """Adds a row to a run's learning curve after each rollout, and saves the model.

    The model's environment is ``VecMonitor(SB3VecEnv(...))``. The row holds the mean return, in
    unscaled points, and the success rate of the episodes that ended; in the coverage mission,
    their mean probability of success. Steps are environment steps.

    Args:
        run: the run; its checkpoint is the file of the model.
    """

    def __init__(self, run: Run) -> None:
        super().__init__()
        self._run = run
        self._returns: list[float] = []
        self._successes: list[float] = []

    def _on_training_start(self) -> None:
        [env] = self.training_env.get_attr("unwrapped", [0])
        self._drones = env.num_envs // env.batch.num_rows  # sub-environments in a swarm
        self._scale = env.reward_scale
        is_coverage = env.batch.scenario_of(0).mission == "coverage"
        self._success = "probability_of_success" if is_coverage else "is_success"

    def _on_step(self) -> bool:
        for index in self.locals["dones"].nonzero()[0]:
            info = self.locals["infos"][index]
            self._returns.append(info["episode"]["r"] / self._scale)
            self._successes.append(info[self._success])
        return True

    def _on_rollout_end(self) -> None:
        steps = self.num_timesteps // self._drones
        if self._returns:
            self._run.log(steps, float(np.mean(self._returns)), float(np.mean(self._successes)))
        else:
            self._run.log(steps)
        self._returns, self._successes = [], []

    def _on_rollout_start(self) -> None:  # before the first, then after every update
        self._save()

    def _on_training_end(self) -> None:
        self._save()

    def _save(self) -> None:
        with self._run.saving(self._run.checkpoint_name) as path:
            self.model.save(path)


class TrainedPolicy(SamplingPolicy):
    """A trained model as a policy for `evaluation.evaluate`.

    If the model was trained with masks, pass `evaluate` the same `action_mask` and
    `right_of_way`. The observations are then {"observation": ..., "action_mask": ...}; the
    model gets what it was trained with. The samples follow from the seeds of the episodes, and do
    not change PyTorch's random state.

    Args:
        model: a model of Stable-Baselines3 or sb3-contrib.
        deterministic: whether to take the most likely actions. By default, actions are sampled,
            as PPO does while it learns.

    Raises:
        TypeError: `model` is not such a model, or `deterministic` is not a bool.
    """

    def __init__(self, model: BaseAlgorithm, deterministic: bool = False) -> None:
        if not isinstance(model, BaseAlgorithm):
            raise TypeError(f"model must be one of Stable-Baselines3, got {model!r}")
        super().__init__()
        self._policy = model.policy
        self._deterministic = checks.boolean("deterministic", deterministic)
        self._takes_masks = "action_masks" in inspect.signature(self._policy.predict).parameters
        space = model.observation_space
        self._entries = [*space.spaces] if isinstance(space, spaces.Dict) else []

    def __call__(self, observations: Any) -> NDArray[np.int64]:
        """Actions of M drones, int64, shape (M,); of M swarms, shape (M, n_drones).

        Args:
            observations: those of `evaluate`, of all drones or swarms.

        Raises:
            ValueError: the observations lack entries that the model was trained with.
        """
        shown, masks = observations, {}
        if isinstance(observations, dict) and "action_mask" in observations:
            given = observations["action_mask"]
            if self._takes_masks:
                masks["action_masks"] = given.reshape(len(given), -1)
            if "action_mask" not in self._entries:
                shown = observations["observation"]
        if self._entries:  # `evaluate` adds "row" to a swarm's dict
            if not isinstance(shown, dict) or not {*self._entries} <= {*shown}:
                raise ValueError(
                    f"observations must have the entries {self._entries}; pass `evaluate` the "
                    "view, observation and action_mask that the model was trained with"
                )
            shown = {name: shown[name] for name in self._entries}
        actions: NDArray[np.int64]
        with self._seeded_torch():
            actions, _ = self._policy.predict(shown, deterministic=self._deterministic, **masks)
        return actions


def _equal(options: dict[str, Any], others: dict[str, Any]) -> bool:
    return options.keys() == others.keys() and all(
        np.array_equal(value, others[name]) for name, value in options.items()
    )
