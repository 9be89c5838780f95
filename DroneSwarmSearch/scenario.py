"""The parameters of a search: their meaning, units, defaults and limits in one place."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from typing import Any

import numpy as np

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch.drift.probability_matrix import ProbabilityMatrix
from DroneSwarmSearch.rules import RewardScheme

__all__ = ["Cell", "Scenario"]

_MOST_STEPS = 2**53
"""Up to here every number of steps is a float, too."""

_DRONE_BYTES = 900
"""About what the environment keeps of a drone in an episode, observations included."""

Cell = tuple[int, int]
"""(x, y): column and row; y grows downward."""


@dataclass(frozen=True)
class Scenario:
    """The parameters of a search, validated: names, meaning and defaults as in `DroneSwarmSearch`.

    Whatever needs a search takes a scenario: environments, batches, policies, planning and
    evaluation. Scenarios are equal if their parameters are, in whatever form these were given::

        scenario = Scenario(grid_size=20, n_drones=4, person_initial_position=(8, 8))
        env = DroneSwarmSearch(scenario=scenario)
        larger = scenario.replace(n_drones=6)

    Attributes:
        grid_size: cells along each side of the square grid; at least 2.
        n_drones: drones; from 1 to grid_size².
        vector: drift of the persons in cells per step, (x, y); finite. What exceeds one
            cell per step drifts one cell per step.
        person_initial_position: each person's cell (x, y) at step 0, a tuple of cells. A
            single cell may be given, and cells in lists or arrays.
        disperse_constant: how quickly the persons may stray; finite, at least 0
            (`drift.dispersion_rate`).
        timestep_limit: steps in an episode; from 1 to 2**53.
        probability_of_detection: the chance that a search of the right cell finds a
            person, from 0 to 1: a number for all persons, or a tuple with one for each.
        bayesian_update: whether the matrix is the posterior given the searches made, or
            the drift alone.
        reward_scheme: the figures of the reward table.

    Raises:
        TypeError: a parameter is of the wrong type.
        ValueError: a parameter is out of its limits.
    """

    grid_size: int = 7
    n_drones: int = 1
    vector: tuple[float, float] = (-0.5, -0.5)
    person_initial_position: tuple[Cell, ...] = ((0, 0),)
    disperse_constant: float = 10.0
    timestep_limit: int = 100
    probability_of_detection: float | tuple[float, ...] = field(default=1.0, kw_only=True)
    bayesian_update: bool = field(default=False, kw_only=True)
    reward_scheme: RewardScheme = field(default=RewardScheme(), kw_only=True)

    def __post_init__(self) -> None:
        size = checks.integer("grid_size", self.grid_size, 2)
        drones = checks.integer("n_drones", self.n_drones, 1, size**2)
        updates = checks.boolean("bayesian_update", self.bayesian_update)
        persons = _persons(self.person_initial_position, size)
        # The matrices before and after a step; of each person what is believed, in double.
        cell_bytes = 8 + 16 * len(persons) * updates
        checks.fits("what is known of the cells", cell_bytes * size**2, grid_size=size)
        checks.fits("the drones", _DRONE_BYTES * drones, n_drones=drones)
        if not isinstance(self.reward_scheme, RewardScheme):
            raise TypeError(f"reward_scheme must be a RewardScheme, got {self.reward_scheme!r}")
        for name, value in {
            "grid_size": size,
            "n_drones": drones,
            "vector": checks.pair("vector", self.vector),
            "person_initial_position": persons,
            "disperse_constant": checks.real("disperse_constant", self.disperse_constant, 0),
            "timestep_limit": checks.integer("timestep_limit", self.timestep_limit, 1, _MOST_STEPS),
            "probability_of_detection": _detection(self.probability_of_detection, persons),
            "bayesian_update": updates,
        }.items():
            object.__setattr__(self, name, value)

    def replace(self, **changes: Any) -> Scenario:
        """The same scenario with other values of some parameters.

        Raises:
            TypeError: a value is of the wrong type, or there is no such parameter.
            ValueError: a value is out of its limits.
        """
        _check_names(changes, TypeError)
        return replace(self, **changes)

    def to_dict(self) -> dict[str, Any]:
        """The parameters as plain data that JSON can hold; `from_dict` reads it."""
        data = {each.name: getattr(self, each.name) for each in fields(self)}
        detection = self.probability_of_detection
        return {
            **data,
            "vector": list(self.vector),
            "person_initial_position": [list(cell) for cell in self.person_initial_position],
            "probability_of_detection": (
                list(detection) if isinstance(detection, tuple) else detection
            ),
            "reward_scheme": asdict(self.reward_scheme),
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Scenario:
        """The scenario of some parameters; those that are left out have their defaults.

        Args:
            data: as from `to_dict`.

        Raises:
            TypeError: `data` is not a mapping, or a value is of the wrong type.
            ValueError: a value is out of its limits, or there is no such parameter.
        """
        if not isinstance(data, Mapping):
            raise TypeError(f"data must be a mapping of parameters, got {data!r}")
        _check_names(data, ValueError)
        scheme = data.get("reward_scheme", RewardScheme())
        if isinstance(scheme, Mapping):
            known = [each.name for each in fields(RewardScheme)]
            unknown = [name for name in scheme if name not in known]
            if unknown:
                raise ValueError(
                    f"reward_scheme has the figures {', '.join(known)}, got {unknown[0]!r}"
                )
            scheme = RewardScheme(**scheme)
        return cls(**{**data, "reward_scheme": scheme})

    def forecasts(self) -> tuple[ProbabilityMatrix, ...]:
        """Every person's forecast."""
        return tuple(
            ProbabilityMatrix(self.grid_size, cell, self.vector, self.disperse_constant)
            for cell in self.person_initial_position
        )

    def drone_cells(self, drones_positions: object) -> list[int]:
        """The drones' cells by number, y * N + x.

        Args:
            drones_positions: a cell (x, y) for each drone.

        Raises:
            TypeError: they are no cells.
            ValueError: they are not as many as the drones, off the grid, or two are alike.
        """
        name, n, size = "drones_positions", self.n_drones, self.grid_size
        entries = checks.items(name, drones_positions, f"{n} cells (x, y), one for each drone")
        if len(entries) != n:
            raise ValueError(
                f"{name} must hold {n} cells (x, y), one for each drone, "
                f"got {len(entries)}: {drones_positions!r}"
            )
        first_at: dict[Cell, int] = {}
        for drone, entry in enumerate(entries):
            cell = checks.cell(f"{name}[{drone}]", entry, size)
            if cell in first_at:
                raise ValueError(
                    f"{name} must hold different cells, got {cell} for both "
                    f"drone{first_at[cell]} and drone{drone}"
                )
            first_at[cell] = drone
        return [y * size + x for x, y in first_at]

    @property
    def detections(self) -> tuple[float, ...]:
        """Every person's probability of detection."""
        detection = self.probability_of_detection
        if isinstance(detection, tuple):
            return detection
        return (detection,) * len(self.person_initial_position)


