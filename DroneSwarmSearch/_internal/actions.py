"""The actions handed to a step: read quickly where they are right, refused with reasons."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from operator import getitem, index, itemgetter
from typing import Any, NoReturn

from pettingzoo import ParallelEnv
from pettingzoo.utils.conversions import parallel_to_aec_wrapper

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.errors import ResetNeeded
from DroneSwarmSearch._internal.grid import Neighbours
from DroneSwarmSearch.rules import Action

__all__ = ["Reader", "TurnBased", "names_in_words", "reader"]

Reader = Callable[[Mapping[str, int], Neighbours, list[int]], tuple[bytes, list[int]]]
"""Reads a step's actions.

Takes the actions by drone, the grid's neighbours and the drones' cells; returns each
drone's action and where it leads (the given cells themselves if nobody moves). Raises
TypeError or ValueError as `_refuse` says.
"""

_STAYING = bytes((Action.SEARCH, Action.IDLE))
_ALONE = {int(action): bytes((action,)) for action in Action}


def reader(names: tuple[str, ...]) -> Reader:
    """The quickest way to read the actions of some drones."""
    return (_One(names) if len(names) == 1 else _Several(names)).read


def names_in_words(names: tuple[str, ...]) -> str:
    """The drones' names for a message."""
    return names[0] if len(names) == 1 else f"{names[0]}, ..., {names[-1]}"


class _Several:
    def __init__(self, names: tuple[str, ...]) -> None:
        self._names = names
        self._pick: Callable[[Any], tuple[int, ...]] = itemgetter(*names)

    def read(
        self, actions: Mapping[str, int], neighbours: Neighbours, cells: list[int]
    ) -> tuple[bytes, list[int]]:
        try:
            if len(actions) != len(cells):
                raise TypeError
            picked = self._pick(actions)
            # bytes() takes integers of every kind, from 0 to 255, and nothing else; but a
            # bool is a kind of integer too, 0 or 1.
            chosen = bytes(picked)
            if not chosen.strip(_STAYING):
                return chosen, cells
            for action in picked:
                if action is True or action is False:
                    raise TypeError
            return chosen, [*map(getitem, map(neighbours.__getitem__, cells), chosen)]
        except Exception:
            return _refuse(actions, self._names)


class _One:
    def __init__(self, names: tuple[str, ...]) -> None:
        self._names = names
        self._name = names[0]

    def read(
        self, actions: Mapping[str, int], neighbours: Neighbours, cells: list[int]
    ) -> tuple[bytes, list[int]]:
        try:
            if len(actions) != 1:
                raise TypeError
            action = actions[self._name]
            if type(action) is not int:
                action = -1 if type(action) is bool else index(action)
            chosen = _ALONE[action]  # KeyError: out of range
            if action in _STAYING:
                return chosen, cells
            return chosen, [neighbours[cells[0]][action]]
        except Exception:
            return _refuse(actions, self._names)


class TurnBased(parallel_to_aec_wrapper[str, Any, int]):
    """PettingZoo's conversion to the AEC form, which checks each action as it comes.

    PettingZoo's own passes actions on when the last drone has chosen; one that is refused
    then stays in the way of every further step.
    """

    def __init__(self, env: ParallelEnv[str, Any, int]) -> None:
        super().__init__(env)
        self._is_whole = False  # whether an episode has begun and no call was interrupted

    def reset(self, seed: int | None = None, options: dict[str, Any] | None = None) -> None:
        """Begin an episode; see `DroneSwarmSearch.reset`."""
        before, self._is_whole = self._is_whole, False
        try:
            super().reset(seed=seed, options=options)
        except (TypeError, ValueError, RuntimeError):  # refused before anything changed
            self._is_whole = before
            raise
        self._is_whole = True

    def step(self, action: int | None) -> None:
        """Let the drone whose turn it is choose.

        Args:
            action: an integer from 0 to 5; None once the drone's episode is over.

        Raises:
            ResetNeeded: before the first `reset`, and after an interrupted step or reset.
            TypeError: the action is no integer.
            ValueError: it is out of range, or not None though the drone's episode is over.
                It is still the same drone's turn.
        """
        if not self._is_whole:
            raise ResetNeeded(
                "step: no episode has begun, or it was interrupted; call reset() first"
            )
        agent = self.agent_selection
        if not (self.terminations[agent] or self.truncations[agent]):
            action = checks.integer("action", action, 0, len(Action) - 1)
        elif action is not None:
            raise ValueError(f"action must be None once the episode is over, got {action!r}")
        self._is_whole = False
        super().step(action)
        self._is_whole = True


def _refuse(actions: object, names: tuple[str, ...]) -> NoReturn:
    """Say what is wrong with a step's actions.

    Raises:
        TypeError: `actions` is no mapping, or a strange one, or an action is no integer.
        ValueError: an action is missing, out of range, or for no drone.
    """
    if not isinstance(actions, Mapping):
        raise TypeError(f"actions must be a mapping from drones to actions, got {actions!r}")
    for agent in actions:
        if agent not in names:
            raise ValueError(
                f"actions must be for {names_in_words(names)} alone, got one for {agent!r}"
            )
    for agent in names:
        if agent not in actions:
            raise ValueError(f"actions must hold an action for every drone, got none for {agent!r}")
        checks.integer(f"actions[{agent!r}]", actions[agent], 0, len(Action) - 1)
    raise TypeError(f"actions cannot be read, got {actions!r}")
