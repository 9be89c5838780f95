"""Areas that no drone enters."""

import json

import numpy as np
import pytest

from DroneSwarmSearch.cli import main
from DroneSwarmSearch.incident import Incident, plan, write
from DroneSwarmSearch.incident.flights import track

pytest.importorskip("cmaes")
shapely = pytest.importorskip("shapely")

CORNERS = "54-00.2N 007-00.4E; 54-00.2N 007-02.0E; 53-59.0N 007-02.0E; 53-59.0N 007-00.4E"
KNOWN = {
    "position": (54, 7),
    "time": "2026-03-01T09:30Z",
    "object_class": "PIW-1",
    "wind": "300 20kn",
    "coast": "none",
    "drones": 2,
    "endurance": "30 min",
}


@pytest.fixture(scope="module")
def around():
    return plan(Incident(**KNOWN, no_fly=CORNERS), seconds=1.5)


def test_no_flight_enters_the_area(around):
    forbidden = around.incident.forbidden
    assert forbidden.area > 2e6
    free = plan(Incident(**KNOWN), seconds=1.5)
    crossing = []
    for made in (around, free):
        lines = [shapely.LineString(track(each, made.incident.plane)) for each in made.flights]
        crossing.append(any(forbidden.intersects(line) for line in lines))
    assert crossing == [False, True], "which drones would enter if they could"
    assert 0.1 < around.probability_of_success < free.probability_of_success


def test_files_show_it(around, tmp_path):
    write(around, tmp_path)
    assert Incident.read(tmp_path / "incident.json") == around.incident
    features = json.loads((tmp_path / "plan.geojson").read_text("utf-8"))["features"]
    (area,) = [each for each in features if each["properties"].get("name") == "no-fly area"]
    assert area["geometry"]["type"] == "Polygon"
    assert b"no-fly area" in (tmp_path / "plan.kml").read_bytes()
    fences = json.loads((tmp_path / "drone1.plan").read_text("utf-8"))["geoFence"]["polygons"]
    assert [fence["inclusion"] for fence in fences] == [True, False]
    corners = np.array(fences[1]["polygon"])
    assert np.all(np.abs(corners.mean(axis=0) - (53.993, 7.02)) < 0.005)


def test_an_area_in_the_way_is_named(tmp_path, capsys):
    outline = [[6.9, 53.9], [7.1, 53.9], [7.1, 54.1], [6.9, 54.1], [6.9, 53.9]]
    path = tmp_path / "firing.geojson"
    path.write_text(json.dumps({"type": "Polygon", "coordinates": [outline]}), "utf-8")
    options = ["--position", "54", "7", "--time", "2026-03-01T09:30Z", "--object", "PIW-1"]
    options += ["--wind", "300", "20kn", "--coast", "none", "--seconds", "1"]
    with pytest.raises(SystemExit):
        main(["plan", *options, "--no-fly", str(path), "--out", str(tmp_path / "plan")])
    assert "--no-fly must leave a straight way" in capsys.readouterr().err
    with pytest.raises(ValueError, match="no_fly must be a GeoJSON file with polygons"):
        Incident(**KNOWN, no_fly="nowhere.geojson")
