"""The environment in PettingZoo's AEC form: drones choose in turn, and then all act at once."""

from __future__ import annotations

from typing import Any

from pettingzoo import ParallelEnv
from pettingzoo.utils.conversions import parallel_to_aec_wrapper

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.errors import ResetNeeded
from DroneSwarmSearch.rules import Action


class TurnBased(parallel_to_aec_wrapper[str, Any, int]):
    """PettingZoo's conversion to the AEC form, with each action validated when it is given.

    In PettingZoo's own conversion, an invalid action blocks every further step.
    """

    def __init__(self, env: ParallelEnv[str, Any, int]) -> None:
        super().__init__(env)
        self._is_ready = False  # an episode has begun, and no step was interrupted

    def observe(self, agent: str) -> Any:
        """The drone's latest observation; ResetNeeded without an episode, else see `step`."""
        if not self._is_ready:
            raise ResetNeeded("observe: no episode has begun; call reset() first")
        return super().observe(agent)

    def reset(self, seed: int | None = None, options: dict[str, Any] | None = None) -> None:
        """Start an episode; see `DroneSwarmSearch.reset`."""
        super().reset(seed=seed, options=options)
        self._is_ready = True

    def step(self, action: int | None) -> None:
        """Choose the action, 0 to 5, of the drone whose turn it is; None after its episode.

        Raises:
            ResetNeeded: before the first `reset`, and after an interrupted step.
            TypeError, ValueError: the action is invalid; the turn does not change.
        """
        if not self._is_ready:
            raise ResetNeeded(
                "step: no episode has begun, or it was interrupted; call reset() first"
            )
        agent = self.agent_selection
        if not (self.terminations[agent] or self.truncations[agent]):
            action = checks.integer("action", action, 0, len(Action) - 1)
        elif action is not None:
            raise ValueError(f"action must be None after the episode's end, got {action!r}")
        self._is_ready = False
        super().step(action)
        self._is_ready = True
