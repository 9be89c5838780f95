"""Action masks recovered from flat observations."""

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

_TOLERANCE = 1e-3
"""In cells; observations are float32."""


def masks_of_flat(
    observations: ArrayLike, parameters: Mapping[str, Any], right_of_way: bool = True
) -> NDArray[np.bool_]:
    """The action masks of drones with flat observations, as `ActionMask` computes them.

    Evaluation passes observations to a policy, but no masks. Flat observations contain the
    drones' positions, which determine the masks.

    Args:
        observations: from `FlatObservation` or from `DroneVectorEnv(observation="flat")`,
            shape (swarms * n_drones, 2 n_drones + 1 + N²), the drones of each swarm
            together and in order.
        parameters: those of `DroneSwarmSearch`; "grid_size" and "n_drones" are required.
        right_of_way: as in training.

    Returns:
        bool, shape (swarms * n_drones, 6), indexed by `Action`: True where allowed.

    Raises:
        TypeError: an argument has the wrong type.
        ValueError: the shape does not fit the parameters, a position is off the grid, or the
            drones of a swarm do not agree on their positions.
    """
    if not isinstance(parameters, Mapping):
        raise TypeError(f"parameters must be a mapping, got {parameters!r}")
    for name in ("grid_size", "n_drones"):
        if name not in parameters:
            raise ValueError(f"parameters must contain {name!r}, got {parameters!r}")
    size = checks.integer("grid_size", parameters["grid_size"], 2)
    n = checks.integer("n_drones", parameters["n_drones"], 1, size**2)
    array = checks.array("observations", observations, "one array")
    length = 2 * n + 1 + size**2
    if array.ndim != 2 or array.shape[1] != length or len(array) % n:
        raise ValueError(
            f"observations must have the shape (swarms * {n}, {length}) for grid_size={size} "
            f"and n_drones={n}, got {array.shape}"
        )
    if array.dtype.kind != "f":
        raise TypeError(f"observations must be floats, got {array.dtype}")
    # Drone k of a swarm lists its own position first, then the others by number.
    listed = array[:, : 2 * n].reshape(-1, n, n, 2) * (size - 1)
    cells = listed[:, :, 0].round()
    agree = (np.abs(listed - cells[:, own_first(n)]) < _TOLERANCE).all()
    if not agree or not ((cells >= 0) & (cells < size)).all():
        raise ValueError(
            "observations must be flat, with the drones of each swarm together and in order; "
            "the positions in them are off the grid or disagree"
        )
    x, y = np.moveaxis(cells.astype(np.int64), -1, 0)
    masks = action_masks(y * size + x, size, checks.boolean("right_of_way", right_of_way))
    return masks.reshape(len(array), len(Action))
