"""The parameters of a batch: a scenario that all rows share, and values for each row.

The parameters in `ROW_PARAMETERS` may differ between rows. A reset can change them, and a
sampler can draw them for every episode. The persons of a row are described either by the drift
parameters or by a situation of the batch's catalogue.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.arrays import Ints, Words
from DroneSwarmSearch._internal.streams import RowGenerator
from DroneSwarmSearch.scenario import (
    REPLACED,
    Scenario,
    is_default,
    persons_of_rows,
    resolve_scenario,
)
from DroneSwarmSearch.vector.forecasts import DriftParameters
from DroneSwarmSearch.vector.situations import Persons, Situations, checked_situations
from DroneSwarmSearch.vector.tabulated_forecasts import table_bytes

__all__ = ["ROW_PARAMETERS", "BatchParameters", "RowValues", "Sampler"]

RowValues = dict[str, NDArray[Any]]
"""Valid values of some of `ROW_PARAMETERS`; the row is the last axis."""

DRIFT_PARAMETERS = ("vector", "person_initial_position", "disperse_constant")
"""The parameters of persons whose start and mean drift are known."""

ROW_PARAMETERS = (*DRIFT_PARAMETERS, "situation", "drones_positions")
"""The parameters that may differ between rows: `DRIFT_PARAMETERS`, or the situation."""

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
            "disperse_constant", (n,); "drones_positions", (n, n_drones, 2). With persons or
            situations, "situation", (n,), takes the place of the first three. A value
            without the first axis applies to all of these episodes. Missing parameters
            keep the batch's values.
        """


