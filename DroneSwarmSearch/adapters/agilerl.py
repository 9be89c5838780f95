"""AgileRL (extra ``agilerl``): names by which its multi-agent algorithms share one network.

AgileRL's single-agent algorithms take a `DroneVectorEnv` directly: each sub-environment is a drone,
so all drones share one network.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeVar

from gymnasium import spaces
from pettingzoo import ParallelEnv

from DroneSwarmSearch._internal.mappings import Infos, Rewards
from DroneSwarmSearch.wrappers.wrapper import Observations, SearchWrapper, Step

__all__ = ["SharedNames"]

Value = TypeVar("Value")


class SharedNames(SearchWrapper):
    """Renames the drones to "drone_0", "drone_1", ...; apply it last, as the outermost wrapper.

    AgileRL's multi-agent algorithms share networks between agents whose names are equal up to
    the last underscore.

    Args:
        env: a `DroneSwarmSearch` or a wrapper of one.

    Raises:
        TypeError: `env` is not a `DroneSwarmSearch` or a wrapper of one.
    """

    def __init__(self, env: ParallelEnv[str, Any, int]) -> None:
        super().__init__(env)
        self._renamed = {name: f"drone_{number}" for number, name in enumerate(env.possible_agents)}
        self._original = {new: old for old, new in self._renamed.items()}

    @property
    def possible_agents(self) -> list[str]:
        """All drones."""
        return list(self._original)

    @property
    def agents(self) -> list[str]:
        """The drones of the running episode; empty between episodes."""
        return [self._renamed[name] for name in self.env.agents]

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """The space of a drone's observations; the same object at every call."""
        space: spaces.Space[Any] = self.env.observation_space(self._original[agent])
        return space

    def action_space(self, agent: str) -> spaces.Space[Any]:
        """The space of a drone's actions; the same object at every call."""
        space: spaces.Space[Any] = self.env.action_space(self._original[agent])
        return space

    def reset(
        self, seed: int | None = None, options: Mapping[str, Any] | None = None, **arguments: Any
    ) -> tuple[Observations, Infos]:
        """Begin an episode; takes the arguments of the wrapped environment's `reset`."""
        observations, infos = self.env.reset(seed=seed, options=options, **arguments)
        return self._rename(observations), Infos(self._rename(infos))

    def step(self, actions: Mapping[str, int]) -> Step:
        """Let every drone act once."""
        original = self._original
        by_drone = {original.get(name, name): action for name, action in actions.items()}
        observations, rewards, terminations, truncations, infos = self.env.step(by_drone)
        return (
            self._rename(observations),
            Rewards(self._rename(rewards)),
            self._rename(terminations),
            self._rename(truncations),
            Infos(self._rename(infos)),
        )

    def _rename(self, by_drone: Mapping[str, Value]) -> dict[str, Value]:
        return {self._renamed[name]: value for name, value in by_drone.items()}
