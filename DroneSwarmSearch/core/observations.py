"""Observations and the global state, and the spaces of the environment."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cached_property
from typing import Any, NamedTuple, TypedDict

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray
from pettingzoo import ParallelEnv

from DroneSwarmSearch._internal.arrays import Flags, Ints, Singles
from DroneSwarmSearch.core.grid import Cell
from DroneSwarmSearch.core.mappings import Facts, Infos, SuccessInfos
from DroneSwarmSearch.core.radio import LastHeard
from DroneSwarmSearch.core.rules import Action, Ending, is_success
from DroneSwarmSearch.core.scenario import Scenario


class Observation(TypedDict):
    """A drone's observation: ((x, y), matrix)."""

    observation: tuple[Cell, NDArray[np.float32]]


class Snapshot(NamedTuple):
    """A moment of an episode, for reading only.

    Attributes:
        cells: every drone's cell, y * N + x.
        matrix: that of all drones together: float32, shape (N, N), indexed [y, x].
        step: completed steps.
        ending: how the episode ended; None before its end.
        matrices: the matrix that each drone observes.
        heard: which drone hears which, see `radio.hearing`; None if drones always hear each other.
        last_heard: where each drone last heard each other one; None if `heard` is None.
    """

    cells: list[int]
    matrix: Singles
    step: int
    ending: Ending | None
    matrices: list[Singles]
    heard: Flags | None
    last_heard: LastHeard | None


def observe(
    names: Iterable[str],
    cells: Iterable[int],
    positions: Mapping[int, Cell],
    matrices: Iterable[NDArray[np.float32]],
    found: bool,
    facts: Facts = (None, (), (), 0, None),
) -> tuple[dict[str, Observation], Infos]:
    """Each drone's observation and info; `found` is whether a drone has found a person."""
    observations: dict[str, Observation] = {}
    info: dict[str, Any] = {"Found": found, "is_success": is_success(facts[0])}
    kind = Infos
    success = facts[-1]
    if success is not None:
        info["probability_of_success"] = success
        kind = SuccessInfos
    by_drone = {}  # filling a plain dict takes half the time
    # strict=True would cost a tenth
    for name, cell, matrix in zip(names, cells, matrices):  # noqa: B905
        observations[name] = {"observation": (positions[cell], matrix)}
        by_drone[name] = info.copy()
    infos = kind(by_drone)
    infos.facts = facts
    return observations, infos


def state_planes(matrices: Singles, drones: Ints, persons: Ints, missing: Flags) -> Singles:
    """The global states of E searches, float32, (E, 3, N, N); see `DroneSwarmSearch.state`.

    `drones` and `persons` are cells, y * N + x, of shapes (E, n) and (E, persons); `missing` are
    the persons that count.
    """
    planes = np.zeros((len(matrices), 3, *matrices.shape[1:]), np.float32)
    planes[:, 0] = matrices
    counts = planes.reshape(len(matrices), 3, -1)
    rows = np.arange(len(matrices))[:, None]
    np.add.at(counts[:, 1], (rows, drones), 1.0)
    np.add.at(counts[:, 2], (rows, persons), missing)
    return planes


class SearchSpaces(ParallelEnv[str, Observation, int]):
    """Parameters and spaces of `DroneSwarmSearch`; spaces are created on first use and kept."""

    _scenario: Scenario

    @property
    def grid_size(self) -> int:
        """Cells along each side of the grid."""
        return self._scenario.grid_size

    @property
    def n_drones(self) -> int:
        """The number of drones."""
        return self._scenario.n_drones

    @property
    def vector(self) -> tuple[float, float]:
        """Drift in cells per step, (x, y); the mean of uncertain drifts."""
        return self._scenario.mean_vector

    @property
    def timestep_limit(self) -> int:
        """The number of steps in an episode."""
        return self._scenario.timestep_limit

    def observation_space(self, agent: str) -> spaces.Dict:
        """The space of a drone's observations; the same object at every call.

        A Dict with one key, "observation": a Tuple of the drone's (x, y), each Discrete(N),
        and the matrix, float32 in [0, 1] of shape (N, N), indexed [y, x].
        """
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> spaces.Discrete:
        """Discrete(6), see `rules.Action`; the same object at every call."""
        return self.action_spaces[agent]

    @cached_property
    def observation_spaces(self) -> dict[str, spaces.Dict]:
        """`observation_space` of every drone."""
        n = self.grid_size
        made = {}
        for agent in self.possible_agents:
            position = spaces.Tuple((spaces.Discrete(n), spaces.Discrete(n)))
            matrix = spaces.Box(0.0, 1.0, (n, n), np.float32)
            made[agent] = spaces.Dict({"observation": spaces.Tuple((position, matrix))})
        return made

    @cached_property
    def action_spaces(self) -> dict[str, spaces.Discrete]:
        """`action_space` of every drone."""
        return {agent: spaces.Discrete(len(Action)) for agent in self.possible_agents}

    @cached_property
    def state_space(self) -> spaces.Box:
        """The space of `state()`: float32, shape (3, N, N).

        The persons' plane has no upper bound, because a reset may change their number.
        """
        high = np.ones((3, self.grid_size, self.grid_size), np.float32)
        high[1:] *= np.array([self.n_drones, np.inf], np.float32)[:, None, None]
        return spaces.Box(np.zeros_like(high), high, dtype=np.float32)
