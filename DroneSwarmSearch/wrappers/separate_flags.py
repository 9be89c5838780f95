"""Terminations and truncations as Gymnasium means them."""

from __future__ import annotations

from DroneSwarmSearch.rules import Ending
from DroneSwarmSearch.wrappers.wrapper import Flags, SearchWrapper

__all__ = ["SeparateFlags"]


class SeparateFlags(SearchWrapper):
    """The time limit alone is truncation, all other endings are termination.

    `DroneSwarmSearch` sets both flags at every end. Here an episode is terminated when all
    persons are found, drones collide or one leaves the grid, be it in the last step, and
    truncated when nothing but the time limit ends it: what learners want that estimate the
    value of what would have followed. The batched views do the same with
    separate_flags=True.

    Args:
        env: the environment.

    Raises:
        TypeError: `env` is no such environment.
    """

    def _flags(self, terminations: Flags, truncations: Flags) -> tuple[Flags, Flags]:
        if not (any(terminations.values()) or any(truncations.values())):
            return terminations, truncations
        time_limit_reached = self.unwrapped.frame().ending is Ending.TIME_LIMIT
        return dict.fromkeys(terminations, not time_limit_reached), dict.fromkeys(
            truncations, time_limit_reached
        )
