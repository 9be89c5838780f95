"""The parameters of a search: meaning, units, defaults and limits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from functools import cached_property
from typing import Any

import numpy as np

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.arrays import Floats, Ints
from DroneSwarmSearch._internal.cells import cell_number
from DroneSwarmSearch.core.grid import Cell
from DroneSwarmSearch.core.rules import CRASHES, END, PASS, RewardScheme, SearchRules
from DroneSwarmSearch.drift.axes import dispersion_rate
from DroneSwarmSearch.drift.model import DriftModel
from DroneSwarmSearch.drift.models import drift_model
from DroneSwarmSearch.persons.hypotheses import Drift, Hypotheses
from DroneSwarmSearch.persons.person import Person

_DRONE_BYTES = 900  # approximate memory of one drone during an episode, including its observations

REPLACED = ("vector", "person_initial_position", "disperse_constant", "probability_of_detection")
"""The parameters whose place `persons` takes."""

MISSIONS = ("rescue", "coverage")

LATER = ("shared_drift", "crash", "radio_range", "search_in_flight")
LATER_FIGURES = ("given_misses",)
"""What fingerprints leave out at its default, in scenarios and their reward schemes: it is younger
than the suite."""


@dataclass(frozen=True)
class Scenario:
    """The parameters of a search, validated; names and defaults as in `DroneSwarmSearch`.

    Environments, batches, policies, planning and evaluation all accept a scenario. Two
    scenarios are equal if their parameters are, whichever form the values were given in::

        scenario = Scenario(20, n_drones=4, vector=(0.2, 0.1), person_initial_position=(8, 8))
        env = DroneSwarmSearch(scenario=scenario)
        larger = scenario.replace(n_drones=6)

    Attributes:
        grid_size: cells along each side of the square grid; at least 2.
        n_drones: the number of drones; from 1 to grid_size².
        vector: the persons' drift in cells per step, (x, y); persons drift at most one cell
            per step along each axis, even if it is longer.
        person_initial_position: each person's cell (x, y) at step 0; a single cell is accepted.
        disperse_constant: how quickly the persons may stray from the drift; at least 0 (see
            `drift.dispersion_rate`).
        timestep_limit: steps in an episode; from 1 to 2**53.
        probability_of_detection: the probability that a search of a person's cell finds the
            person, from 0 to 1: a number for all persons, or a tuple with one for each.
        bayesian_update: whether the matrix is the exact posterior given the searches so far,
            or the drift forecast alone.
        reward_scheme: the figures of the reward table. The default for the coverage mission
            is `RewardScheme.expected()`.
        persons: the persons to find if their start or drift is uncertain, one `Person` or
            several; in place of `vector`, `person_initial_position`, `disperse_constant` and
            `probability_of_detection`, which then keep their defaults; or None.
        shared_drift: whether all persons drift by the same hypothesis, as those of one wreck do in
            one sea: each episode draws one for all of them. They must have equally many
            hypotheses, with equal weights. With `bayesian_update`, a find then tells about those
            who are still missing.
        crash: what happens to drones that leave the grid or enter a taken cell: "end" ends the
            episode; "block" keeps the drone where it is, lower numbers go first; with "pass", only
            the border blocks, and drones may share cells. See `rules`.
        radio_range: how far the drones' radios reach, in cells between the centres of theirs; None
            for drones that always hear each other. In each step, a drone hears which cells the
            others within this distance are in, what they search and whom they find. It then
            observes a matrix of its own, from what it has done and heard.
        search_in_flight: whether every drone searches, in every step, the cell in which it is
            after its action, whichever action that was.
        mission: "rescue", to find all persons; or "coverage", to gain as much probability of
            success as possible: nobody is found, and the episode ends once less than 1% is
            left to find.

    Raises:
        TypeError: a parameter is of the wrong type.
        ValueError: a parameter is out of its limits, or is given together with `persons`.
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
    persons: tuple[Person, ...] | None = field(default=None, kw_only=True)
    mission: str = field(default="rescue", kw_only=True)
    shared_drift: bool = field(default=False, kw_only=True)
    crash: str = field(default=END, kw_only=True)
    radio_range: float | None = field(default=None, kw_only=True)
    search_in_flight: bool = field(default=False, kw_only=True)

    def __post_init__(self) -> None:
        size = checks.integer("grid_size", self.grid_size, 2)
        cells = _cells(self.person_initial_position, size)
        values = {
            "grid_size": size,
            "n_drones": checks.integer("n_drones", self.n_drones, 1, size**2),
            "vector": checks.pair("vector", self.vector),
            "person_initial_position": cells,
            "disperse_constant": checks.real("disperse_constant", self.disperse_constant, 0),
            "timestep_limit": checks.integer(
                "timestep_limit", self.timestep_limit, 1, checks.LARGEST_EXACT
            ),
            "probability_of_detection": _detection(self.probability_of_detection, cells),
            "bayesian_update": checks.boolean("bayesian_update", self.bayesian_update),
            "mission": checks.choice("mission", self.mission, MISSIONS),
            "shared_drift": checks.boolean("shared_drift", self.shared_drift),
            "crash": checks.choice("crash", self.crash, CRASHES),
            "search_in_flight": checks.boolean("search_in_flight", self.search_in_flight),
        }
        if self.radio_range is not None:
            values["radio_range"] = checks.real("radio_range", self.radio_range, 0)
        if not isinstance(self.reward_scheme, RewardScheme):
            raise TypeError(f"reward_scheme must be a RewardScheme, got {self.reward_scheme!r}")
        if values["mission"] == "coverage" and self.reward_scheme == RewardScheme():
            values["reward_scheme"] = RewardScheme.expected()
        if self.persons is not None:
            values["persons"] = _persons(self.persons, size, self.timestep_limit)
            for name in REPLACED:
                if values[name] != getattr(Scenario, name):
                    raise ValueError(
                        f"{name} cannot be given together with persons, got "
                        f"{getattr(self, name)!r}; each Person has its own"
                    )
        for name, value in values.items():
            object.__setattr__(self, name, value)
        if self.shared_drift:
            _check_shared(self.persons_to_find)
        # Two float32 matrices, and two float64 beliefs for each person and hypothesis.
        beliefs = sum(len(person.drift.weights) for person in self.persons or ()) or len(cells)
        knowing = 1 if self.radio_range is None else 1 + self.n_drones
        cell_bytes = 8 + 16 * beliefs * knowing * self.bayesian_update
        checks.fits("the probability matrices", cell_bytes * size**2, grid_size=size)
        checks.fits("the drones", _DRONE_BYTES * self.n_drones, n_drones=self.n_drones)

    def __getstate__(self) -> dict[str, Any]:
        """The parameters, without what is cached."""
        return {field.name: getattr(self, field.name) for field in fields(self)}

    def replace(self, **changes: Any) -> Scenario:
        """Return a scenario with other values of some parameters.

        New `persons` reset the parameters whose place they take to their defaults. To go back
        to those parameters, pass `persons=None` too.

        Raises:
            TypeError: a value is of the wrong type, or there is no such parameter.
            ValueError: a value is out of its limits, or is given together with `persons`.
        """
        if changes.get("persons") is not None:
            changes = {name: getattr(Scenario, name) for name in REPLACED} | changes
        return replace(self, **changes)

    def to_dict(self) -> dict[str, Any]:
        """Return the parameters as plain data for JSON; `from_dict` reads it."""
        scheme = asdict(self.reward_scheme)
        persons = None if self.persons is None else [person.to_dict() for person in self.persons]
        return {**self.__getstate__(), "reward_scheme": scheme, "persons": persons}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Scenario:
        """Make a scenario from the output of `to_dict`; missing parameters get their defaults.

        Raises:
            TypeError: `data` is not a mapping, or a value is of the wrong type.
            ValueError: a value is out of its limits, or there is no such parameter.
        """
        names = [field.name for field in fields(cls)]
        data = checks.known_keys("a scenario", data, names, ValueError)
        scheme = data.get("reward_scheme", RewardScheme())
        if isinstance(scheme, Mapping):
            figures = [field.name for field in fields(RewardScheme)]
            scheme = RewardScheme(**checks.known_keys("a RewardScheme", scheme, figures))
        persons = data.get("persons")
        if persons is not None and not isinstance(persons, Person):
            given = checks.items("persons", persons, "a list of persons")
            persons = [_person_from_dict(index, person) for index, person in enumerate(given)]
        return cls(**{**data, "reward_scheme": scheme, "persons": persons})

    @cached_property
    def persons_to_find(self) -> tuple[Person, ...]:
        """The persons to find, whichever parameters describe them."""
        if self.persons is not None:
            return self.persons
        vector = self.vector
        diffusion = dispersion_rate(self.disperse_constant)
        detections = self.probability_of_detection
        if not isinstance(detections, tuple):
            detections = (detections,) * len(self.person_initial_position)
        return tuple(
            Person((Drift(cell, vector=vector, diffusion=diffusion),), detection)
            for cell, detection in zip(self.person_initial_position, detections, strict=True)
        )

    @property
    def rules(self) -> SearchRules:
        """What the rules depend on in all steps."""
        return SearchRules(
            scheme=self.reward_scheme,
            timestep_limit=self.timestep_limit,
            is_rescue=self.mission == "rescue",
            crash=self.crash,
            search_in_flight=self.search_in_flight,
        )

    @property
    def mean_vector(self) -> tuple[float, float]:
        """The mean drift of all persons and hypotheses in cells per step, (x, y)."""
        if self.persons is None:
            return self.vector
        x, y = np.mean([person.drift.vector for person in self.persons], axis=0).tolist()
        return x, y

    def forecasts(self) -> tuple[DriftModel, ...]:
        """The drift model of each person."""
        return tuple(drift_model(person.drift, self.grid_size) for person in self.persons_to_find)

    @property
    def detections(self) -> tuple[float, ...]:
        """The probability of detection of each person."""
        return tuple(person.probability_of_detection for person in self.persons_to_find)

    @property
    def shared_weights(self) -> Floats | None:
        """The weights of the hypotheses by which all persons drift, (hypotheses,).

        None if each person drifts alone.
        """
        if not self.shared_drift:
            return None
        return np.array(self.persons_to_find[0].drift.weights)

    def by_hypothesis(self) -> list[tuple[float, Scenario]]:
        """The search if each hypothesis of a shared drift were known to be true, with its weight.

        A single pair of 1 and the scenario itself if each person drifts alone.
        """
        weights = self.shared_weights
        if weights is None:
            return [(1.0, self)]
        persons = self.persons_to_find
        return [
            (
                float(weight),
                self.replace(
                    persons=[replace(who, drift=who.drift.drifts[number]) for who in persons],
                    shared_drift=False,
                ),
            )
            for number, weight in enumerate(weights)
        ]

    @property
    def keeps_beliefs(self) -> bool:
        """Whether the posteriors are computed, although the matrix may not show them."""
        return (
            self.bayesian_update or self.reward_scheme.expected_finds or self.mission == "coverage"
        )

    def mass_beyond_grid(self, step: int) -> float:
        """The probability that a person would be beyond the grid if the drift went on there.

        The maximum over all persons. Above 1% within the time limit, the grid is too small for
        the drift.
        """
        beyond: float = max(
            person.drift.mass_beyond(self.grid_size, step) for person in self.persons_to_find
        )
        return beyond

    def drone_cells(self, drones_positions: object, name: str = "drones_positions") -> list[int]:
        """Validate the drones' start cells; returns them as numbers, y * N + x.

        Raises:
            TypeError: they are not cells.
            ValueError: a cell is off the grid, their number is wrong, or two are equal, unless
                drones pass each other.
        """
        n = self.n_drones
        size = self.grid_size
        given = checks.items(name, drones_positions, f"{n} cells (x, y), one for each drone")
        if len(given) != n:
            raise ValueError(
                f"{name} must hold {n} cells (x, y), one for each drone, "
                f"got {len(given)}: {drones_positions!r}"
            )
        first_at: dict[Cell, int] = {}
        numbers = []
        for drone, cell in enumerate(given):
            cell = checks.cell(f"{name}[{drone}]", cell, size)
            numbers.append(cell_number(*cell, size))
            if cell in first_at and self.crash != PASS:
                raise ValueError(
                    f"{name} must hold different cells, got {cell} for both "
                    f"drone{first_at[cell]} and drone{drone}"
                )
            first_at[cell] = drone
        return numbers

    def drone_cells_of_rows(self, drones_positions: Any, rows: int) -> Ints:
        """`drone_cells`, (rows, n_drones), of (n_drones, 2) or (rows, n_drones, 2) numbers."""
        if np.ndim(drones_positions) < 3:
            return np.tile(np.array(self.drone_cells(drones_positions), np.int64), (rows, 1))
        if len(drones_positions) != rows:
            raise ValueError(
                f"drones_positions must hold cells for each of {rows} searches, "
                f"got them for {len(drones_positions)}"
            )
        pairs = enumerate(drones_positions)
        return np.array([self.drone_cells(cells, f"drones_positions[{k}]") for k, cells in pairs])


