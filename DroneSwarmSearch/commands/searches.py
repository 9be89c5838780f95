"""Searches by the names that the command line accepts."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch.core.named_search import NamedSearch, read_json
from DroneSwarmSearch.evaluation.suite import search
from DroneSwarmSearch.incident.incident import Incident
from DroneSwarmSearch.incident.on_grid import search_on_grid
from DroneSwarmSearch.persons.person import warn_of_mass_beyond
from DroneSwarmSearch.training import TASKS


def named_search(name: str) -> NamedSearch:
    """A search of the suite, from a file of a search or an incident, or of the benchmark.

    The held-out searches of the benchmark are called "drift/0" to "fleet/499".

    Warns if persons at sea may drift beyond the grid. Elsewhere the border is a part of the search:
    persons given by a cell and a vector stop there.

    Raises:
        ValueError: there is no such search, or the file does not hold one.
    """
    held_out = _held_out(name)
    if held_out is not None:  # their border is a part of the task
        return held_out
    found = _of_incident(Path(name)) if name.endswith(".json") else None
    found = found or search(name)
    scenario = found.scenario
    warn_of_mass_beyond(
        scenario.persons or (), scenario.grid_size, scenario.timestep_limit, stacklevel=2
    )
    return found


def check_drone(drone: int | None, search: NamedSearch) -> None:
    """Raise a ValueError unless a drone's map, if there is one, differs from the others' maps."""
    if drone is None:
        return
    if search.scenario.radio_range is None:
        raise ValueError(
            f"--drone: in {search.name}, all drones know the same, as it has no radio_range"
        )
    checks.integer("--drone", drone, 0, search.scenario.n_drones - 1)


def _held_out(name: str) -> NamedSearch | None:
    """A held-out search of the benchmark, for a rescue; None for other names."""
    task, slash, number = name.partition("/")
    if not slash or task not in TASKS:
        return None
    held_out = TASKS[task].held_out()
    if not number.isdecimal() or int(number) >= len(held_out):
        raise ValueError(f"SEARCH must be {task}/0 to {task}/{len(held_out) - 1}, got {name!r}")
    found = held_out[int(number)]
    scenario = found.scenario.replace(mission="rescue")
    return replace(found, name=name, reason=TASKS[task].story, scenario=scenario)


def _of_incident(path: Path) -> NamedSearch | None:
    """The search on a grid for the incident in a file, see `Incident.write`; None for others."""
    try:
        if path.is_file() and "swath" in read_json(path):
            return replace(search_on_grid(Incident.read(path)), name=path.stem)
    except (OSError, TypeError, ValueError) as error:
        raise ValueError(f"{path}: {error}") from error
    return None
