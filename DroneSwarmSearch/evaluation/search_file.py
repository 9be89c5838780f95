"""Searches from JSON files, for the command line."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

from DroneSwarmSearch.drift.scale import Scale
from DroneSwarmSearch.evaluation.suite import NamedSearch
from DroneSwarmSearch.scenario import Scenario

__all__ = ["SUFFIX", "search_from_file"]

SUFFIX = ".json"

_REASON = "Read from a file."

_SCALE = {"metres_per_cell", "seconds_per_step"}


def search_from_file(path: Path) -> NamedSearch:
    """Read a search from a JSON file.

    The file holds the parameters of a scenario, as `Scenario.to_dict` returns them, and may hold
    the other attributes of a `NamedSearch`: "name", by default the name of the file, "reason",
    "scale" and "drones_positions", the start cells. The entries of the suite and the "parameters"
    in the files of `save_json` have this form.

    Raises:
        ValueError: there is no such file, or it does not hold a search.
    """
    if not path.is_file():
        raise ValueError(f"search must name a file, but there is no {str(path)!r:.100}")
    try:
        data = json.loads(path.read_bytes())
        if not isinstance(data, Mapping):
            raise TypeError("the file must hold the parameters of a scenario")
        rest = dict(data)
        name, reason = rest.pop("name", path.stem), rest.pop("reason", _REASON)
        scale = rest.pop("scale", None)
        if not (scale is None or (isinstance(scale, Mapping) and {*scale} == _SCALE)):
            raise TypeError(f"scale must have {' and '.join(sorted(_SCALE))}, got {scale!r:.100}")
        drones = rest.pop("drones_positions", [])
        if not isinstance(drones, list):
            raise TypeError(f"drones_positions must be a list of cells, got {drones!r:.100}")
        if drones:
            rest.setdefault("n_drones", len(drones))
        scenario = Scenario.from_dict(rest)
        if drones:
            scenario.drone_cells(drones)
        size = None if scale is None else Scale(**scale)
        return NamedSearch(name, reason, scenario, tuple(map(tuple, drones)), size)
    except (OSError, RecursionError, TypeError, ValueError) as error:
        raise ValueError(f"{path}: {error}") from error
