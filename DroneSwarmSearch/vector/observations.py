"""The observations of a vector environment: their space, and writing them into arrays."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.vector.utils import batch_space, create_empty_array

from DroneSwarmSearch._internal.arrays import Ints, Singles
from DroneSwarmSearch.core.collision_avoidance import action_masks
from DroneSwarmSearch.core.radio import LastHeard
from DroneSwarmSearch.layouts import (
    JOINT_LAYOUTS,
    mask_space,
    remaining_time_fraction,
)
from DroneSwarmSearch.layouts.layout import Heard, Observations, Sight
from DroneSwarmSearch.layouts.view import View
from DroneSwarmSearch.vector.engine import SearchBatch


class BatchObservations:
    """Observes the sub-environments of a batch.

    Args:
        batch: the batch.
        view: what the observations show. A sub-environment is a drone if its form is "drone",
            otherwise a whole swarm.

    Attributes:
        space: the observation space of a sub-environment.
    """

    def __init__(self, batch: SearchBatch, view: View) -> None:
        scenario = batch.scenario_of(0)
        joint = view.is_joint
        self._batch = batch
        self._view = view
        self._size = scenario.grid_size
        self._limit = scenario.timestep_limit
        self._each = 1 if joint else scenario.n_drones  # sub-environments in a swarm
        # The layout "dict" of swarms holds the matrices as they are.
        radio = view.radio(scenario)
        self._shows_matrices = joint and view.observation == "dict" and not radio
        self._stacks = joint and view.observation not in JOINT_LAYOUTS
        self._layout = view.layout(scenario)
        self._radio = radio
        self.space: spaces.Space[Any] = self._layout.space
        if self._stacks:
            self.space = batch_space(self.space, scenario.n_drones)
        if view.action_mask:
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
        if self._view.action_mask:
            masks = action_masks(
                cells,
                self._size,
                self._view.right_of_way,
                crash=batch.crash,
                heard=batch.heard[which] if self._radio else None,
            )
            out["action_mask"][...] = masks.reshape(out["action_mask"].shape)
            out = out["observation"]
        if rows is None and self._shows_matrices:  # saves a copy
            out["positions"][...] = positions
            batch.write_matrices(out["probability_matrix"])
            return
        matrices = self._matrices(rows)
        heard = None
        if self._radio:
            last = LastHeard(batch.last_heard.cells[which], batch.last_heard.ages[which])
            heard = Heard.of(last, self._size, self._limit)
        left = remaining_time_fraction(batch.steps[which], self._limit)
        if not self._stacks:  # the layouts have an axis for the swarms and one for their drones
            shape = len(cells), self._each
            if isinstance(out, dict):
                out = {name: array.reshape(*shape, *array.shape[1:]) for name, array in out.items()}
            else:
                out = out.reshape(*shape, *out.shape[1:])
        self._layout.write(Sight(positions, matrices, left, heard), out)

    def _matrices(self, rows: Ints | None) -> Singles:
        """What the drones of some rows, or of all, observe: (n, 1 or n_drones, N, N)."""
        batch = self._batch
        if self._radio:
            return batch.matrices_by_drone(rows)
        if rows is not None:
            return batch.matrices_of(rows)[:, None]
        matrices = np.empty((batch.num_rows, self._size, self._size), np.float32)
        batch.write_matrices(matrices)
        return matrices[:, None]
