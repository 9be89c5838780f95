"""What the wrappers share: whom they wrap, and where they change what passes through."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from gymnasium import spaces
from pettingzoo import ParallelEnv
from pettingzoo.utils import BaseParallelWrapper

from DroneSwarmSearch._internal.mappings import Infos, Rewards
from DroneSwarmSearch.env import DroneSwarmSearch

__all__ = ["SearchWrapper"]

Observations = dict[str, Any]
Flags = dict[str, bool]


class SearchWrapper(BaseParallelWrapper[str, Any, int]):
    """A wrapper of `DroneSwarmSearch`, or of a wrapper of it.

    Attributes that it does not have are those of what it wraps, to the innermost:
    `scenario`, `frame`, `state_space` and so on.

    Args:
        env: the environment.

    Raises:
        TypeError: `env` is no such environment in its parallel form.
    """

    def __init__(self, env: ParallelEnv[str, Any, int]) -> None:
        if not isinstance(env, ParallelEnv) or not isinstance(env.unwrapped, DroneSwarmSearch):
            raise TypeError(
                f"env must be a DroneSwarmSearch, or a parallel wrapper of one, got {env!r}"
            )
        super().__init__(env)

    def reset(
        self, seed: int | None = None, options: Mapping[str, Any] | None = None, **given: Any
    ) -> tuple[Observations, Infos]:
        """Begin an episode; takes what the wrapped environment's `reset` takes."""
        observations, infos = self.env.reset(seed=seed, options=options, **given)
        return self._shown(observations, infos)

    def step(self, actions: Mapping[str, int]) -> tuple[Observations, Rewards, Flags, Flags, Infos]:
        """Let every drone act once."""
        observations, rewards, terminations, truncations, infos = self.env.step(actions)
        rewards, flags = self._rewards(rewards), self._flags(terminations, truncations)
        observations, infos = self._shown(observations, infos)
        return observations, rewards, *flags, infos

    @property
    def observation_spaces(self) -> dict[str, spaces.Space[Any]]:
        """`observation_space` of every drone."""
        return {agent: self.observation_space(agent) for agent in self.possible_agents}

    @property
    def action_spaces(self) -> dict[str, spaces.Space[Any]]:
        """`action_space` of every drone."""
        return {agent: self.action_space(agent) for agent in self.possible_agents}

    # What a wrapper may change.

    def _shown(self, observations: Observations, infos: Infos) -> tuple[Observations, Infos]:
        return observations, infos

    def _rewards(self, rewards: Rewards) -> Rewards:
        return rewards

    def _flags(self, terminations: Flags, truncations: Flags) -> tuple[Flags, Flags]:
        return terminations, truncations
