"""The base class of the wrappers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from gymnasium import spaces
from pettingzoo import ParallelEnv
from pettingzoo.utils import BaseParallelWrapper

from DroneSwarmSearch._internal.mappings import Infos, Rewards
from DroneSwarmSearch.env import DroneSwarmSearch

__all__ = ["Flags", "Observations", "SearchWrapper", "Step"]

Observations = dict[str, Any]
Flags = dict[str, bool]
Step = tuple[Observations, Rewards, Flags, Flags, Infos]
"""What `step` returns: observations, rewards, terminations, truncations, infos."""


class SearchWrapper(BaseParallelWrapper[str, Any, int]):
    """A wrapper of `DroneSwarmSearch`, or of a wrapper of it.

    Attributes that the wrapper lacks are those of the wrapped environment: `scenario`,
    `frame`, `state_space` and so on.

    Args:
        env: the environment.

    Raises:
        TypeError: `env` is not such an environment in its parallel form.
    """

    def __init__(self, env: ParallelEnv[str, Any, int]) -> None:
        if not isinstance(env, ParallelEnv) or not isinstance(env.unwrapped, DroneSwarmSearch):
            raise TypeError(
                f"env must be a DroneSwarmSearch, or a parallel wrapper of one, got {env!r}"
            )
        super().__init__(env)
        self._search: DroneSwarmSearch = env.unwrapped
        self._names = tuple(env.possible_agents)

    def reset(
        self, seed: int | None = None, options: Mapping[str, Any] | None = None, **arguments: Any
    ) -> tuple[Observations, Infos]:
        """Begin an episode; takes the arguments of the wrapped environment's `reset`."""
        observations, infos = self.env.reset(seed=seed, options=options, **arguments)
        return observations, infos

    def step(self, actions: Mapping[str, int]) -> Step:
        """Let every drone act once."""
        step: Step = self.env.step(actions)
        return step

    @property
    def agents(self) -> list[str]:  # faster than __getattr__
        """The drones of the running episode; empty between episodes."""
        agents: list[str] = self.env.agents
        return agents

    @property
    def observation_spaces(self) -> dict[str, spaces.Space[Any]]:
        """`observation_space` of every drone."""
        return {agent: self.observation_space(agent) for agent in self.possible_agents}

    @property
    def action_spaces(self) -> dict[str, spaces.Space[Any]]:
        """`action_space` of every drone."""
        return {agent: self.action_space(agent) for agent in self.possible_agents}