@dataclass
class BatchParameters:
    """The parameters of the rows of a batch; make them with `from_arguments`.

    Attributes:
        scenario: the shared parameters; those that differ between rows are row 0's.
        drift: the values of `DRIFT_PARAMETERS`; empty with a catalogue.
        drones: the drones' start cells, y * N + x: int64, (rows, n_drones).
        situations: the catalogue, or None.
        situation: the number of each row's situation, int64, (rows,); None if each episode
            draws one.
    """

    scenario: Scenario
    drift: RowValues
    drones: Ints
    situations: Situations | None = None
    situation: Ints | None = None

    @classmethod
    def from_arguments(
        cls,
        num_rows: object,
        rows_name: str,
        drones_positions: object,
        situations: object,
        situation: object,
        on_the_fly: bool,
        scenario: Scenario | None,
        **parameters: Any,
    ) -> BatchParameters:
        """Validate the arguments of `SearchBatch`.

        Args:
            num_rows: the number of rows.
            rows_name: its name in error messages.
            drones_positions: as in `SearchBatch`.
            situations: as in `SearchBatch`.
            situation: as in `SearchBatch`.
            on_the_fly: whether each row computes its own forecasts.
            scenario: as in `SearchBatch`.
            parameters: the scenario's parameters; those in `ROW_PARAMETERS` may have a
                value for each row.

        Raises:
            TypeError: an argument is of the wrong type.
            ValueError: an argument is out of its limits.
        """
        if scenario is not None:
            resolved = resolve_scenario(scenario, **parameters)
            parameters = {name: getattr(resolved, name) for name in parameters}
        rows = checks.integer(rows_name, num_rows, 1)
        sizes = Scenario(parameters["grid_size"], parameters["n_drones"])
        size, n = sizes.grid_size, sizes.n_drones
        named = {rows_name: rows}
        checks.fits("the drones", _DRONE_BYTES * rows * n, **named, n_drones=n)
        drift: RowValues = {}
        catalogue: Sequence[Persons] = []
        if situations is not None:
            _require_defaults(parameters)
            catalogue = checked_situations(situations, size)
            shared = Scenario(**{**parameters, "persons": catalogue[0]})
        elif parameters["persons"] is not None:
            shared = Scenario(**parameters)
            catalogue = [shared.situation]
        else:
            drift = _drift_values(parameters, rows, size)
            first_row = {name: drift[name].take(0, axis=-1) for name in DRIFT_PARAMETERS}
            shared = Scenario(**{**parameters, **first_row})
        persons = len(shared.situation)
        hypotheses = max((len(p.drifts) for each in catalogue for p in each), default=1)
        bytes_each = 8 * size**2 * shared.keeps_beliefs + _ON_THE_FLY_BYTES * size * on_the_fly
        needed = persons * hypotheses * rows * bytes_each
        checks.fits("the persons' beliefs and forecasts", needed, **named, grid_size=size)
        made = cls(shared, drift, np.tile(np.arange(n), (rows, 1)))
        if catalogue:
            made.situations = Situations(size, catalogue)
            mixtures = made.situations.mixtures
            if mixtures.priors:
                needed = table_bytes(size, shared.timestep_limit, mixtures)
                limit = {"grid_size": size, "timestep_limit": shared.timestep_limit}
                checks.fits("the forecasts of starts that are arrays", needed, **limit)
        if situation is not None:
            made.situation = made.validated(rows, {"situation": situation}, "")["situation"]
        if drones_positions is not None:
            made.drones = shared.drone_cells_of_rows(drones_positions, rows)
        return made

    @property
    def num_rows(self) -> int:
        """The number of rows."""
        return len(self.drones)

    @property
    def forecasts(self) -> DriftParameters:
        """The drift parameters on which the forecasts depend, without a copy."""
        start, vector = self.drift["person_initial_position"], self.drift["vector"]
        return DriftParameters(start, vector, self.drift["disperse_constant"])

    def scenario_of(self, row: int, situation: int) -> Scenario:
        """The parameters of one row in a situation."""
        if self.situations is not None:
            return self.scenario.replace(persons=self.situations.persons[situation])
        start, drift, constant = self.forecasts
        x, y = drift[:, row].tolist()
        return self.scenario.replace(
            vector=(x, y),
            person_initial_position=tuple((x, y) for x, y in start[..., row].tolist()),
            disperse_constant=float(constant[row]),
        )

    def common_scenario(self, situation: Ints) -> Scenario:
        """The scenario of all rows.

        Args:
            situation: the number of each row's situation: int64, (rows,).

        Raises:
            ValueError: the rows differ.
        """
        for name, values in {**self.drift, "situation": situation}.items():
            if (values != values[..., :1]).any():
                raise ValueError(
                    f"there is no scenario of all searches, because they differ in {name}; "
                    "scenario_of(row) returns the scenario of one"
                )
        return self.scenario_of(0, int(situation[0]))

    def to_dict(self, situation: Ints) -> RowValues:
        """Copies of all `ROW_PARAMETERS`, in the form that `SearchBatch.reset` accepts.

        Args:
            situation: the number of each row's situation: int64, (rows,).
        """
        values = {name: np.moveaxis(value, -1, 0).copy() for name, value in self.drift.items()}
        if self.situations is not None:
            values["situation"] = situation.copy()
        y, x = np.divmod(self.drones, self.scenario.grid_size)
        return {**values, "drones_positions": np.stack([x, y], axis=-1)}

    def copy(self) -> BatchParameters:
        """The same parameters in new arrays; the catalogue is shared."""
        drift = {name: value.copy() for name, value in self.drift.items()}
        return replace(self, drift=drift, drones=self.drones.copy())

    def changed(self, values: RowValues) -> BatchParameters:
        """A copy with valid values of some of `ROW_PARAMETERS` in all rows."""
        changed = self.copy()
        changed.assign_values(np.arange(self.num_rows), values)
        return changed

    def assign(self, rows: Ints, other: BatchParameters) -> None:
        """Copy the parameters of some rows from another batch's, except for the situation."""
        for name, value in self.drift.items():
            value[..., rows] = other.drift[name][..., rows]
        self.drones[rows] = other.drones[rows]

    def assign_values(self, rows: Ints, values: RowValues) -> None:
        """Set valid values in some rows, except for the situation."""
        arrays = {**self.drift, "drones_positions": self.drones.T}
        for name, value in values.items():
            if name != "situation":
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
        rng = RowGenerator(keys)
        if self.situations is not None:
            rng.random()  # draws the situation, see `BatchState.prepare`
        values = sampler(rng)
        if not isinstance(values, Mapping):
            raise TypeError(f"sampler must return a mapping, got {values!r}")
        return self.validated(len(keys), values, "the mapping that sampler returns")

    def validated(self, rows: int, values: Mapping[str, Any], name: str) -> RowValues:
        """Validate some of `ROW_PARAMETERS`, each with one value for all rows or one for each.

        Args:
            rows: how many.
            values: by name.
            name: the mapping's name in error messages.

        Returns:
            The values; the row is the last axis.
        """
        if not isinstance(values, Mapping):
            raise TypeError(f"{name} must be a mapping, got {values!r}")
        known = ("situation",) if self.situations is not None else DRIFT_PARAMETERS
        known = (*known, "drones_positions")
        valid: RowValues = {}
        for key, value in values.items():
            if key in DRIFT_PARAMETERS and key not in known:
                raise ValueError(
                    f"{key} cannot be given together with persons or situations, got {value!r}; "
                    "each Person has its own"
                )
            if key == "situation" and key not in known:
                raise ValueError(
                    f"situation must be given together with situations, got {value!r} without them"
                )
            if key not in known:
                raise ValueError(
                    f"{name} must hold parameters that may differ between searches "
                    f"({', '.join(known)}), got {key!r}"
                )
            valid[key] = self._validated(key, value, rows)
        return valid

    def _validated(self, name: str, value: Any, rows: int) -> NDArray[Any]:
        scenario = self.scenario
        if name == "vector":
            return checks.pairs(name, value, rows).T
        if name == "disperse_constant":
            return checks.reals(name, value, rows, 0)
        if name == "drones_positions":
            return scenario.drone_cells_of_rows(value, rows).T
        if name == "situation":
            assert self.situations is not None
            return checks.integers(name, value, rows, 0, len(self.situations) - 1)
        persons = len(scenario.person_initial_position)
        cells = persons_of_rows(value, rows, scenario.grid_size, persons)
        return _by_person(cells)


def _require_defaults(parameters: Mapping[str, Any]) -> None:
    """Raise a ValueError if a parameter is given whose place a catalogue takes."""
    for name in (*REPLACED, "persons"):
        if not is_default(name, parameters[name]):
            raise ValueError(
                f"{name} cannot be given together with situations, got "
                f"{parameters[name]!r}; each Person has its own"
            )


def _drift_values(parameters: Mapping[str, Any], rows: int, grid_size: int) -> RowValues:
    """Validate `DRIFT_PARAMETERS`, each with one value for all rows or one for each."""
    start = persons_of_rows(parameters["person_initial_position"], rows, grid_size)
    vector = checks.pairs("vector", parameters["vector"], rows)
    constant = checks.reals("disperse_constant", parameters["disperse_constant"], rows, 0)
    return {
        "vector": np.ascontiguousarray(vector.T),
        "person_initial_position": _by_person(start),
        "disperse_constant": constant,
    }


def _by_person(persons: Ints) -> Ints:
    """Cells of shape (rows, persons, 2) as (persons, 2, rows)."""
    return np.ascontiguousarray(persons.transpose(1, 2, 0))
