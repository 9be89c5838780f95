"""The suite: named searches on which policies are compared.

The searches are data, in `suite_v1.json`, each with the reason for it; `docs/make_suite.py` wrote
the file. They never change, so that results stay comparable; other parameters make another version
of the suite, in another file.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

import DroneSwarmSearch
from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.errors import did_you_mean
from DroneSwarmSearch.drift.persons import Drift, Person
from DroneSwarmSearch.drift.scale import Scale
from DroneSwarmSearch.scenario import Cell, Scenario, checked_scenario

__all__ = ["SUITE", "SUITE_VERSION", "NamedSearch", "as_named", "search", "versions"]

Floats = NDArray[np.float64]

LISTING = "python -m DroneSwarmSearch evaluate --list"
"""The command that lists the searches."""


@dataclass(frozen=True)
class NamedSearch:
    """A search for evaluations: a scenario with start cells, a name and a reason.

    Attributes:
        name: for tables and files.
        reason: what the search tests, in a sentence or two.
        scenario: its parameters.
        drones: the start cell (x, y) of each drone, all different; empty for the default
            cells, from (0, 0) to the right, row by row.
        scale: the size of its cells and the duration of its steps, if it is a search at sea;
            results do not depend on it.

    Raises:
        TypeError: an attribute is of the wrong type.
        ValueError: `drones` does not fit the scenario.
    """

    name: str
    reason: str
    scenario: Scenario
    drones: tuple[Cell, ...] = ()
    scale: Scale | None = None

    def __post_init__(self) -> None:
        for text in ("name", "reason"):
            if not isinstance(getattr(self, text), str):
                raise TypeError(f"{text} must be a string, got {getattr(self, text)!r:.100}")
        checked_scenario(self.scenario)
        if not (self.scale is None or isinstance(self.scale, Scale)):
            raise TypeError(f"scale must be a Scale or None, got {self.scale!r:.100}")
        size, numbers = self.scenario.grid_size, list(range(self.scenario.n_drones))
        by_default = isinstance(self.drones, (list, tuple)) and not self.drones
        if not by_default:
            numbers = self.scenario.drone_cells(self.drones, "drones")
        object.__setattr__(self, "drones", tuple((cell % size, cell // size) for cell in numbers))

    @property
    def outline(self) -> str:
        """The main parameters, in a line.

        If the start or the drift is uncertain, the line states the standard deviation of the
        position at the first step, and the mean drift and its standard deviation, over all
        hypotheses and both axes; of several persons, the smallest and the largest.
        """
        scenario, scale = self.scenario, self.scale
        n, persons = scenario.n_drones, scenario.situation
        width, steps = "", f"{scenario.timestep_limit:,} steps"
        if scale is not None:
            width = f" of {scale.metres_per_cell:g} m"
            minutes = scale.seconds(scenario.timestep_limit) / 60
            steps += f" of {scale.seconds_per_step:g} s ({minutes:.0f} minutes)"
        parts = [
            f"{scenario.grid_size} x {scenario.grid_size} cells{width}",
            f"{n} drone{'s' * (n > 1)}",
            f"{'coverage for ' * (scenario.mission == 'coverage')}{_number_of_persons(persons)}",
            *self._motion,
            f"probability of detection {_figures(scenario.detections)}",
            steps,
        ]
        return "; ".join(parts)

    @property
    def _motion(self) -> list[str]:
        """Start and drift, as parts of the outline."""
        scenario = self.scenario
        if scenario.persons is None:
            x, y = scenario.vector
            return [f"drift ({x:g}, {y:g})", f"disperse constant {scenario.disperse_constant:g}"]
        lengths, speeds = (1.0, "cells"), (1.0, "cells per step")
        if self.scale is not None:
            lengths = self.scale.metres_per_cell, "m"
            speeds = self.scale.metres_per_cell / self.scale.seconds_per_step, "m/s"
        starts, means, deviations = zip(*map(_uncertainty, scenario.persons), strict=True)
        return [
            f"position sd {_range(starts, *lengths)}",
            f"drift {_range(means, *speeds)}",
            f"drift sd {_range(deviations, *speeds)}",
        ]

    @property
    def parameters(self) -> dict[str, Any]:
        """The parameters as keyword arguments of `SearchBatch`."""
        return {"scenario": self.scenario, "drones_positions": np.array(self.drones)}

    @property
    def data(self) -> dict[str, Any]:
        """The parameters as plain data for files, without name and reason."""
        data = self.scenario.to_dict()
        if self.scenario.persons is None:
            # Equal searches have equal data, also if one number stands for all persons.
            data["probability_of_detection"] = list(self.scenario.detections)
        return {**data, "drones_positions": [list(cell) for cell in self.drones]}

    @property
    def fingerprint(self) -> str:
        """A hash of all parameters, 64 hexadecimal digits."""
        text = json.dumps(self.data, sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()

    def with_posterior(self, bayesian_update: object) -> NamedSearch:
        """The same search, in which drones see the posterior (True) or the prior."""
        flag = checks.boolean("bayesian_update", bayesian_update)
        return replace(self, scenario=self.scenario.replace(bayesian_update=flag))


def search(name: str) -> NamedSearch:
    """Return a search of the suite by its name.

    Raises:
        TypeError: the name is not a string.
        ValueError: the suite has no such search; the message lists similar names.
    """
    if not isinstance(name, str):
        raise TypeError(f"search must be the name of a search, got {name!r:.100}")
    if name not in SUITE:
        hint = did_you_mean(name, SUITE)
        raise ValueError(
            f"search must be one of {', '.join(SUITE)}, got {name!r:.100}{hint} "
            f"(`{LISTING}` describes them)"
        )
    return SUITE[name]


def as_named(value: object) -> NamedSearch:
    """Return a `NamedSearch` from a name, a `NamedSearch` or a `Scenario`.

    Raises:
        TypeError: the value is something else.
        ValueError: the suite has no search of that name.
    """
    if isinstance(value, NamedSearch):
        return value
    if isinstance(value, Scenario):
        return NamedSearch("scenario", "Given by its parameters.", value)
    if isinstance(value, str):
        return search(value)
    raise TypeError(
        f"search must be a name of the suite, a NamedSearch or a Scenario, got {value!r:.100}"
    )


def versions() -> dict[str, str]:
    """The versions that results depend on, as plain data for files."""
    return {
        "package": DroneSwarmSearch.__version__,
        "numpy": np.__version__,
        "suite": SUITE_VERSION,
    }


def _read(path: Path) -> tuple[str, Mapping[str, NamedSearch]]:
    data = json.loads(path.read_text("utf-8"))
    named = [_named(**entry) for entry in data["searches"]]
    return data["version"], MappingProxyType({each.name: each for each in named})


def _named(
    *,
    name: str,
    reason: str,
    drones_positions: list[list[int]],
    scale: dict[str, float] | None = None,
    **parameters: Any,
) -> NamedSearch:
    scenario = Scenario.from_dict({"n_drones": len(drones_positions), **parameters})
    drones = tuple((x, y) for x, y in drones_positions)
    return NamedSearch(name, reason, scenario, drones, None if scale is None else Scale(**scale))


def _number_of_persons(persons: tuple[Person, ...]) -> str:
    """How many persons and hypotheses there are."""
    count = len(persons)
    text = f"{count} person{'s' * (count > 1)}"
    hypotheses = sorted({len(person.drifts) for person in persons})
    if hypotheses == [1]:
        return text
    numbers = " to ".join(str(number) for number in dict.fromkeys((hypotheses[0], hypotheses[-1])))
    return f"{text} with {numbers} hypotheses{' each' * (count > 1)}"


def _uncertainty(person: Person) -> tuple[float, float, float]:
    """How well a person's position and drift are known when the search begins.

    Returns:
        The standard deviation of the position in cells, the mean drift in cells per step, and
        its standard deviation; standard deviations are root mean squares over the axes.
    """
    weights = np.array(person.weights)[:, None]
    positions = np.array([_position(drift) for drift in person.drifts])
    vectors = np.array([drift.vector for drift in person.drifts])
    spreads = np.array([drift.vector_sd for drift in person.drifts]) ** 2

    def deviation(centres: Floats, within: Floats) -> float:
        mean = (weights * centres).sum(axis=0)
        total = (weights * (within + (centres - mean) ** 2)).sum(axis=0)
        return math.sqrt(total.mean())

    drift = math.hypot(*(weights * vectors).sum(axis=0))
    return deviation(positions[:, 0], positions[:, 1]), drift, deviation(vectors, spreads)


def _position(drift: Drift) -> tuple[Floats, Floats]:
    """The mean and the variance of the position at the first step, each (x, y)."""
    if drift.prior is None:
        displacement = np.array([axis.displacement(0) for axis in drift.axes])
        return drift.start + displacement, np.array([axis.sd(0) for axis in drift.axes]) ** 2
    y, x = np.indices(drift.prior.shape)
    cells = np.array([x, y])
    mean = (drift.prior * cells).sum(axis=(1, 2))
    return mean, (drift.prior * (cells - mean[:, None, None]) ** 2).sum(axis=(1, 2))


def _range(values: Iterable[float], factor: float, unit: str) -> str:
    """The smallest and the largest value in a unit, to two digits."""
    ordered = sorted(value * factor for value in values)
    ends = dict.fromkeys(f"{float(f'{value:.2g}'):g}" for value in (ordered[0], ordered[-1]))
    return f"{' to '.join(ends)} {unit}"


def _figures(values: Iterable[float]) -> str:
    """The different values, in order."""
    return ", ".join(f"{value:g}" for value in dict.fromkeys(values))


SUITE_VERSION, SUITE = _read(Path(__file__).with_name("suite_v1.json"))
"""The version of the suite, a string, and its searches by name."""
