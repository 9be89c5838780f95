"""The batch as a `VecEnv` of Stable-Baselines3, which this module alone imports."""

from __future__ import annotations

from copy import deepcopy
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch.vector.vector_env import SearchVectorEnv

__all__ = ["SB3VecEnv"]


class SB3VecEnv(VecEnv):
    """A view of the batch for Stable-Baselines3.

    For example::

        env = DroneVectorEnv(64, observation="flat", autoreset_mode="SameStep")
        model = PPO("MlpPolicy", SB3VecEnv(env))

    A slot whose episode ends begins anew in the same step; its info then holds
    "terminal_observation" and "TimeLimit.truncated", which is True where the view truncates
    without terminating (separate_flags=True). Otherwise a slot's info is empty: `env.batch`
    knows the rest. ``VecMonitor`` adds the returns of episodes.

    `env_method("action_masks")` gives every slot's mask of sensible actions, as
    ``MaskablePPO`` of sb3-contrib wants it.

    Args:
        env: a `SwarmVectorEnv` or a `DroneVectorEnv` with autoreset_mode="SameStep".
        right_of_way: mask moves to where a drone of a lower number may be next, too; see
            `masks.action_masks`.

    Raises:
        TypeError: `env` is no such view, or `right_of_way` neither True nor False.
        ValueError: it begins episodes anew at another time.
    """

    def __init__(self, env: SearchVectorEnv, right_of_way: bool = False) -> None:
        if not isinstance(env, SearchVectorEnv):
            raise TypeError(f"env must be a SwarmVectorEnv or a DroneVectorEnv, got {env!r}")
        mode = env.metadata["autoreset_mode"]
        if mode is not AutoresetMode.SAME_STEP:
            raise ValueError(f"env must have autoreset_mode='SameStep', got {mode.value!r}")
        self.env = env
        self._right_of_way = checks.boolean("right_of_way", right_of_way)
        self.metadata = env.metadata
        self._actions: NDArray[Any] | None = None
        super().__init__(env.num_envs, env.single_observation_space, env.single_action_space)

    @property
    def batch(self) -> Any:
        """The engine."""
        return self.env.batch

    def reset(self) -> Any:
        """Begin episodes everywhere; returns the observations."""
        if any(not _alike(options, self._options[0]) for options in self._options):
            raise ValueError("options must be the same for all slots: a reset is one for all")
        # `seed` of the base class notes a seed for every slot; the first begins the count.
        observations, _ = self.env.reset(seed=self._seeds[0], options=self._options[0] or None)
        self._reset_seeds()
        self._reset_options()
        self.reset_infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        return self._kept(observations)

    def step_async(self, actions: NDArray[Any]) -> None:
        """Take the actions of a step."""
        self._actions = actions

    def step_wait(self) -> tuple[Any, NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        """Make the step: observations, rewards, whether episodes ended, infos."""
        if self._actions is None:
            raise RuntimeError("step_wait: no actions have been given; call step_async() first")
        observations, rewards, terminated, truncated, infos = self.env.step(self._actions)
        dones = terminated | truncated
        told: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for slot in dones.nonzero()[0].tolist():
            told[slot] = {
                "terminal_observation": infos["final_obs"][slot],
                "TimeLimit.truncated": bool(truncated[slot] and not terminated[slot]),
            }
        return self._kept(observations), rewards.astype(np.float32), dones, told

    def _kept(self, observations: Any) -> Any:
        """Observations that the next step leaves alone: Stable-Baselines3 keeps the last ones."""
        return deepcopy(observations) if self.env.reuses_arrays else observations

    def get_images(self) -> list[Any]:
        """A picture of every swarm, if the view has render_mode="rgb_array"."""
        return list(self.env.render() or ())

    def close(self) -> None:
        """Close the view."""
        self.env.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """An attribute of the view, once for each of these slots."""
        return [getattr(self.env, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Set an attribute of the view."""
        setattr(self.env, attr_name, value)

    def env_method(
        self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any
    ) -> list[Any]:
        """Call a method of the view once; its result for each of these slots.

        Of "action_masks" each slot gets its own row.
        """
        slots = self._get_indices(indices)
        if method_name == "action_masks":
            if not args:
                kwargs.setdefault("right_of_way", self._right_of_way)
            masks = self.env.action_masks(*args, **kwargs)
            return [masks[slot] for slot in slots]
        result = getattr(self.env, method_name)(*args, **kwargs)
        return [result for _ in slots]

    def env_is_wrapped(self, wrapper_class: type, indices: Any = None) -> list[bool]:
        """Whether slots are wrapped: they are not."""
        return [False for _ in self._get_indices(indices)]


def _alike(options: dict[str, Any], others: dict[str, Any]) -> bool:
    """Whether options are equal, arrays among them."""
    return options.keys() == others.keys() and all(
        np.array_equal(value, others[name]) for name, value in options.items()
    )
