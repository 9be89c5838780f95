"""The masks that belong to flat observations, for policies that were trained with masks."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch.rules import Action
from DroneSwarmSearch.wrappers.layout import own_first
from DroneSwarmSearch.wrappers.masks import action_masks

__all__ = ["masks_of_flat"]

_ROUNDING = 1e-3
"""How far a position may be from a cell, in cells."""


def masks_of_flat(
    seen: ArrayLike, parameters: Mapping[str, Any], right_of_way: bool = True
) -> NDArray[np.bool_]:
    """Which actions are open to drones that see the layout "flat", see `masks.action_masks`.

    Evaluation shows observations alone; the positions in them tell the masks.

    Args:
        seen: what every drone of some swarms is shown, those of a swarm together, as
            `DroneVectorEnv` and `FlatObservation` show it: shape
            (swarms * n_drones, 2 n_drones + 1 + N²).
        parameters: of the search, "grid_size" and "n_drones" among them.
        right_of_way: as it was in training.

    Returns:
        bool, shape (swarms * n_drones, 6), indexed by `Action`: True where allowed.

    Raises:
        TypeError: an argument is of the wrong type.
        ValueError: `seen` is not the layout "flat" of such a search, drone by drone, or a
            parameter is missing or out of its limits.
    """
    if not isinstance(parameters, Mapping):
        raise TypeError(f"parameters must be a mapping, got {parameters!r}")
    for name in ("grid_size", "n_drones"):
        if name not in parameters:
            raise ValueError(f"parameters must hold {name!r}, got {parameters!r}")
    size = checks.integer("grid_size", parameters["grid_size"], 2)
    drones = checks.integer("n_drones", parameters["n_drones"], 1, size**2)
    right_of_way = checks.boolean("right_of_way", right_of_way)
    shown = checks.array("seen", seen, "one array of observations")
    length = 2 * drones + 1 + size**2
    if shown.ndim != 2 or shown.shape[1] != length or len(shown) % drones:
        raise ValueError(
            "seen must be observations in the layout 'flat', one for each drone, with the "
            f"drones of a swarm together: shape (swarms * {drones}, {length}) for "
            f"grid_size={size} and n_drones={drones}; got shape {shown.shape}"
        )
    if shown.dtype.kind != "f":
        raise TypeError(f"seen must be an array of floats, got {shown.dtype}")
    swarms = shown.reshape(-1, drones, length)
    places = swarms[..., : 2 * drones].reshape(-1, drones, drones, 2) * (size - 1)
    with np.errstate(invalid="ignore"):  # NaN
        cells = np.rint(places[:, :, 0]).astype(np.int64)  # its own position comes first
    starts = np.ndim(parameters.get("person_initial_position", (0, 0)))
    persons = len(parameters["person_initial_position"]) if starts == 2 else 1
    rest = swarms[..., 2 * drones :]
    if not _is_flat(places, cells[:, own_first(drones)], rest, size, persons):
        raise ValueError(
            "seen must be observations in the layout 'flat', one for each drone, with the "
            "drones of a swarm together; got values that no such observation has"
        )
    x, y = np.moveaxis(cells, -1, 0)
    return action_masks(y * size + x, size, right_of_way).reshape(len(shown), len(Action))


def _is_flat(
    places: NDArray[Any], expected: NDArray[np.int64], rest: NDArray[Any], size: int, persons: int
) -> bool:
    """Whether values are those of the layout "flat".

    Another layout may have as many of them.

    Args:
        places: where each drone is shown the drones of its swarm, in cells: shape
            (swarms, n, n, 2).
        expected: where it should be shown them, by what each is shown of itself.
        rest: the share of the steps left and the matrix: shape (swarms, n, 1 + N²).
        size: cells along each side, N.
        persons: the number of persons.
    """
    matrices = rest[..., 1:]
    at_start = rest[..., 0] == 1
    on_grid = ((expected >= 0) & (expected < size)).all()
    return bool(
        on_grid
        and (np.abs(places - expected) < _ROUNDING).all()
        and (rest == rest[:, :1]).all()  # a swarm has one clock and one matrix
        and (rest >= 0).all()
        and (rest[..., 0] <= 1).all()
        and (matrices.max(axis=-1) == 1).all()
        # Before the first step persons are where they started.
        and (np.count_nonzero(matrices, axis=-1)[at_start] <= persons).all()
    )