def checked_scenario(scenario: object) -> Scenario:
    """The scenario itself; a TypeError if it is not a `Scenario`."""
    if not isinstance(scenario, Scenario):
        raise TypeError(f"scenario must be a Scenario, got {scenario!r}")
    return scenario


def resolve_scenario(scenario: Scenario | None = None, **parameters: Any) -> Scenario:
    """The scenario itself, or one made from parameters, which otherwise must be the defaults."""
    if scenario is None:
        return Scenario(**parameters)
    checked_scenario(scenario)
    for name, value in parameters.items():
        if not is_default(name, value):
            raise ValueError(
                f"{name} cannot be given together with a scenario, got {value!r}; "
                f"use scenario.replace({name}=...)"
            )
    return scenario


def is_default(name: str, value: Any) -> bool:
    """Whether a value is the parameter's default, in any accepted form."""
    try:
        return bool(getattr(Scenario(**{name: value}), name) == getattr(Scenario, name))
    except (TypeError, ValueError):
        return False


def _persons(value: object, grid_size: int, timestep_limit: int) -> tuple[Person, ...]:
    """Validate persons: one `Person`, or a sequence of them, who fit the grid and the limit."""
    what = "a Person or a sequence of them"
    persons = [value] if isinstance(value, Person) else checks.items("persons", value, what)
    if not persons:
        raise ValueError(f"persons must hold at least one Person, got {value!r}")
    checked = []
    for index, person in enumerate(persons):
        if not isinstance(person, Person):
            raise TypeError(f"persons[{index}] must be a Person, got {person!r}")
        person.drift.check(grid_size, timestep_limit, f"persons[{index}]")
        checked.append(person)
    return tuple(checked)


