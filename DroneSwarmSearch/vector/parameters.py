"""The parameters of a batch: those that all rows share, and those that each has its own of.

Whatever may differ from row to row is held for every row, checked, and can be assigned
for some: by a reset, or by a sampler that draws them anew for every episode.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.streams import RowGenerator
from DroneSwarmSearch.scenario import Scenario
from DroneSwarmSearch.vector.forecasts import DriftParameters

__all__ = ["Parameters", "Sampler", "checked_rows", "checked_sizes"]

Ints = NDArray[np.int64]
Words = NDArray[np.uint64]

VARIABLE = ("vector", "person_initial_position", "disperse_constant", "drones_positions")
"""What may differ from row to row."""

_ROW_BYTES = 64
"""Rounded down, what a batch keeps for each drone of each row."""

_FOLLOWED_BYTES = 64
"""What following a person's forecast takes, for each cell along a side."""


class Sampler(Protocol):
    """Draws parameters for episodes that begin (domain randomisation).

    For example, drift and start at random::

        def sampler(rng):
            return {
                "vector": rng.uniform(-0.5, 0.5, 2),
                "person_initial_position": rng.integers(5, 15, (1, 2)),
            }
    """

    def __call__(self, rng: RowGenerator, /) -> Mapping[str, Any]:
        """The parameters of len(rng) episodes.

        Args:
            rng: random numbers: an episode gets the same for the same seed, whichever
                others begin at the same time.

        Returns:
            Any of "vector", shape (n, 2); "person_initial_position", (n, persons, 2);
            "disperse_constant", (n,); "drones_positions", (n, n_drones, 2). Without the
            first axis a value holds for all of these episodes. What is not among them is
            as the batch was given it.
        """


@dataclass
class Parameters:
    """The parameters of a batch's rows. Make them with `Parameters.checked`.

    Attributes:
        scenario: what all rows share; its `vector`, `persons` and `disperse_constant` are
            those of row 0.
        forecasts: the persons' starts, the drift and the disperse constant of every row.
        drones: the drones' start cells, y * N + x: int64, (rows, n_drones).
    """

    scenario: Scenario
    forecasts: DriftParameters
    drones: Ints

    @classmethod
    def checked(
        cls,
        num_rows: object,
        *,
        rows_name: str = "num_rows",
        follows: bool = False,
        vector: object,
        person_initial_position: object,
        disperse_constant: object,
        drones_positions: object,
        **shared: Any,
    ) -> Parameters:
        """Check the arguments of `engine.SearchBatch`.

        Args:
            num_rows: the number of rows.
            rows_name: what `num_rows` is called in errors.
            follows: whether each row follows forecasts of its own.
            vector: as in `SearchBatch`, like all others.
            person_initial_position: likewise.
            disperse_constant: likewise.
            drones_positions: likewise.
            shared: likewise.

        Raises:
            TypeError: an argument is of the wrong type.
            ValueError: an argument is out of its limits.
        """
        rows, size, _ = checked_sizes(rows_name, num_rows, shared["grid_size"], shared["n_drones"])
        vectors = _vectors(vector, rows)
        persons = _persons(person_initial_position, rows, size)
        constants = _constants(disperse_constant, rows)
        scenario = Scenario(
            vector=vectors[0],
            person_initial_position=persons[0],
            disperse_constant=constants[0],
            **shared,
        )
        number = len(scenario.person_initial_position)
        known = 8 * size**2 * scenario.bayesian_update + _FOLLOWED_BYTES * size * follows
        checks.fits(
            "what is known of the persons",
            number * rows * known,
            **{rows_name: rows, "grid_size": size},
        )
        cells = np.arange(scenario.n_drones)
        if drones_positions is not None:
            cells = _drones(drones_positions, rows, scenario)
        return cls(
            scenario,
            DriftParameters(_by_person(persons), np.ascontiguousarray(vectors.T), constants),
            np.broadcast_to(cells, (rows, scenario.n_drones)).copy(),
        )

    @property
    def num_rows(self) -> int:
        """The number of rows."""
        return len(self.drones)

    def copy(self) -> Parameters:
        """The same parameters in arrays of their own."""
        start, drift, constant = self.forecasts
        forecasts = DriftParameters(start.copy(), drift.copy(), constant.copy())
        return replace(self, forecasts=forecasts, drones=self.drones.copy())

    def changed(self, given: Mapping[str, Any]) -> Parameters:
        """The same with some of `VARIABLE` given anew, for all rows.

        Raises:
            TypeError: a value is of the wrong type.
            ValueError: a value is out of its limits.
        """
        changed = self.copy()
        values = self.checked_values(self.num_rows, given)
        changed.assign_values(np.arange(self.num_rows), values)
        return changed

    def assign(self, rows: Ints, other: Parameters) -> None:
        """Take over the parameters of some rows."""
        for mine, theirs in zip(self.forecasts, other.forecasts, strict=True):
            mine[..., rows] = theirs[..., rows]
        self.drones[rows] = other.drones[rows]

    def drawn(self, rows: int, sampler: Sampler, keys: Words) -> Values:
        """Parameters for some rows, drawn and checked, to be given to `assign_values`.

        Args:
            rows: how many.
            sampler: what draws them.
            keys: of the rows' episodes, for the sampling of scenarios.

        Raises:
            TypeError: what the sampler returns is of the wrong type.
            ValueError: it is out of its limits.
        """
        values = sampler(RowGenerator(keys))
        if not isinstance(values, Mapping):
            raise TypeError(f"sampler must return a mapping, got {values!r}")
        return self.checked_values(rows, values, "what sampler returns")

    def checked_values(self, rows: int, values: Mapping[str, Any], name: str = "given") -> Values:
        """Some of `VARIABLE` checked, from one value for all rows or one for each.

        Args:
            rows: how many.
            values: by name.
            name: what the values are called in errors.
        """
        if not isinstance(values, Mapping):
            raise TypeError(f"{name} must be a mapping, got {values!r}")
        unknown = [name for name in values if name not in VARIABLE]
        if unknown:
            raise ValueError(
                f"{name} must hold parameters that may differ between searches "
                f"({', '.join(VARIABLE)}), got {unknown[0]!r}"
            )
        checked: Values = {}
        for parameter, value in values.items():
            if parameter == "vector":
                checked[parameter] = _vectors(value, rows).T
            elif parameter == "disperse_constant":
                checked[parameter] = _constants(value, rows)
            elif parameter == "drones_positions":
                checked[parameter] = _drones(value, rows, self.scenario).T
            else:
                size, persons = self.scenario.grid_size, len(self.scenario.person_initial_position)
                checked[parameter] = _by_person(_persons(value, rows, size, persons))
        return checked

    def assign_values(self, rows: Ints, values: Values) -> None:
        """Set some of `VARIABLE`, checked, in some rows."""
        arrays = {
            "vector": self.forecasts.drift,
            "person_initial_position": self.forecasts.start,
            "disperse_constant": self.forecasts.disperse_constant,
            "drones_positions": self.drones.T,
        }
        for name, value in values.items():
            arrays[name][..., rows] = value


