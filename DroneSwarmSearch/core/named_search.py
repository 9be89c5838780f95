"""A search for evaluations: a scenario with start cells, a name and a reason."""

from __future__ import annotations

import hashlib
import json
import os
import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.cells import cell_position
from DroneSwarmSearch._internal.files import parsed_json, write_text
from DroneSwarmSearch._internal.text import plural
from DroneSwarmSearch.core.grid import Cell
from DroneSwarmSearch.core.rules import RewardScheme
from DroneSwarmSearch.core.scenario import (
    LATER,
    LATER_FIGURES,
    REPLACED,
    Scenario,
    checked_scenario,
)
from DroneSwarmSearch.geo.scale import Scale
from DroneSwarmSearch.persons.hypotheses import Hypotheses
from DroneSwarmSearch.persons.person import Person

SEPARATOR = re.compile(r",\s+")  # of numbers in indented JSON


@dataclass(frozen=True)
class NamedSearch:
    """A search for evaluations: a scenario with start cells, a name and a reason.

    Attributes:
        name: for tables and files: 1 to 100 printable characters.
        reason: what the search tests, in a sentence or two.
        scenario: its parameters.
        drones: the start cell (x, y) of each drone, all different; empty for the default
            cells, from (0, 0) to the right, row by row.
        scale: the size of its cells and the duration of its steps, if it is a search at sea;
            results do not depend on it.
        land: the (x, y) of cells on land, which pictures show; results do not depend on it.

    Raises:
        TypeError: the name is not text, the scenario no `Scenario`, or cells are no list.
        ValueError: the name is empty or too long, or cells do not fit the scenario.
    """

    name: str
    reason: str
    scenario: Scenario
    drones: tuple[Cell, ...] = ()
    scale: Scale | None = None
    land: tuple[Cell, ...] = ()

    def __post_init__(self) -> None:
        checks.name_text("name", self.name)
        scenario = checked_scenario(self.scenario)
        size = scenario.grid_size
        cells = list(range(scenario.n_drones))
        if len(self.drones):
            cells = scenario.drone_cells(self.drones, "drones")
        positions = tuple(cell_position(cell, size) for cell in cells)
        object.__setattr__(self, "drones", positions)
        given = checks.items("land", self.land, "a list of cells")
        land = tuple(checks.cell(f"land[{index}]", cell, size) for index, cell in enumerate(given))
        object.__setattr__(self, "land", land)

    @property
    def outline(self) -> str:
        """The main parameters, in a line."""
        scenario = self.scenario
        persons = self.scenario.persons_to_find
        scale = self.scale
        width = ""
        steps = f"{scenario.timestep_limit:,} steps"
        if scale is not None:
            width = f" of {scale.metres_per_cell:g} m"
            minutes = scale.seconds(scenario.timestep_limit) / 60
            steps += f" of {scale.seconds_per_step:g} s ({minutes:.0f} minutes)"
        whom = plural(len(persons), "person")
        if scenario.mission == "coverage":
            whom = f"coverage for {whom}"
        whom += max((person.drift.outline for person in persons), key=len)
        detections = ", ".join(f"{value:g}" for value in dict.fromkeys(scenario.detections))
        return (
            f"{scenario.grid_size} x {scenario.grid_size} cells{width}; "
            f"{plural(scenario.n_drones, 'drone')}; {whom}; "
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
        """A hash of all parameters, 64 hexadecimal digits; files count by content, not by path."""
        data = self.data
        for person in data["persons"] or ():
            if "tracks" in person:
                person["tracks"] = {**person["tracks"], "file": None}
        for name in LATER:
            if data[name] == getattr(Scenario, name):
                del data[name]
        for name in LATER_FIGURES:
            if data["reward_scheme"][name] == getattr(RewardScheme, name):
                del data["reward_scheme"][name]
        return hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the search as a JSON file, which `search` reads.

        It holds the parameters that apply, as they were given. Tracks are named by their file.
        Raises OSError if it cannot be written.
        """
        data = {"name": self.name, "reason": self.reason, **self.data}
        if self.scale is not None:
            data["scale"] = asdict(self.scale)
        if self.land:
            data["land"] = [list(cell) for cell in self.land]
        if self.scenario.persons is None:
            del data["persons"]
        else:
            for name in REPLACED:
                del data[name]
            for values, person in zip(data["persons"], self.scenario.persons, strict=True):
                _as_given(values, person, Path(path).parent)
        write_text(Path(path), _indented(data) + "\n")

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> NamedSearch:
        """Make a search from plain data: of the suite, or the content of a file of `save`."""
        rest = dict(data)
        name = rest.pop("name")
        reason = rest.pop("reason")
        scale = rest.pop("scale", None)
        if scale is not None:
            sizes = [field.name for field in fields(Scale)]
            scale = Scale(**checks.known_keys("scale", scale, sizes))
        land = rest.pop("land", ())
        given = rest.pop("drones_positions", [])
        drones: Any = checks.items("drones_positions", given, "a list of cells")
        scenario = Scenario.from_dict({"n_drones": len(drones), **rest} if drones else rest)
        return cls(name, reason, scenario, drones, scale, land)

    def with_posterior(self, bayesian_update: object) -> NamedSearch:
        """Select what drones see: the posterior (True), the prior (False) or the same (None)."""
        if bayesian_update is None:
            return self
        return replace(self, scenario=self.scenario.replace(bayesian_update=bayesian_update))


def _as_given(data: dict[str, Any], person: Person, folder: Path) -> None:
    """Replace plain data of a person by what was given: series by key points, files by paths."""
    if data.get("tracks", {}).get("file"):
        file = os.path.relpath(data["tracks"]["file"], folder)
        data["tracks"] = {**data["tracks"], "file": file}
    if isinstance(person.drift, Hypotheses):
        for values, drift in zip(data["drifts"], person.drift.drifts, strict=True):
            values.update(drift.key_points)


def _indented(data: object) -> str:
    """Plain data as JSON to read, with a line for each list of numbers."""
    text = json.dumps(data, indent=1, ensure_ascii=False)
    numbers = re.compile(r"\[\n\s*((?:-?\d[^\s,]*,\s+)*-?\d[^\s,]*)\n\s*\]")
    return numbers.sub(lambda found: f"[{re.sub(SEPARATOR, ', ', found[1])}]", text)


def read_json(path: Path) -> Any:
    """The object in a JSON file, with the paths of the files of tracks that it names.

    Raises:
        ValueError: the file holds no JSON, or something else than an object.
    """

    def located(item: dict[str, Any]) -> dict[str, Any]:
        if isinstance(item.get("file"), str):
            return {**item, "file": str(path.parent / item["file"])}
        return item

    data = parsed_json(path.read_bytes(), located)
    if not isinstance(data, dict):
        raise ValueError(f"a search is a JSON object, got {data!r:.100}")
    return data
