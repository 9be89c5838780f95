"""The observations of a vector environment: their space, and writing them into arrays."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.vector.utils import batch_space, create_empty_array

from DroneSwarmSearch._internal.arrays import Ints
from DroneSwarmSearch.layouts import JOINT_LAYOUTS, LAYOUTS, Layout, remaining_time_fraction
from DroneSwarmSearch.layouts.layout import Observations
from DroneSwarmSearch.layouts.masks import action_masks, mask_space
from DroneSwarmSearch.vector.engine import SearchBatch

TOP_CELLS = 8  # cells in the layout "top-cells", by default


class BatchObservations:
    """Observes the sub-environments of a batch in the layout of this name.

    Args:
        joint: whether a sub-environment is a whole swarm.
        top_cells: of the layout "top-cells".
        masks: None for observations without action masks; otherwise whether these have right of
            way.

    Attributes:
        space: the observation space of a sub-environment.
    """

    def __init__(
        self,
        batch: SearchBatch,
        name: str,
        *,
        joint: bool,
        top_cells: int = TOP_CELLS,
        masks: bool | None = None,
    ) -> None:
        scenario = batch.scenario_of(0)
        self._batch = batch
        self._joint = joint
        self._masks = masks
        self._size = scenario.grid_size
        self._limit = scenario.timestep_limit
        self._each = 1 if joint else scenario.n_drones  # sub-environments in a swarm
        # The layout "dict" of swarms holds the matrices as they are.
        self._shows_matrices = joint and name == "dict"
        self._stacks = joint and name not in JOINT_LAYOUTS
        options: dict[str, Any] = {}
        if name == "top-cells":
            options = {"k": top_cells, "name": "top_cells"}
        elif joint and not self._stacks:
            options = {"joint": True}
        self._layout: Layout = LAYOUTS[name](self._size, scenario.n_drones, **options)
        self.space: spaces.Space[Any] = self._layout.space
        if self._stacks:
            self.space = batch_space(self.space, scenario.n_drones)
        if masks is not None:
            mask = mask_space(scenario.n_drones if joint else None)
            self.space = spaces.Dict({"observation": self.space, "action_mask": mask})

    def empty(self, swarms: int) -> Observations:
        """New arrays for the observations of this many swarms."""
        return create_empty_array(self.space, swarms * self._each, fn=np.empty)

    def of_rows(self, rows: Ints) -> Observations:
        """The observations of some swarms' sub-environments in new arrays."""
        out = self.empty(len(rows))
        self.write(out, rows)
        return out

    def write(self, out: Observations, rows: Ints | None = None) -> None:
        """Write the observations of some swarms' sub-environments; of all by default."""
        batch = self._batch
        which = slice(None) if rows is None else rows
        cells = batch.cells[which]
        positions = batch.positions[which]
        if self._masks is not None:
            masks = action_masks(cells, self._size, self._masks)
            out["action_mask"][...] = masks.reshape(out["action_mask"].shape)
            out = out["observation"]
        if rows is None and self._shows_matrices:  # saves a copy
            out["positions"][...] = positions
            batch.write_matrices(out["probability_matrix"])
            return
        if rows is None:
            matrices = np.empty((batch.num_rows, self._size, self._size), np.float32)
            batch.write_matrices(matrices)
        else:
            matrices = batch.matrices_of(rows)
        left = remaining_time_fraction(batch.steps[which], self._limit)
        if not self._stacks:  # the layouts have an axis for the swarms and one for their drones
            shape = len(cells), self._each
            if isinstance(out, dict):
                out = {name: array.reshape(*shape, *array.shape[1:]) for name, array in out.items()}
            else:
                out = out.reshape(*shape, *out.shape[1:])
        self._layout.write(positions, matrices, left, out)