Values = dict[str, NDArray[Any]]
"""Some of `VARIABLE`, checked, with the rows as their last axis."""


def checked_sizes(
    rows_name: str, num_rows: object, grid_size: object, n_drones: object
) -> tuple[int, int, int]:
    """The sizes on which all arrays of a batch depend, in this order.

    Raises:
        TypeError: one is no integer.
        ValueError: it is out of its limits, or the batch would not fit in memory.
    """
    rows = checks.integer(rows_name, num_rows, 1)
    size = checks.integer("grid_size", grid_size, 2)
    drones = checks.integer("n_drones", n_drones, 1, size**2)
    given = {rows_name: rows, "n_drones": drones}
    checks.fits("the drones", _ROW_BYTES * rows * drones, **given)
    return rows, size, drones


def checked_rows(
    value: object, count: int, *, rising: bool = False, repeated: bool = False
) -> Ints:
    """Numbers of rows as int64, shape (n,).

    Args:
        value: integers from 0 to count - 1.
        count: the number of rows.
        rising: they must be in rising order.
        repeated: a row may come several times, one after another.

    Raises:
        TypeError: they are no integers.
        ValueError: there is no such row, or they are out of order.
    """
    if isinstance(value, np.ndarray) and value.dtype == np.int64 and value.ndim == 1:
        # The usual case is part of many steps, and looked at quickly.
        in_order = np.count_nonzero(value[1:] > value[:-1]) == len(value) - 1
        if in_order and value[0] >= 0 and value[-1] < count:
            return value
    order = "in rising order" if rising else "no two alike"
    what = f"rows must be a list or an array of integers from 0 to {count - 1}, {order}"
    given = checks.array("rows", value, "a list or an array of integers")
    if given.ndim == 1 and not given.size:
        return np.empty(0, np.int64)
    if given.dtype.kind not in "iu":
        raise TypeError(f"{what}; got {given.dtype}")
    if given.ndim != 1:
        raise ValueError(f"{what}; got shape {given.shape}")
    rows = given.astype(np.int64)
    wrong = rows[(rows < 0) | (rows >= count)]
    if wrong.size:
        raise ValueError(f"{what}; got {wrong[0]}")
    steps = np.diff(rows if rising else np.sort(rows))
    if (steps < (not repeated)).any():
        raise ValueError(f"{what}; got {value!r}")
    return rows


# Each of these takes one value for all rows or one for each, and returns one for each.


def _vectors(value: object, rows: int) -> NDArray[np.float64]:
    """Drifts: float64, shape (rows, 2)."""
    name, what = "vector", "two finite numbers (x, y)"
    vectors = _numbers(name, value, what)
    if vectors.ndim < 2:
        return np.tile(checks.pair(name, value), (rows, 1))
    return _for_each(name, vectors, rows, (2,), what)


