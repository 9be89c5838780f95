"""The masks that belong to flat observations, for policies that were trained with masks."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch.masks import action_masks

__all__ = ["masks_of_flat"]


def masks_of_flat(
    seen: NDArray[np.float32], parameters: Mapping[str, Any], right_of_way: bool = True
) -> NDArray[np.bool_]:
    """Which actions are open to drones that see the layout "flat", see `masks.action_masks`.

    Evaluation shows observations alone; the places in them tell the masks.

    Args:
        seen: what every drone of some swarms is shown, those of a swarm together: float32,
            shape (swarms * n_drones, 2 n_drones + 1 + N²).
        parameters: of the search, "grid_size" and "n_drones" among them.
        right_of_way: as it was in training.

    Returns:
        bool, shape (swarms * n_drones, 6), indexed by `Action`: True where allowed.
    """
    size, drones = parameters["grid_size"], parameters["n_drones"]
    x, y = np.rint(seen[:, :2].T * (size - 1)).astype(np.int64)  # its own place comes first
    masks = action_masks((y * size + x).reshape(-1, drones), size, right_of_way)
    return masks.reshape(len(seen), -1)
