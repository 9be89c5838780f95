"""The parameters of a batch: a scenario that all rows share, and values for each row.

The parameters in `ROW_PARAMETERS` may differ between rows. A reset can change them, and a
sampler can draw them for every episode.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.arrays import Ints, Words
from DroneSwarmSearch._internal.streams import RowGenerator
from DroneSwarmSearch.scenario import Scenario, persons_of_rows, resolve_scenario
from DroneSwarmSearch.vector.forecasts import DriftParameters

__all__ = ["ROW_PARAMETERS", "BatchParameters", "RowValues", "Sampler"]

RowValues = dict[str, NDArray[Any]]
"""Valid values of some of `ROW_PARAMETERS`; the row is the last axis."""

ROW_PARAMETERS = ("vector", "person_initial_position", "disperse_constant", "drones_positions")
"""The parameters that may differ between rows."""

_DRONE_BYTES = 64
"""A lower limit of the memory of each drone in each row."""

_ON_THE_FLY_BYTES = 64
"""The memory of a person's on-the-fly forecast, for each cell along a side."""


class Sampler(Protocol):
    """Draws the parameters of new episodes (domain randomisation).

    For example, random drift and start::

        def sampler(rng):
            return {
                "vector": rng.uniform(-0.5, 0.5, 2),
                "person_initial_position": rng.integers(5, 15, (1, 2)),
            }
    """

    def __call__(self, rng: RowGenerator, /) -> Mapping[str, Any]:
        """Return the parameters of len(rng) episodes.

        Args:
            rng: random numbers. For the same seed an episode gets the same numbers,
                whichever other episodes begin at the same time.

        Returns:
            Any of "vector", shape (n, 2); "person_initial_position", (n, persons, 2);
            "disperse_constant", (n,); "drones_positions", (n, n_drones, 2). A value
            without the first axis applies to all of these episodes. Missing parameters
            keep the batch's values.
        """