def _constants(value: object, rows: int) -> NDArray[np.float64]:
    """Disperse constants: float64, shape (rows,)."""
    name, what = "disperse_constant", "a finite number of at least 0"
    constants = _numbers(name, value, what)
    if constants.ndim == 0:
        return np.full(rows, checks.real(name, value, 0))
    constants = _for_each(name, constants, rows, (), what)
    if constants.min() < 0:
        raise ValueError(f"{name} must be {what}, got {constants.min()} for a search")
    return constants


def _persons(value: object, rows: int, grid_size: int, persons: int | None = None) -> Ints:
    """Persons' cells: int64, shape (rows, persons, 2), x first.

    Args:
        value: a cell; or a cell for each person, shape (persons, 2); or these for each
            row, shape (rows, persons, 2).
        rows: the number of rows.
        grid_size: cells along each side.
        persons: how many there are, if that is settled.
    """
    name = "person_initial_position"
    cells = _numbers(name, value, "a cell (x, y), several of them, or cells for each search")
    by_row = cells[None] if cells.ndim == 1 else cells  # a single person's cell
    by_row = np.broadcast_to(by_row, (rows, *by_row.shape)) if by_row.ndim == 2 else by_row
    count = persons or (by_row.shape[1] if by_row.ndim == 3 else 0)
    if by_row.shape != (rows, count, 2) or count == 0:
        number = "persons" if persons is None else persons
        alone = "a cell (x, y), or " if persons in (None, 1) else ""
        raise ValueError(
            f"{name} must be {alone}a cell for each person, of shape ({number}, 2), or these "
            f"for each search, of shape ({rows}, {number}, 2); got shape {cells.shape}"
        )
    return _cells(name, by_row, grid_size)


def _drones(value: object, rows: int, scenario: Scenario) -> Ints:
    """Drones' cells, y * N + x: int64, shape (rows, n_drones)."""
    name, n, size = "drones_positions", scenario.n_drones, scenario.grid_size
    positions = _numbers(name, value, f"{n} cells (x, y), one for each drone")
    by_row = positions
    if positions.shape == (n, 2):
        by_row = np.broadcast_to(positions, (rows, n, 2))
    if by_row.shape != (rows, n, 2):
        raise ValueError(
            f"{name} must have the shape {(n, 2)}, or {(rows, n, 2)} with values for each search; "
            f"got {positions.shape}"
        )
    x, y = np.moveaxis(_cells(name, by_row, size), -1, 0)
    cells: Ints = y * size + x
    ordered = np.sort(cells, axis=1)
    twice = np.flatnonzero((ordered[:, 1:] == ordered[:, :-1]).any(axis=1))
    if twice.size:
        raise ValueError(
            f"{name} must hold different cells, got "
            f"{np.stack([x[twice[0]], y[twice[0]]], axis=1).tolist()} for a search"
        )
    return cells


def _numbers(name: str, value: object, what: str) -> NDArray[Any]:
    """Something as an array of numbers, of the kinds that `checks` takes."""
    if isinstance(value, np.ndarray) and value.dtype.kind in "iuf":
        return value
    entries = np.asarray(value, object)
    numbers = np.empty(entries.shape)
    for place, entry in enumerate(entries.flat):
        if not checks.is_number(entry):
            ragged = isinstance(entry, (list, tuple, np.ndarray))
            raise (ValueError if ragged else TypeError)(f"{name} must be {what}, got {value!r}")
        try:
            numbers.flat[place] = float(entry)
        except OverflowError:
            numbers.flat[place] = np.inf
    return numbers


def _for_each(
    name: str, values: NDArray[Any], rows: int, shape: tuple[int, ...], what: str
) -> NDArray[np.float64]:
    """An array of finite numbers with a value for each row."""
    if values.shape != (rows, *shape):
        raise ValueError(
            f"{name} must be {what}, or one for each search, an array of shape {(rows, *shape)}; "
            f"got one of shape {values.shape}"
        )
    floats = values.astype(np.float64)
    if not np.isfinite(floats).all():
        raise ValueError(f"{name} must be {what}, got {floats[~np.isfinite(floats)][0]}")
    return floats


def _cells(name: str, cells: NDArray[Any], grid_size: int) -> Ints:
    """Cells of the grid as int64, of the same shape."""
    with np.errstate(invalid="ignore"):  # what is no integer differs from what it becomes
        whole = cells.astype(np.int64)
    wrong = (whole != cells) | (whole < 0) | (whole >= grid_size)
    if wrong.any():
        raise ValueError(
            f"{name} must hold cells (x, y) with whole numbers from 0 to {grid_size - 1}, "
            f"got {cells[wrong][0]}"
        )
    return whole


def _by_person(persons: Ints) -> Ints:
    """Cells of shape (rows, persons, 2) as (persons, 2, rows)."""
    return np.ascontiguousarray(persons.transpose(1, 2, 0))
