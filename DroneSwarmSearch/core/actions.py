"""Reading and validating the actions of a step, in a single search and in a batch."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from operator import getitem
from typing import Any, NoReturn

from numpy.typing import ArrayLike, DTypeLike, NDArray

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch.core.grid import CellTable
from DroneSwarmSearch.core.rules import Action

_ACTIONS = len(Action)
_STAYING = bytes((Action.SEARCH, Action.IDLE))


def read_actions(
    actions: Mapping[str, int],
    names: tuple[str, ...],
    neighbours: CellTable[tuple[int, ...]],
    cells: list[int],
) -> tuple[bytes, list[int]]:
    """Each drone's action and target cell; `cells` themselves if no drone moves."""
    try:
        if len(actions) != len(cells):
            raise TypeError
        picked = [*map(actions.__getitem__, names)]
        # bytes() accepts all kinds of integers from 0 to 255, and nothing else; but bool is a
        # kind of integer too, 0 or 1.
        chosen = bytes(picked)
        if not chosen.strip(_STAYING):
            return chosen, cells
        if bool in map(type, picked):
            raise TypeError
        return chosen, [*map(getitem, map(neighbours.__getitem__, cells), chosen)]
    except Exception:
        return _refuse(actions, names)


def _refuse(actions: object, names: tuple[str, ...]) -> NoReturn:
    """Raise the error that describes what is wrong with the actions of a step."""
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
    """The actions of many searches, from 0 to 5, in a new array; else TypeError or ValueError."""
    what = f"integers from 0 to 5 of shape {shape}, one for each drone of each search"
    return checks.integer_array("actions", actions, what, 0, _ACTIONS - 1, shape).astype(dtype)


def _range(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else f"{names[0]}, ..., {names[-1]}"
