"""The real coastline, which all other tests replace by a small one; in a process without that."""

import importlib.metadata
import json
import os
import subprocess
import sys

import pytest

pytestmark = pytest.mark.slow

PLACES = {
    "Helgoland": (54.1820, 7.8850, "land"),
    "west of Helgoland": (54.18, 7.85, "sea"),
    "40 km inland": (53.0, 8.5, "41 km"),
    "Svolvær": (68.2350, 14.5650, "land"),
    "Vestfjorden": (68.0, 14.8, "sea"),
    "Sognefjord": (61.10, 6.50, "sea"),
    "a spit, Hel": (54.70, 18.67, "land"),
    "off Hel": (54.66, 18.60, "sea"),
    "Taveuni, at the date line": (-16.80, -179.95, "land"),
    "Koro Sea, at the date line": (-17.4, 179.99, "sea"),
    "Koro Sea, beyond the date line": (-17.4, -179.99, "sea"),
    "Ross Island": (-77.53, 167.1, "land"),
    "McMurdo Sound": (-77.6, 165.5, "sea"),
    "the South Pole": (-89.0, 0.0, "land"),
    "the North Pole": (89.0, 0.0, "sea"),
    "Lake Constance, which GSHHG without lakes has as land": (47.6, 9.4, "land"),
}

SCRIPT = """
import json, sys
from DroneSwarmSearch.geo import land_around
found = {}
for name, (latitude, longitude, _) in json.load(sys.stdin).items():
    land = land_around("gshhg", (latitude, longitude), 64_000.0)
    inland = land.distance_to_sea((0.0, 0.0))
    found[name] = [bool(land.contains([[0.0], [0.0]])[0]), f"{inland / 1000:.0f} km"]
print(json.dumps(found))
"""


@pytest.fixture(scope="module")
def found(real_coast, tmp_path_factory) -> dict[str, list]:
    if not [*importlib.metadata.distributions(name="roaring-landmask")]:
        pytest.skip("roaring-landmask is not installed")
    environment = {**os.environ, "XDG_CACHE_HOME": str(tmp_path_factory.mktemp("cache"))}
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT],
        input=json.dumps(PLACES),
        capture_output=True,
        text=True,
        check=True,
        env=environment,
    )
    return json.loads(done.stdout)


@pytest.mark.parametrize("name", PLACES)
def test_land_and_sea(found, name):
    _, _, expected = PLACES[name]
    is_land, inland = found[name]
    assert is_land == (expected != "sea")
    if expected.endswith("km"):
        assert inland == expected