def resolve_scenario(scenario: Scenario | None = None, **parameters: Any) -> Scenario:
    """Return the scenario itself, or a scenario made from the parameters.

    For callables that accept either form: a parameter may only differ from its default if
    no scenario is given.

    Raises:
        TypeError: `scenario` is not a `Scenario`, or a parameter is of the wrong type.
        ValueError: a parameter is out of its limits, or is given together with a scenario.
    """
    if scenario is None:
        return Scenario(**parameters)
    check_alone(scenario, parameters)
    return scenario


def check_alone(scenario: object, parameters: Mapping[str, Any]) -> None:
    """Refuse what is not a scenario, and parameters that were given beside one."""
    if not isinstance(scenario, Scenario):
        raise TypeError(f"scenario must be a Scenario, got {scenario!r}")
    for name, value in parameters.items():
        if not _is_default(name, value):
            raise ValueError(
                f"{name} must not be given beside a scenario, got {value!r}; "
                f"use scenario.replace({name}=...)"
            )


def _is_default(name: str, value: Any) -> bool:
    """Whether a parameter has its default, in any of the forms that it may be given in."""
    default = getattr(_DEFAULT, name)
    if isinstance(default, RewardScheme) or isinstance(value, (str, RewardScheme)):
        return bool(value == default)
    try:
        given = np.asarray(value)
        usual = np.asarray(default)
        return given.shape in (usual.shape, usual.shape[1:]) and bool((given == usual).all())
    except (TypeError, ValueError):  # rows of different lengths, for one
        return False


def _check_names(given: Iterable[str], error: type[Exception]) -> None:
    known = [each.name for each in fields(Scenario)]
    for name in given:
        if name not in known:
            raise error(f"a scenario has the parameters {', '.join(known)}, got {name!r}")


def _persons(value: object, grid_size: int) -> tuple[Cell, ...]:
    name = "person_initial_position"
    entries = checks.items(name, value, "a cell (x, y) or several of them")
    if not entries:
        raise ValueError(f"{name} must hold at least one cell (x, y), got {value!r}")
    if all(isinstance(entry, (list, tuple, np.ndarray)) for entry in entries):
        return tuple(
            checks.cell(f"{name}[{index}]", entry, grid_size) for index, entry in enumerate(entries)
        )
    return (checks.cell(name, value, grid_size),)


def _detection(value: object, persons: tuple[Cell, ...]) -> float | tuple[float, ...]:
    name = "probability_of_detection"
    if checks.is_number(value):
        return checks.real(name, value, 0, 1)
    entries = checks.items(name, value, "a number from 0 to 1, or one for each person")
    if len(entries) != len(persons):
        raise ValueError(
            f"{name} must be one number, or one for each cell of person_initial_position, "
            f"got {value!r} for {list(persons)!r}"
        )
    return tuple(
        checks.real(f"{name}[{index}]", entry, 0, 1) for index, entry in enumerate(entries)
    )


_DEFAULT = Scenario()
