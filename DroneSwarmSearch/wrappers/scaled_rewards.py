"""Rewards of a size that networks can be trained on."""

from __future__ import annotations

import math
from typing import Any

from pettingzoo import ParallelEnv

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.mappings import Rewards
from DroneSwarmSearch.wrappers.wrapper import SearchWrapper

__all__ = ["ScaledRewards"]


class ScaledRewards(SearchWrapper):
    """All rewards times a constant.

    The usual one is a power of two, 2**-17 = 1/131072, so that only the exponents of the
    floating-point numbers change: nothing is lost, and `rewards / scale` is the reward of
    the table in `rules` to the last bit. With it

    - a collision, leaving the grid, and the return of a drone that has found nobody when
      the time is up, -100000, become -0.763;
    - finding a person, from 20000 at once down to 10000 at the limit, 0.153 to 0.0763;
    - searching in vain where the probability p is more than 1 %, 10000 p, 0.0763 p;
    - searching in vain elsewhere, -100, -0.000763;
    - anything else, 1, 0.00000763.

    Which policies are better than which stays as it is.

    Args:
        env: the environment.
        scale: the constant; above 0. With other than powers of two rewards are rounded.

    Raises:
        TypeError: `env` is no such environment, or `scale` no number.
        ValueError: `scale` is not finite, or not above 0, or rewards would overflow.
    """

    def __init__(self, env: ParallelEnv[str, Any, int], scale: float = 2**-17) -> None:
        super().__init__(env)
        self.scale = checks.positive("scale", scale)
        scenario = self.unwrapped.scenario
        largest = scenario.reward_scheme.largest(scenario.timestep_limit)
        if math.isinf(largest * self.scale) and math.isfinite(largest):
            raise ValueError(
                f"scale must leave rewards finite, which are up to {largest:g}, got {scale!r}"
            )

    def _rewards(self, rewards: Rewards) -> Rewards:
        scale = self.scale
        return Rewards({agent: reward * scale for agent, reward in rewards.items()})
