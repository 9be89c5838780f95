"""Rewards on the scale that neural networks train well on."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from pettingzoo import ParallelEnv

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.mappings import Rewards
from DroneSwarmSearch.wrappers.wrapper import SearchWrapper, Step

__all__ = ["ScaledRewards"]


class ScaledRewards(SearchWrapper):
    """Multiplies all rewards by a constant.

    The default is a power of two, 2**-17 = 1/131072, which is exact in floating point:
    `rewards / scale` is the reward of the table in `rules`, bit for bit. The table becomes

    - collision, leaving the grid, and the return of a drone that has found nobody by the
      time limit: -0.763 (-100000);
    - finding a person: 0.153 at once, down to 0.0763 at the time limit (20000 to 10000);
    - an unsuccessful search of a cell of probability p > 1%: 0.0763 p (10000 p);
    - an unsuccessful search of another cell: -0.000763 (-100);
    - anything else: 0.00000763 (1).

    The scale does not change which policies are better.

    Args:
        env: the environment.
        scale: the constant; above 0. Rewards are rounded unless it is a power of two.

    Raises:
        TypeError: `env` is not such an environment, or `scale` is not a number.
        ValueError: `scale` is not finite, is not above 0, or makes rewards overflow.
    """

    def __init__(self, env: ParallelEnv[str, Any, int], scale: float = 2**-17) -> None:
        super().__init__(env)
        self.scale = checks.positive("scale", scale)
        scenario = self._search.scenario
        largest = scenario.reward_scheme.largest(scenario.timestep_limit)
        if math.isinf(largest * self.scale) and math.isfinite(largest):
            raise ValueError(
                f"scale must keep rewards finite, which are up to {largest:g}, got {scale!r}"
            )

    def step(self, actions: Mapping[str, int]) -> Step:
        """Let every drone act once."""
        observations, rewards, terminations, truncations, infos = self.env.step(actions)
        scale = self.scale
        scaled = Rewards({agent: reward * scale for agent, reward in rewards.items()})
        return observations, scaled, terminations, truncations, infos
