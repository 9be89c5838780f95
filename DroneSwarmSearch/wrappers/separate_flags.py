"""Termination and truncation as Gymnasium defines them."""

from __future__ import annotations

from collections.abc import Mapping

from DroneSwarmSearch.rules import Ending
from DroneSwarmSearch.wrappers.wrapper import SearchWrapper, Step

__all__ = ["SeparateFlags"]


class SeparateFlags(SearchWrapper):
    """Truncates episodes at the time limit, and terminates them at all other endings.

    `DroneSwarmSearch` sets both flags at every ending. With this wrapper, an episode is
    terminated if all persons are found, drones collide or a drone leaves the grid, even in
    the last step, and truncated if only the time limit ends it. Learners need this if they
    bootstrap values. The vector environments do the same with separate_flags=True.

    Args:
        env: the environment.

    Raises:
        TypeError: `env` is not such an environment.
    """

    def step(self, actions: Mapping[str, int]) -> Step:
        """Let every drone act once."""
        observations, rewards, terminations, truncations, infos = self.env.step(actions)
        if any(terminations.values()) or any(truncations.values()):
            is_truncated = self._search._ending is Ending.TIME_LIMIT
            terminations = dict.fromkeys(terminations, not is_truncated)
            truncations = dict.fromkeys(truncations, is_truncated)
        return observations, rewards, terminations, truncations, infos
