"""The suite: named searches on which policies are compared, which never change.

`docs/make_suite.py` wrote `suite_v1.json`; other parameters make another version, in another file.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.errors import did_you_mean
from DroneSwarmSearch.drift.scale import Scale
from DroneSwarmSearch.scenario import Cell, Scenario, checked_scenario

__all__ = ["SUITE", "SUITE_VERSION", "NamedSearch", "as_named", "search"]


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
        ValueError: `drones` does not fit the scenario.
    """

    name: str
    reason: str
    scenario: Scenario
    drones: tuple[Cell, ...] = ()
    scale: Scale | None = None

    def __post_init__(self) -> None:
        scenario = checked_scenario(self.scenario)
        size, numbers = scenario.grid_size, list(range(scenario.n_drones))
        if len(self.drones):
            numbers = scenario.drone_cells(self.drones, "drones")
        object.__setattr__(self, "drones", tuple((cell % size, cell // size) for cell in numbers))

    @property
    def outline(self) -> str:
        """The main parameters, in a line."""
        scenario, persons, scale = self.scenario, self.scenario.situation, self.scale
        hypotheses = max(len(person.weights) for person in persons)
        width, steps = "", f"{scenario.timestep_limit:,} steps"
        if scale is not None:
            width = f" of {scale.metres_per_cell:g} m"
            minutes = scale.seconds(scenario.timestep_limit) / 60
            steps += f" of {scale.seconds_per_step:g} s ({minutes:.0f} minutes)"
        whom = f"{len(persons)} person{'s' * (len(persons) > 1)}"
        whom += f" with up to {hypotheses} hypotheses" * (hypotheses > 1)
        detections = ", ".join(f"{value:g}" for value in dict.fromkeys(scenario.detections))
        return (
            f"{scenario.grid_size} x {scenario.grid_size} cells{width}; "
            f"{scenario.n_drones} drone{'s' * (scenario.n_drones > 1)}; "
            f"{'coverage for ' * (scenario.mission == 'coverage')}{whom}; "
            f"probability of detection {detections}; {steps}"
        )

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
        return hashlib.sha256(json.dumps(self.data, sort_keys=True).encode()).hexdigest()

    def with_posterior(self, bayesian_update: object) -> NamedSearch:
        """Select what drones see: the posterior (True), the prior (False) or the same (None)."""
        if bayesian_update is None:
            return self
        return replace(self, scenario=self.scenario.replace(bayesian_update=bayesian_update))


def search(name: str) -> NamedSearch:
    """Return a search of the suite by its name, or one from a JSON file by its path.

    A file holds the parameters of a scenario, as `Scenario.to_dict` returns them, and may hold the
    other attributes of a `NamedSearch`: "name", by default the name of the file, "reason", "scale"
    and "drones_positions", the start cells. The entries of the suite have this form.

    Raises:
        ValueError: the suite has no such search, or there is no such file, or it does not hold a
            search.
    """
    if name.endswith(".json"):
        path = Path(name)
        if not path.is_file():
            raise ValueError(f"search must name a file, but there is no {name!r:.100}")
        try:
            defaults = {"name": path.stem, "reason": "Read from a file."}
            return _named({**defaults, **json.loads(path.read_bytes())})
        except (TypeError, ValueError) as error:
            raise ValueError(f"{path}: {error}") from error
    if name not in SUITE:
        hint = did_you_mean(name, SUITE)
        raise ValueError(
            f"search must be one of {', '.join(SUITE)}, got {name!r:.100}{hint} "
            "(`python -m DroneSwarmSearch evaluate --list` describes them)"
        )
    return SUITE[name]


def as_named(value: object) -> NamedSearch:
    """Return a `NamedSearch` from a name as for `search`, a `NamedSearch` or a `Scenario`."""
    if isinstance(value, NamedSearch):
        return value
    if isinstance(value, Scenario):
        return NamedSearch("scenario", "Given by its parameters.", value)
    if isinstance(value, str):
        return search(value)
    raise TypeError(
        f"search must be a name of the suite, a NamedSearch or a Scenario, got {value!r:.100}"
    )


def _named(data: Mapping[str, Any]) -> NamedSearch:
    rest = dict(data)
    name, reason, scale = rest.pop("name"), rest.pop("reason"), rest.pop("scale", None)
    drones = checks.items("drones_positions", rest.pop("drones_positions", []), "a list of cells")
    scenario = Scenario.from_dict({"n_drones": len(drones), **rest} if drones else rest)
    cells: Any = drones
    if drones:
        scenario.drone_cells(drones)
    return NamedSearch(name, reason, scenario, cells, scale and Scale(**scale))


def _read(path: Path) -> tuple[str, dict[str, NamedSearch]]:
    data = json.loads(path.read_text("utf-8"))
    named = [_named(entry) for entry in data["searches"]]
    return data["version"], {each.name: each for each in named}


SUITE_VERSION, SUITE = _read(Path(__file__).with_name("suite_v1.json"))
"""The version of the suite, a string, and its searches by name."""
