"""Ways to steer the drones: from what they observe to what they do.

A policy is anything with the two methods of `Policy`. It sees what the drones see and
nothing else, so the same policy serves every environment that shows these observations:

    policy = GreedyPolicy(env.grid_size)
    observations, infos = env.reset(seed=0)
    policy.reset()
    while env.agents:
        observations, rewards, terminations, truncations, infos = env.step(policy(observations))
"""

from collections.abc import Mapping
from typing import Protocol

from DroneSwarmSearch.observations import Observation
from DroneSwarmSearch.policies.greedy import GreedyPolicy

__all__ = ["GreedyPolicy", "Policy"]


class Policy(Protocol):
    """What every policy does."""

    def __call__(self, observations: Mapping[str, Observation], /) -> dict[str, int]:
        """An action, 0 to 5, for each drone that is observed."""

    def reset(self) -> None:
        """Forget the episode: the next observations are the first of another one."""
