"""Reading and validating the actions of a step, in a single search and in a batch."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from operator import getitem, index, itemgetter
from typing import Any, NoReturn

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.grid import Neighbours
from DroneSwarmSearch.rules import Action

__all__ = ["Reader", "check_agent", "checked_actions", "reader"]

Reader = Callable[[Mapping[str, int], Neighbours, list[int]], tuple[bytes, list[int]]]
"""Reads the actions of a step.

Takes the actions by drone, the neighbours of the grid's cells and the drones' cells. Returns
each drone's action and target cell; the target cells are the given list itself if no drone
moves. Raises TypeError or ValueError, see `_refuse`.
"""

_ACTIONS = len(Action)
_SEARCH = int(Action.SEARCH)
_STAYING = bytes((Action.SEARCH, Action.IDLE))
_SINGLE = {int(action): bytes((action,)) for action in Action}


def reader(names: tuple[str, ...]) -> Reader:
    """The fastest reader for some drones."""
    return (_ReaderOfOne(names) if len(names) == 1 else _ReaderOfSeveral(names)).read


def check_agent(agent: object, names: Sequence[str]) -> None:
    """ValueError if an agent is not one of the drones."""
    if agent not in names:
        raise ValueError(f"agent must be one of {_range(names)}, got {agent!r}")


class _ReaderOfSeveral:
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
            # bytes() accepts all kinds of integers from 0 to 255, and nothing else; but bool
            # is a kind of integer too, 0 or 1.
            chosen = bytes(picked)
            if not chosen.strip(_STAYING):
                return chosen, cells
            for action in picked:
                if action is True or action is False:
                    raise TypeError
            return chosen, [*map(getitem, map(neighbours.__getitem__, cells), chosen)]
        except Exception:
            return _refuse(actions, self._names)


class _ReaderOfOne:
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
            chosen = _SINGLE[action]  # KeyError: out of range
            if action >= _SEARCH:  # or idle
                return chosen, cells
            return chosen, [neighbours[cells[0]][action]]
        except Exception:
            return _refuse(actions, self._names)


def _refuse(actions: object, names: tuple[str, ...]) -> NoReturn:
    """Raise the error that describes what is wrong with the actions of a step.

    Raises:
        TypeError: `actions` is not a mapping, or an action is not an integer.
        ValueError: an action is missing, out of range, or for an unknown drone.
    """
    if not isinstance(actions, Mapping):
        raise TypeError(f"actions must be a mapping from drones to actions, got {actions!r}")
    for agent in actions:
        if agent not in names:
            raise ValueError(f"actions must be for {_range(names)} only, got one for {agent!r}")
    for agent in names:
        if agent not in actions:
            raise ValueError(f"actions must hold an action for every drone, got none for {agent!r}")
        checks.integer(f"actions[{agent!r}]", actions[agent], 0, _ACTIONS - 1)
    raise TypeError(f"actions cannot be read, got {actions!r}")


def checked_actions(actions: ArrayLike, shape: tuple[int, ...], dtype: DTypeLike) -> NDArray[Any]:
    """Validate the actions of many searches; returns them in a new array.

    Args:
        actions: integers from 0 to 5.
        shape: the required shape: (rows, n_drones), or (rows * n_drones,).
        dtype: an integer type for the result.

    Raises:
        TypeError: they are not integers.
        ValueError: they are out of range, or of another shape.
    """
    what = f"actions must have the shape {shape}, one for each drone of each search"
    try:
        given = np.asarray(actions)
    except ValueError:  # rows that differ in length
        raise ValueError(f"{what}, got {actions!r}") from None
    if given.dtype.kind not in "iu":
        got = f"{given.dtype} of shape {given.shape}" if given.dtype.kind != "O" else repr(actions)
        raise TypeError(f"actions must be integers from 0 to 5, got {got[:200]}")
    if given.shape != shape:
        raise ValueError(f"{what}, got {given.shape}")
    # As unsigned integers, negative numbers are large.
    whole = np.ascontiguousarray(given, np.int64)
    unsigned = whole.reshape(-1).view(np.uint64)
    if np.maximum.reduce(unsigned) >= _ACTIONS:
        place = int((unsigned >= _ACTIONS).argmax())
        row, drone = divmod(place, shape[-1])
        where = f"drone {drone} of search {row}" if len(shape) > 1 else f"sub-environment {place}"
        wrong = given.reshape(-1)[place]
        raise ValueError(f"actions must be integers from 0 to 5, got {wrong} for {where}")
    return whole.astype(dtype)


def _range(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else f"{names[0]}, ..., {names[-1]}"
