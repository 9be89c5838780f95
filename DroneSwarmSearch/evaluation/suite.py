"""The suite: named searches on which policies are compared, which never change.

`docs/make_suite.py` wrote `suite_v2.json`, and `docs/make_tracks.py` the tracks of some of its
searches; other parameters make another version, in another file.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.errors import did_you_mean
from DroneSwarmSearch._internal.files import write_text
from DroneSwarmSearch.drift.persons import warn_of_mass_beyond
from DroneSwarmSearch.drift.scale import Scale
from DroneSwarmSearch.scenario import Cell, Scenario, checked_scenario


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
        if tracks := [len(person.tracks) for person in persons if person.tracks is not None]:
            whom += f" from {sum(tracks):,} tracks"
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
        """A hash of all parameters, 64 hexadecimal digits; files count by content, not by path."""
        data = self.data
        for person in data["persons"] or ():
            if "tracks" in person:
                person["tracks"] = {**person["tracks"], "file": None}
        return hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the search as a JSON file, which `search` reads.

        Tracks are named by their file. Raises OSError if it cannot be written.
        """
        entry = {"name": self.name, "reason": self.reason, **self.data}
        if self.scale is not None:
            entry["scale"] = asdict(self.scale)
        for person in entry["persons"] or ():
            if person.get("tracks", {}).get("file"):
                file = os.path.relpath(person["tracks"]["file"], Path(path).parent)
                person["tracks"] = {**person["tracks"], "file": file}
        write_text(Path(path), json.dumps(entry, indent=1) + "\n")

    def with_posterior(self, bayesian_update: object) -> NamedSearch:
        """Select what drones see: the posterior (True), the prior (False) or the same (None)."""
        if bayesian_update is None:
            return self
        return replace(self, scenario=self.scenario.replace(bayesian_update=bayesian_update))


def search(name: str) -> NamedSearch:
    """Return a search of the suite by its name, or one from a JSON file by its path.

    A file holds the parameters of a scenario, as `Scenario.to_dict` returns them, and may hold the
    other attributes of a `NamedSearch`: "name", by default the name of the file, "reason", "scale"
    and "drones_positions", the start cells. Files of tracks are relative to its folder. The entries
    of the suite have this form. An incident's file, see `Incident.save`, is the search for it.

    Raises:
        ValueError: the suite has no such search, or there is no such file, or it does not hold a
            search.
    """
    if name.endswith(".json"):
        path = Path(name)
        try:
            data = _read(path)
            if "swath" in data:
                from DroneSwarmSearch.incident import Incident

                return replace(Incident.read(path).search(), name=path.stem)
            return _named({"name": path.stem, "reason": "Read from a file.", **data})
        except (OSError, TypeError, ValueError) as error:
            raise ValueError(f"{path}: {error}") from error
    if name not in SUITE:
        raise ValueError(
            f"search must be one of {', '.join(SUITE)}, got {name!r:.100}"
            f"{did_you_mean(name, SUITE)} "
            "(`python -m DroneSwarmSearch evaluate --list` describes them)"
        )
    return SUITE[name]


def search_on_grid(name: str) -> NamedSearch:
    """`search`, with a warning if persons at sea may drift beyond the grid.

    Elsewhere the border is a part of the search: persons given by a cell and a vector stop there.
    """
    found = search(name)
    persons, scenario = found.scenario.persons or (), found.scenario
    warn_of_mass_beyond(persons, scenario.grid_size, scenario.timestep_limit, stacklevel=2)
    return found


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
    return NamedSearch(name, reason, scenario, cells, scale and Scale(**scale))


def _read(path: Path) -> Any:
    """The content of a JSON file, with the paths of the files of tracks that it names."""

    def located(entry: dict[str, Any]) -> dict[str, Any]:
        return {**entry, "file": str(path.parent / entry["file"])} if entry.get("file") else entry

    return json.loads(path.read_bytes(), object_hook=located)


class _Suite(Mapping[str, NamedSearch]):
    """Searches by name, each made when it is first used: some have large files of tracks."""

    def __init__(self, entries: list[dict[str, Any]]) -> None:
        self._entries = {entry["name"]: entry for entry in entries}
        self._made: dict[str, NamedSearch] = {}

    def __getitem__(self, name: str) -> NamedSearch:
        if name not in self._made:
            self._made[name] = _named(self._entries[name])
        return self._made[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._entries)

    def __len__(self) -> int:
        return len(self._entries)


_CONTENT = _read(Path(__file__).with_name("suite_v2.json"))
SUITE_VERSION: str = _CONTENT["version"]
SUITE: Mapping[str, NamedSearch] = _Suite(_CONTENT["searches"])
"""The searches of the suite by name."""
