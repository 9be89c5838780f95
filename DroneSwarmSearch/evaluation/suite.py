"""The suite: named searches on which policies are compared, which never change.

`docs/make_suite.py` wrote `suite_v2.json`, and `docs/make_tracks.py` the tracks of some of its
searches; other parameters make another version, in another file.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from DroneSwarmSearch._internal.errors import did_you_mean
from DroneSwarmSearch.core.named_search import NamedSearch, read_json
from DroneSwarmSearch.core.scenario import Scenario


def search(name: str) -> NamedSearch:
    """Return a search of the suite by its name, or one from a JSON file by its path.

    A file holds the parameters of a scenario, as `Scenario.to_dict` returns them, and may hold the
    other attributes of a `NamedSearch`: "name", by default the name of the file, "reason", "scale"
    and "drones_positions", the start cells. Files of tracks are relative to its folder. The entries
    of the suite have this form.

    Raises:
        ValueError: the suite has no such search, or there is no such file, or it does not hold a
            search.
    """
    if name.endswith(".json"):
        path = Path(name)
        try:
            data = {"name": path.stem, "reason": "Read from a file.", **read_json(path)}
            return NamedSearch.from_dict(data)
        except (OSError, TypeError, ValueError) as error:
            raise ValueError(f"{path}: {error}") from error
    if name not in SUITE:
        raise ValueError(
            f"search must be one of {', '.join(SUITE)}, got {name!r:.100}"
            f"{did_you_mean(name, SUITE)} "
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


class _Suite(Mapping[str, NamedSearch]):
    """Searches by name, each made when it is first used: some have large files of tracks."""

    def __init__(self, searches: list[dict[str, Any]]) -> None:
        self._data = {data["name"]: data for data in searches}
        self._made: dict[str, NamedSearch] = {}

    def __getitem__(self, name: str) -> NamedSearch:
        if name not in self._made:
            self._made[name] = NamedSearch.from_dict(self._data[name])
        return self._made[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._data)

    def __len__(self) -> int:
        return len(self._data)


_CONTENT = read_json(Path(__file__).with_name("suite_v2.json"))
SUITE_VERSION: str = _CONTENT["version"]
SUITE: Mapping[str, NamedSearch] = _Suite(_CONTENT["searches"])
"""The searches of the suite by name."""