@dataclass
class BatchParameters:
    """The parameters of the rows of a batch; make them with `from_arguments`.

    Attributes:
        scenario: the shared parameters; those that differ between rows are row 0's.
        forecasts: the persons' start, the drift and the disperse constant of every row.
        drones: the drones' start cells, y * N + x: int64, (rows, n_drones).
    """

    scenario: Scenario
    forecasts: DriftParameters
    drones: Ints

    @classmethod
    def from_arguments(
        cls,
        num_rows: object,
        rows_name: str,
        drones_positions: object,
        on_the_fly: bool,
        scenario: Scenario | None,
        **parameters: Any,
    ) -> BatchParameters:
        """Validate the arguments of `SearchBatch`.

        Args:
            num_rows: the number of rows.
            rows_name: its name in error messages.
            drones_positions: as in `SearchBatch`.
            on_the_fly: whether each row computes its own forecasts.
            scenario: as in `SearchBatch`.
            parameters: the scenario's parameters; those in `ROW_PARAMETERS` may have a
                value for each row.

        Raises:
            TypeError: an argument is of the wrong type.
            ValueError: an argument is out of its limits.
        """
        if scenario is not None:
            parameters = vars(resolve_scenario(scenario, **parameters))
        rows = checks.integer(rows_name, num_rows, 1)
        sizes = Scenario(parameters["grid_size"], parameters["n_drones"])
        size, n = sizes.grid_size, sizes.n_drones
        named = {rows_name: rows}
        checks.fits("the drones", _DRONE_BYTES * rows * n, **named, n_drones=n)
        vectors = checks.pairs("vector", parameters["vector"], rows)
        persons = persons_of_rows(parameters["person_initial_position"], rows, size)
        constants = checks.reals("disperse_constant", parameters["disperse_constant"], rows, 0)
        first_row = {
            "vector": vectors[0],
            "person_initial_position": persons[0],
            "disperse_constant": constants[0],
        }
        shared = Scenario(**{**parameters, **first_row})
        bytes_each = 8 * size**2 * shared.bayesian_update + _ON_THE_FLY_BYTES * size * on_the_fly
        needed = persons.shape[1] * rows * bytes_each
        checks.fits("the persons' beliefs and forecasts", needed, **named, grid_size=size)
        cells = np.arange(n)
        if drones_positions is not None:
            cells = shared.drone_cells_of_rows(drones_positions, rows)
        return cls(
            shared,
            DriftParameters(_by_person(persons), np.ascontiguousarray(vectors.T), constants),
            np.broadcast_to(cells, (rows, n)).copy(),
        )

    @property
    def num_rows(self) -> int:
        """The number of rows."""
        return len(self.drones)

    def scenario_of(self, row: int) -> Scenario:
        """The parameters of one row."""
        start, drift, constant = self.forecasts
        x, y = drift[:, row].tolist()
        return self.scenario.replace(
            vector=(x, y),
            person_initial_position=tuple((x, y) for x, y in start[..., row].tolist()),
            disperse_constant=float(constant[row]),
        )

    def common_scenario(self) -> Scenario:
        """The scenario of all rows.

        Raises:
            ValueError: the rows differ.
        """
        start, drift, constant = self.forecasts
        for name, values in (
            ("vector", drift),
            ("person_initial_position", start),
            ("disperse_constant", constant),
        ):
            if (values != values[..., :1]).any():
                raise ValueError(
                    f"there is no scenario of all searches, because they differ in {name}; "
                    "scenario_of(row) returns the scenario of one"
                )
        return self.scenario_of(0)

    def to_dict(self) -> RowValues:
        """Copies of all `ROW_PARAMETERS`, in the form that `SearchBatch.reset` accepts."""
        start, drift, constant = self.forecasts
        drones = np.stack(np.divmod(self.drones, self.scenario.grid_size)[::-1], axis=-1)
        values = drift.T.copy(), start.transpose(2, 0, 1).copy(), constant.copy(), drones
        return dict(zip(ROW_PARAMETERS, values, strict=True))

    def copy(self) -> BatchParameters:
        """The same parameters in new arrays."""
        start, drift, constant = self.forecasts
        forecasts = DriftParameters(start.copy(), drift.copy(), constant.copy())
        return replace(self, forecasts=forecasts, drones=self.drones.copy())

    def changed(self, given: Mapping[str, Any]) -> BatchParameters:
        """A copy with some of `ROW_PARAMETERS` changed in all rows.

        Raises:
            TypeError: a value is of the wrong type.
            ValueError: a value is out of its limits.
        """
        changed = self.copy()
        values = self.validated(self.num_rows, given, "given")
        changed.assign_values(np.arange(self.num_rows), values)
        return changed

    def assign(self, rows: Ints, other: BatchParameters) -> None:
        """Copy the parameters of some rows from another batch's."""
        for mine, theirs in zip(self.forecasts, other.forecasts, strict=True):
            mine[..., rows] = theirs[..., rows]
        self.drones[rows] = other.drones[rows]

    def assign_values(self, rows: Ints, values: RowValues) -> None:
        """Set valid values in some rows."""
        start, drift, constant = self.forecasts
        arrays = dict(zip(ROW_PARAMETERS, (drift, start, constant, self.drones.T), strict=True))
        for name, value in values.items():
            arrays[name][..., rows] = value

    def drawn(self, sampler: Sampler | None, keys: Words) -> RowValues:
        """Draw and validate parameters for some episodes; nothing without a sampler.

        Args:
            sampler: draws them.
            keys: the sampling keys of the episodes.

        Raises:
            TypeError: the sampler returns something of the wrong type.
            ValueError: it returns values out of their limits.
        """
        if sampler is None:
            return {}
        values = sampler(RowGenerator(keys))
        if not isinstance(values, Mapping):
            raise TypeError(f"sampler must return a mapping, got {values!r}")
        return self.validated(len(keys), values, "the mapping that sampler returns")

    def validated(self, rows: int, values: Mapping[str, Any], name: str) -> RowValues:
        """Validate some of `ROW_PARAMETERS`, each with one value for all rows or one for each.

        Args:
            rows: how many.
            values: by name.
            name: the mapping's name in error messages.
        """
        if not isinstance(values, Mapping):
            raise TypeError(f"{name} must be a mapping, got {values!r}")
        unknown = [key for key in values if key not in ROW_PARAMETERS]
        if unknown:
            raise ValueError(
                f"{name} must hold parameters that may differ between searches "
                f"({', '.join(ROW_PARAMETERS)}), got {unknown[0]!r}"
            )
        scenario = self.scenario
        valid: RowValues = {}
        for key, value in values.items():
            if key == "vector":
                valid[key] = checks.pairs(key, value, rows).T
            elif key == "disperse_constant":
                valid[key] = checks.reals(key, value, rows, 0)
            elif key == "drones_positions":
                valid[key] = scenario.drone_cells_of_rows(value, rows).T
            else:
                persons = len(scenario.person_initial_position)
                cells = persons_of_rows(value, rows, scenario.grid_size, persons)
                valid[key] = _by_person(cells)
        return valid


def _by_person(persons: Ints) -> Ints:
    """Cells of shape (rows, persons, 2) as (persons, 2, rows)."""
    return np.ascontiguousarray(persons.transpose(1, 2, 0))