def _check_shared(persons: tuple[Person, ...]) -> None:
    """Raise a ValueError unless persons can share a hypothesis."""
    first = [*persons[0].drift.weights]
    for index, person in enumerate(persons):
        if not isinstance(person.drift, Hypotheses):
            raise ValueError(
                f"shared_drift needs persons described by Drift, got {person.drift!r:.100} for "
                f"persons[{index}]"
            )
        weights = [*person.drift.weights]
        if weights != first:
            raise ValueError(
                "shared_drift needs persons with equally many hypotheses and equal weights, got "
                f"{first} for persons[0] and {weights} for persons[{index}]"
            )


def _person_from_dict(index: int, data: object) -> object:
    """A person from plain data; anything else is left to the constructor's checks."""
    if not isinstance(data, Mapping):
        return data
    try:
        return Person.from_dict(data)
    except (TypeError, ValueError) as error:
        raise type(error)(f"persons[{index}]: {error}") from None


def _cells(value: object, grid_size: int) -> tuple[Cell, ...]:
    """The persons' start cells: one cell, or a sequence of cells."""
    name = "person_initial_position"
    given = checks.items(name, value, "a cell (x, y) or several of them")
    if not given:
        raise ValueError(f"{name} must hold at least one cell (x, y), got {value!r}")
    if all(isinstance(item, (list, tuple, np.ndarray)) for item in given):
        return tuple(
            checks.cell(f"{name}[{index}]", item, grid_size) for index, item in enumerate(given)
        )
    return (checks.cell(name, value, grid_size),)


def _detection(value: object, persons: tuple[Cell, ...]) -> float | tuple[float, ...]:
    """One probability of detection, or one for each person."""
    name = "probability_of_detection"
    if checks.is_number(value):
        return checks.real(name, value, 0, 1)
    given = checks.items(name, value, "a number from 0 to 1, or one for each person")
    if len(given) != len(persons):
        raise ValueError(
            f"{name} must be one number, or one for each cell of person_initial_position, "
            f"got {value!r} for {list(persons)!r}"
        )
    return tuple(checks.real(f"{name}[{index}]", item, 0, 1) for index, item in enumerate(given))
