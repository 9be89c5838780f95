"""Where the other drones are, which the observations of the environment do not tell."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces
from pettingzoo import ParallelEnv

from DroneSwarmSearch._internal.mappings import Infos
from DroneSwarmSearch.wrappers.layout import own_first
from DroneSwarmSearch.wrappers.wrapper import Observations, SearchWrapper

__all__ = ["OtherDrones"]

_NAME = "other_drones"


class OtherDrones(SearchWrapper):
    """Adds to each drone's observation where the others are.

    `observation["other_drones"]` is int32, shape (n_drones - 1, 2): the (x, y) of every
    other drone, in the order of their names.

    Args:
        env: the environment, whose observations are dicts: its own, or `DictObservation`'s.

    Raises:
        TypeError: `env` is no such environment.
        ValueError: its observations are of another form.
    """

    def __init__(self, env: ParallelEnv[str, Any, int]) -> None:
        super().__init__(env)
        n, size = self.unwrapped.n_drones, self.unwrapped.grid_size
        self._others = own_first(n)[:, 1:]
        self._spaces: dict[str, spaces.Dict] = {}
        for agent in self.possible_agents:
            inner = env.observation_space(agent)
            if not isinstance(inner, spaces.Dict) or _NAME in inner.spaces:
                raise ValueError(
                    "env must not show the other drones already, as all layouts but "
                    f"DictObservation do, got observations in {inner}"
                )
            if "action_mask" in inner.spaces:
                raise ValueError(
                    "env must not have masks in its observations; put "
                    f"ActionMask(in_observation=True) around OtherDrones, got {env}"
                )
            others = spaces.Box(0, size - 1, (n - 1, 2), np.int32)
            self._spaces[agent] = spaces.Dict({**inner.spaces, _NAME: others})

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """The space of a drone's observations; the same object at every call."""
        space = self._spaces.get(agent)
        return self.env.observation_space(agent) if space is None else space

    def _shown(self, observations: Observations, infos: Infos) -> tuple[Observations, Infos]:
        positions = np.array(self.unwrapped.frame().drones, np.int32)
        others = dict(zip(self.possible_agents, positions[self._others], strict=True))
        with_others = {
            agent: {**observation, _NAME: others[agent]}
            for agent, observation in observations.items()
        }
        return with_others, infos
