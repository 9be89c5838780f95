"""What the drones and a centralised critic are shown, and the spaces it lies in."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TypedDict

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from DroneSwarmSearch._internal.mappings import Infos
from DroneSwarmSearch.scenario import Cell

__all__ = ["Observation", "observation_space", "observe", "state_planes", "state_space"]


class Observation(TypedDict):
    """A drone's observation: ((x, y), matrix)."""

    observation: tuple[Cell, NDArray[np.float32]]


def observe(
    names: Iterable[str],
    cells: Iterable[int],
    positions: Mapping[int, Cell],
    matrix: NDArray[np.float32],
    found: bool,
) -> tuple[dict[str, Observation], Infos]:
    """What every drone is shown and told.

    Args:
        names: the drones' names.
        cells: each drone's cell by number.
        positions: the (x, y) of every cell.
        matrix: the matrix shown to all of them.
        found: whether any drone has found a person.
    """
    observations: dict[str, Observation] = {}
    infos = {}  # a plain dict is filled in half the time
    for name, cell in zip(names, cells):  # noqa: B905 (strict= would cost a tenth of it)
        observations[name] = {"observation": (positions[cell], matrix)}
        infos[name] = {"Found": found}
    return observations, Infos(infos)


def observation_space(grid_size: int) -> spaces.Dict:
    """The space of `Observation`.

    Args:
        grid_size: cells along each side, N.

    Returns:
        A Dict with one entry, "observation": a Tuple of the drone's (x, y), each
        Discrete(N), and the matrix, float32 in [0, 1] of shape (N, N), indexed [y, x].
    """
    position = spaces.Tuple((spaces.Discrete(grid_size), spaces.Discrete(grid_size)))
    matrix = spaces.Box(0.0, 1.0, (grid_size, grid_size), np.float32)
    return spaces.Dict({"observation": spaces.Tuple((position, matrix))})


def state_space(grid_size: int, n_drones: int) -> spaces.Box:
    """The space of `state_planes`: float32, shape (3, grid_size, grid_size).

    The persons' plane has no upper bound, since a reset may bring any number of them.
    """
    shape = (3, grid_size, grid_size)
    high = np.array([1.0, n_drones, np.inf], np.float32)
    return spaces.Box(
        np.zeros(shape, np.float32), np.broadcast_to(high[:, None, None], shape), dtype=np.float32
    )


def state_planes(
    matrix: NDArray[np.float32], drones: Iterable[Cell], missing_persons: Iterable[Cell]
) -> NDArray[np.float32]:
    """The whole state as planes.

    Args:
        matrix: the matrix that the drones are shown, shape (N, N), indexed [y, x].
        drones: each drone's cell.
        missing_persons: the cell of each person not yet found.

    Returns:
        float32, shape (3, N, N), each plane indexed [y, x]: the matrix, the number of
        drones in each cell, the number of missing persons in each cell.
    """
    planes = np.zeros((3, *matrix.shape), np.float32)
    planes[0] = matrix
    for plane, cells in zip(planes[1:], (drones, missing_persons), strict=True):
        for x, y in cells:
            plane[y, x] += 1.0
    return planes
