"""The suite: named searches, fixed for ever, on which policies are compared.

The searches are data, in `suite_v1.json`, each with the reason for it. Results are
comparable as long as every parameter stays what it is: a change of any makes another
version of the suite, in a file of its own.
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

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch.scenario import Cell, Scenario

__all__ = ["SUITE", "SUITE_VERSION", "NamedSearch", "as_named", "search"]

LISTING = "python -m DroneSwarmSearch evaluate --list"
"""The command that shows the searches there are."""


@dataclass(frozen=True)
class NamedSearch:
    """A search to be evaluated on, with its name and the reason for it.

    Attributes:
        name: what it is called in tables and files.
        reason: what it is there for, in a sentence or two.
        scenario: its parameters.
        drones: the drones' start cells (x, y), one for each drone, no two alike; or empty
            for the usual places, from left to right from (0, 0), row by row.

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
    def parameters(self) -> dict[str, Any]:
        """The parameters under the names that `SearchBatch` has for them."""
        return {"scenario": self.scenario, "drones_positions": np.array(self.drones)}

    @property
    def data(self) -> dict[str, Any]:
        """The parameters as plain data, for files; neither name nor reason."""
        return {
            **self.scenario.to_dict(),
            # One form for one search: a number may stand for all persons.
            "probability_of_detection": list(self.scenario.detections),
            "drones_positions": [list(cell) for cell in self.drones],
        }

    @property
    def fingerprint(self) -> str:
        """A word of 64 hexadecimal digits that changes if any parameter does."""
        text = json.dumps(self.data, sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()

    def with_posterior(self, bayesian_update: object) -> NamedSearch:
        """The same search, showing the drones the posterior (True) or the drift alone."""
        flag = checks.boolean("bayesian_update", bayesian_update)
        return replace(self, scenario=self.scenario.replace(bayesian_update=flag))


def search(name: str) -> NamedSearch:
    """A search of the suite by its name.

    Raises:
        TypeError: the name is no string.
        ValueError: there is no such search; the message names those with a similar name.
    """
    if not isinstance(name, str):
        raise TypeError(f"search must be the name of a search, got {name!r}")
    if name not in SUITE:
        near = difflib.get_close_matches(name.lower(), SUITE, cutoff=0.5)
        meant = f"; did you mean {' or '.join(near)}?" if near else ""
        raise ValueError(
            f"search must be one of the suite's, got {name!r}{meant} (`{LISTING}` shows all of "
            f"them: {', '.join(SUITE)})"
        )
    return SUITE[name]


def as_named(value: object) -> NamedSearch:
    """A search from whatever stands for one: a name, a `NamedSearch` or a `Scenario`.

    Raises:
        TypeError: it is none of these.
        ValueError: there is no search of that name.
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


def _read(path: Path) -> tuple[str, Mapping[str, NamedSearch]]:
    told = json.loads(path.read_text("utf-8"))
    named = [_named(**entry) for entry in told["searches"]]
    return told["version"], MappingProxyType({each.name: each for each in named})


def _named(
    *, name: str, reason: str, drones_positions: list[list[int]], **parameters: Any
) -> NamedSearch:
    scenario = Scenario.from_dict({"n_drones": len(drones_positions), **parameters})
    return NamedSearch(name, reason, scenario, tuple((x, y) for x, y in drones_positions))


SUITE_VERSION, SUITE = _read(Path(__file__).with_name("suite_v1.json"))
"""The version of the suite, a string, and its searches by name, in their order."""
