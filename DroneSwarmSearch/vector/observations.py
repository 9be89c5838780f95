"""The observations of a vector environment: their space, and writing them into arrays."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.vector.utils import create_empty_array

from DroneSwarmSearch._internal.arrays import Ints, Singles
from DroneSwarmSearch.layouts import (
    JOINT_LAYOUTS,
    LAYOUTS,
    Layout,
    StackedLayout,
    remaining_time_fraction,
)
from DroneSwarmSearch.layouts.masks import action_masks, mask_space
from DroneSwarmSearch.vector.engine import SearchBatch

__all__ = ["BatchObservations"]

Observations = Any  # an array, or a dict of arrays
Values = Any  # an array with a first axis for the sub-environments


class BatchObservations:
    """Observes the sub-environments of a batch in one of the layouts.

    Args:
        batch: the batch.
        name: the layout.
        joint: whether a sub-environment is a whole swarm.
        top_cells: the number of cells in the layout "top-cells".
        write_matrices: False writes indices into the table in place of matrices.
        masks: None for observations without action masks; otherwise whether the masks have
            right of way, see `action_masks`.

    Attributes:
        space: the observation space of a sub-environment. With masks, a Dict of "observation"
            and "action_mask".
    """

    def __init__(
        self,
        batch: SearchBatch,
        name: str,
        joint: bool,
        top_cells: int,
        write_matrices: bool,
        masks: bool | None = None,
    ) -> None:
        scenario = batch.scenario_of(0)
        self._batch = batch
        self._size, self._limit = scenario.grid_size, scenario.timestep_limit
        self._joint = joint
        self._each = 1 if joint else scenario.n_drones  # sub-environments in a swarm
        self._writes = write_matrices
        self._masks = masks
        self._is_dict = name == "dict"
        self._positions = "positions" if joint else "position"
        options: dict[str, Any] = {}
        if name == "top-cells":
            options = {"k": top_cells, "name": "top_cells"}
        sizes = scenario.grid_size, scenario.n_drones
        self._layout: Layout
        if joint and name in JOINT_LAYOUTS:
            self._layout = JOINT_LAYOUTS[name](*sizes)
        else:
            drones = LAYOUTS[name](*sizes, **options)
            self._layout = StackedLayout(drones) if joint else drones
        self.space: spaces.Space[Any] = self._layout.space if write_matrices else self._with_index()
        if masks is not None:
            mask = mask_space(scenario.n_drones if joint else None)
            self.space = spaces.Dict({"observation": self.space, "action_mask": mask})
        self._scratch: Singles | None = None

    def _with_index(self) -> spaces.Dict:
        entries = dict(self._layout.space.items())  # type: ignore[attr-defined]  # a Dict
        del entries["probability_matrix"]
        index = spaces.Box(0, np.iinfo(np.int32).max, (), np.int64)
        return spaces.Dict({**entries, "matrix_index": index})

    def empty(self, number: int) -> Observations:
        """New arrays for the observations of some sub-environments."""
        return create_empty_array(self.space, number, fn=np.empty)

    def matrices_in(self, observations: Observations) -> Singles | None:
        """The array for the matrices of all swarms, float32, (swarms, N, N), or None.

        It is part of the observations if they contain the matrices in this form.
        """
        if not self._writes:
            return None
        if self._masks is not None:
            observations = observations["observation"]
        rows = self._batch.num_rows
        if self._is_dict:
            shown: Singles = observations["probability_matrix"]
            if len(shown) == rows and shown.flags.c_contiguous:
                return shown
        if self._scratch is None:
            self._scratch = np.empty((rows, self._size, self._size), np.float32)
        return self._scratch

    def of_rows(self, rows: Ints, matrices: Singles | None = None) -> Observations:
        """The observations of some swarms' sub-environments in new arrays.

        Args:
            rows: the swarms' numbers, in ascending order.
            matrices: theirs, if they are known; overwritten.
        """
        if matrices is None and self._writes:
            matrices = self._batch.matrices_of(rows)
        out = self.empty(len(rows) * self._each)
        self.write(rows, matrices, out)
        return out

    def write(self, rows: Ints, matrices: Singles | None, out: Observations) -> None:
        """Write the observations of some swarms' sub-environments.

        Args:
            rows: the swarms' numbers, in ascending order.
            matrices: theirs, or None if no matrices are written; overwritten.
            out: receives the observations. It may contain the matrices, see `matrices_in`.
        """
        if self._masks is not None:
            cells, given = self._of_rows(self._batch.cells, rows), out["action_mask"]
            given[...] = action_masks(cells, self._size, self._masks).reshape(given.shape)
            out = out["observation"]
        positions = self._of_rows(self._batch.positions, rows)
        if self._is_dict:
            self._by_row(out[self._positions], rows)[...] = positions
            self._write_matrix_entry(rows, matrices, out)
            return
        assert matrices is not None
        left = remaining_time_fraction(self._of_rows(self._batch.steps, rows), self._limit)
        self._layout.write(positions, matrices, left, self._by_row(out, rows))

    def _write_matrix_entry(
        self, rows: Ints, matrices: Singles | None, out: dict[str, Values]
    ) -> None:
        """Write the matrix, or its index, in the layout "dict"; arguments as for `write`."""
        if matrices is None:
            index = self._of_rows(self._batch.table_index, rows)
            out["matrix_index"][...] = index.repeat(self._each)
            return
        shown = out["probability_matrix"]
        if shown is matrices:
            return
        copies = shown.reshape(len(rows), self._each, self._size, self._size)
        copies[...] = matrices[:, None]

    def _by_row(self, values: Values, rows: Ints) -> Values:
        """The values of some swarms' sub-environments as the layout writes them."""
        return values if self._joint else values.reshape(len(rows), self._each, *values.shape[1:])

    def _of_rows(self, values: Values, rows: Ints) -> Values:
        """The values of some swarms, given those of all."""
        return values if len(rows) == self._batch.num_rows else values[rows]
