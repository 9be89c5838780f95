"""What can be read from a batch between steps."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.arrays import Flags, Floats, Ints, Singles
from DroneSwarmSearch._internal.errors import ResetNeeded
from DroneSwarmSearch._internal.grid import grid_of
from DroneSwarmSearch.rendering.frame import Frame
from DroneSwarmSearch.rules import Action, Ending
from DroneSwarmSearch.scenario import Scenario
from DroneSwarmSearch.vector.outcomes import Outcomes
from DroneSwarmSearch.vector.parameters import BatchParameters, RowValues, checked_rows
from DroneSwarmSearch.vector.tabulated_forecasts import TabulatedForecasts
from DroneSwarmSearch.vector.world import BatchState

__all__ = ["BatchReadings"]

_SEARCH = np.array(Action.SEARCH, np.int16)  # 0-d: NumPy calculates faster than with an int


class BatchReadings:
    """The read-only half of `SearchBatch`, which sets these attributes."""

    _scenario: Scenario  # the parameters that all rows share
    _now: BatchParameters  # of the present episodes
    _world: BatchState
    _outcomes: Outcomes
    _cells: NDArray[Any]  # of the drones
    _chosen: NDArray[Any]  # the last step's actions
    _changing: bool

    def __init__(self, grid_size: int) -> None:
        # The (x, y) of every cell: two int32 in one int64, so that one look-up returns both.
        y, x = np.divmod(np.arange(grid_size**2, dtype=np.int32), grid_size)
        self._positions: Ints = np.stack([x, y], axis=1).view(np.int64).reshape(-1)

    def _check_complete(self, what: str) -> None:
        if self._changing:
            raise ResetNeeded(f"{what}: a step or reset was interrupted; reset all searches first")

    # Parameters.

    @property
    def num_rows(self) -> int:
        """The number of searches, E."""
        return self._now.num_rows

    @property
    def scenario(self) -> Scenario:
        """The parameters of all searches in their present episodes.

        Before the first `reset`, those of the constructor.

        Raises:
            ValueError: the searches have different parameters; see `scenario_of`.
        """
        return self._now.common_scenario()

    def scenario_of(self, row: int) -> Scenario:
        """The parameters of one search in its present episode.

        Args:
            row: its number, from 0 to E - 1.

        Raises:
            TypeError: `row` is not an integer.
            ValueError: there is no such search.
        """
        return self._now.scenario_of(checks.integer("row", row, 0, self.num_rows - 1))

    @property
    def parameters(self) -> RowValues:
        """Every row's parameters in its present episode, in the form that `reset` accepts."""
        return self._now.to_dict()

    # The last step.

    @property
    def rewards(self) -> Floats:
        """The rewards of the last step: float64, (E, n_drones)."""
        return self._outcomes.rewards

    @property
    def endings(self) -> NDArray[np.int8]:
        """Why the last step ended episodes, each an `Ending`, or 0: int8, (E,)."""
        return self._outcomes.endings.copy()

    @property
    def ended(self) -> Flags:
        """Rows that begin an episode in place of the next step: bool, (E,)."""
        return self._outcomes.ended.copy()

    @property
    def searching(self) -> Flags:
        """Which drones searched in the last step: bool, (E, n_drones)."""
        searched: Flags = self._chosen == _SEARCH
        return searched

    # The state.

    @property
    def steps(self) -> Ints:
        """Completed steps of every row: int64, (E,)."""
        return self._world.step.copy()

    @property
    def positions(self) -> NDArray[np.int32]:
        """Every drone's cell (x, y): int32, (E, n_drones, 2)."""
        pairs = self._positions.take(self._cells, mode="clip")
        return pairs.view(np.int32).reshape(*self._cells.shape, 2)

    @property
    def cells(self) -> Ints:
        """Every drone's cell, y * N + x: int64, (E, n_drones)."""
        return self._cells.astype(np.int64)

    @property
    def missing(self) -> Flags:
        """Which persons have not been found: bool, (E, persons)."""
        return self._world.missing.T.copy()

    @property
    def found(self) -> Flags:
        """Whether any person has been found in the episode: bool, (E,)."""
        found: Flags = ~np.logical_and.reduce(self._world.missing)
        return found

    @property
    def person_cells(self) -> Ints:
        """Every person's cell, y * N + x, hidden from the drones: int64, (E, persons)."""
        return self._world.person_cells.T.copy()

    def frame(self, row: int) -> Frame:
        """Everything that a picture of one row shows, including the persons.

        Raises:
            ResetNeeded: after an interrupted step or reset.
        """
        row = checks.integer("row", row, 0, self.num_rows - 1)
        self._check_complete("frame")
        _, positions = grid_of(self._scenario.grid_size)
        x, y = self._now.forecasts.drift[:, row].tolist()
        ending = self._outcomes.endings[row]
        missing = self._world.missing[:, row]
        finders, find_cells = self._world.finds[..., row]
        persons = np.where(missing, self._world.person_cells[:, row], find_cells)
        found_by = np.where(missing, -1, finders % self._cells.shape[1])
        return Frame(
            matrix=self.matrices_of(np.array([row]))[0],
            drones=tuple(positions[cell] for cell in self._cells[row].tolist()),
            searching=tuple(self.searching[row].tolist()),
            persons=tuple(positions[cell] for cell in persons.tolist()),
            found_by=tuple(None if drone < 0 else drone for drone in found_by.tolist()),
            step=int(self._world.step[row]),
            timestep_limit=self._scenario.timestep_limit,
            vector=(x, y),
            ending=Ending(ending) if ending else None,
        )

    # The matrices.

    def write_matrices(self, out: Singles) -> None:
        """Write the matrix of every row: float32, (E, N, N), C-contiguous, indexed [y, x].

        Raises:
            ResetNeeded: after an interrupted step or reset.
            TypeError: `out` is not an array.
            ValueError: `out` has another shape, dtype or order, or is read-only.
        """
        self._check_output(out)
        self._check_complete("write_matrices")
        self._world.write_matrices(out)

    def _check_output(self, matrices: Singles) -> None:
        size = self._scenario.grid_size
        checks.output_array("matrices", matrices, (self.num_rows, size, size), np.float32)

    def matrices_of(self, rows: Ints) -> Singles:
        """The matrices of some rows: float32, (n, N, N), indexed [y, x].

        Args:
            rows: their numbers, in rising order.

        Raises:
            ResetNeeded: after an interrupted step or reset.
            TypeError: the rows are not integers.
            ValueError: there is no such row, or they are not in rising order.
        """
        rows = checked_rows(rows, self.num_rows, rising=True)
        self._check_complete("matrices_of")
        return self._world.matrices(rows)

    def probabilities(self, rows: Ints, cells: Ints) -> Singles:
        """The matrix entries of one cell in each of some rows: float32, (n,).

        Args:
            rows: their numbers, in rising order; a row may occur several times.
            cells: y * N + x, shape (n,).

        Raises:
            ResetNeeded: after an interrupted step or reset.
            TypeError: the rows or cells are not integers.
            ValueError: there is no such row or cell, or the rows are not in rising order.
        """
        self._check_complete("probabilities")
        rows = checked_rows(rows, self.num_rows, rising=True, repeated=True)
        last = self._scenario.grid_size**2 - 1
        what = f"integers from 0 to {last}, one for each of the rows"
        given = checks.array("cells", cells, what)
        if given.dtype.kind not in "iu" and given.size:
            raise TypeError(f"cells must be {what}, got {given.dtype}")
        if given.shape != rows.shape:
            raise ValueError(f"cells must be {what}, got shape {given.shape}")
        wrong = given[(given < 0) | (given > last)]
        if wrong.size:
            raise ValueError(f"cells must be {what}, got {wrong[0]}")
        return self._world.probabilities(rows, given.astype(np.int64))

    @property
    def table(self) -> Singles:
        """The table of matrices, which all rows share: float32, (entries, N, N); read-only.

        A copy of the table that the batch uses. It is filled as episodes advance; entries
        that `table_index` has returned do not change. A reset with given parameters makes a
        new table.

        Raises:
            ValueError: the matrices depend on the searches, or do not fit into a table.
        """
        return self._tabulated().matrices

    @property
    def table_index(self) -> Ints:
        """The entry of `table` that is the matrix of each row: int64, (E,)."""
        entries: Ints = self._tabulated().entries[0].copy()
        return entries

    def _tabulated(self) -> TabulatedForecasts:
        forecasts, scenario = self._world.forecasts, self._scenario
        if scenario.bayesian_update or len(scenario.person_initial_position) > 1:
            raise ValueError(
                "with bayesian_update or several persons there is no table of matrices"
            )
        if not isinstance(forecasts, TabulatedForecasts):
            raise ValueError(
                "there is no table of matrices: there are too many forecasts, or a sampler"
            )
        return forecasts
