"""The suite: named searches on which policies are compared.

The searches are data, in `suite_v1.json`, each with the reason for it. They never change, so
that results stay comparable; other parameters make another version of the suite, in a file of
its own.
"""

from __future__ import annotations

import difflib
import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

import DroneSwarmSearch
from DroneSwarmSearch._internal import checks
from DroneSwarmSearch.scenario import Cell, Scenario

__all__ = ["SUITE", "SUITE_VERSION", "NamedSearch", "as_named", "search", "versions"]

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

    Raises:
        TypeError: an attribute is of the wrong type.
        ValueError: `drones` does not fit the scenario.
    """

    name: str
    reason: str
    scenario: Scenario
    drones: tuple[Cell, ...] = ()

    def __post_init__(self) -> None:
        if not isinstance(self.scenario, Scenario):
            raise TypeError(f"scenario must be a Scenario, got {self.scenario!r}")
        size, n = self.scenario.grid_size, self.scenario.n_drones
        cells = self.drones or tuple((cell % size, cell // size) for cell in range(n))
        object.__setattr__(self, "drones", tuple((int(x), int(y)) for x, y in cells))
        self.scenario.drone_cells(self.drones)

    @property
    def outline(self) -> str:
        """The main parameters, in a line."""
        scenario = self.scenario
        n, persons = scenario.n_drones, len(scenario.situation)
        x, y = scenario.mean_vector
        drift = f"drift ({x:g}, {y:g}); disperse constant {scenario.disperse_constant:g}"
        if scenario.persons is not None:
            hypotheses = sum(len(person.drifts) for person in scenario.persons)
            ending = "es" if hypotheses > 1 else "is"
            drift = f"{hypotheses} hypothes{ending} with mean drift ({x:.3g}, {y:.3g})"
        detection = ", ".join(f"{chance:g}" for chance in dict.fromkeys(scenario.detections))
        return (
            f"{scenario.grid_size} x {scenario.grid_size} cells; {n} drone{'s' * (n > 1)}; "
            f"{'coverage for ' * (scenario.mission == 'coverage')}"
            f"{persons} person{'s' * (persons > 1)}; {drift}; probability of detection "
            f"{detection}; {scenario.timestep_limit:,} steps"
        )

    @property
    def parameters(self) -> dict[str, Any]:
        """The parameters as keyword arguments of `SearchBatch`."""
        return {"scenario": self.scenario, "drones_positions": np.array(self.drones)}

    @property
    def data(self) -> dict[str, Any]:
        """The parameters as plain data for files, without name and reason."""
        data = {
            **self.scenario.to_dict(),
            "drones_positions": [list(cell) for cell in self.drones],
        }
        if self.scenario.persons is None:
            # Equal searches have equal data, also if one number stands for all persons.
            data["probability_of_detection"] = list(self.scenario.detections)
        return data

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
        raise TypeError(f"search must be the name of a search, got {name!r}")
    if name not in SUITE:
        near = difflib.get_close_matches(name.lower(), SUITE, cutoff=0.5)
        hint = f"; did you mean {' or '.join(near)}?" if near else ""
        raise ValueError(
            f"search must be one of {', '.join(SUITE)}, got {name!r}{hint} "
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
        f"search must be a name of the suite, a NamedSearch or a Scenario, got {value!r}"
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
    *, name: str, reason: str, drones_positions: list[list[int]], **parameters: Any
) -> NamedSearch:
    scenario = Scenario.from_dict({"n_drones": len(drones_positions), **parameters})
    return NamedSearch(name, reason, scenario, tuple((x, y) for x, y in drones_positions))


SUITE_VERSION, SUITE = _read(Path(__file__).with_name("suite_v1.json"))
"""The version of the suite, a string, and its searches by name."""
