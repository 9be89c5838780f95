"""Areas that no drone enters."""

import json
from datetime import timedelta

import numpy as np
import pytest

from DroneSwarmSearch.cli import main
from DroneSwarmSearch.incident import Incident, plan, write
from DroneSwarmSearch.incident.drone import drone_in_wind
from DroneSwarmSearch.incident.flights import track

pytest.importorskip("cmaes")
shapely = pytest.importorskip("shapely")

pytestmark = pytest.mark.thorough

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


WALL = "54-04N 006-57.5E; 54-04N 006-58.5E; 53-58N 006-58.5E; 53-58N 006-57.5E"
BEHIND_IT = {**KNOWN, "base": "54-00N 006-55E", "endurance": "40 min"}


@pytest.fixture(scope="module")
def detour():
    return plan(Incident(**BEHIND_IT, no_fly=WALL), seconds=1.5)


def test_ways_lead_around_areas(detour):
    """Behind a wall of 7 km, the way has its two southern corners, out and home."""
    incident = detour.incident
    corners = incident.plane.metres([53 + 58 / 60] * 2, [6 + 57.5 / 60, 6 + 58.5 / 60])
    for number, (flight, rows) in enumerate(zip(detour.flights, detour.searches, strict=True)):
        flown = track(flight, incident.plane)
        assert not incident.forbidden.intersects(shapely.LineString(flown))
        out = flown[1 : rows.start]
        home = flown[rows.stop : -1]
        assert len(out) == len(home) == 2
        assert np.hypot(*(out - corners).T).max() < 250
        assert np.hypot(*(home[::-1] - corners).T).max() < 250
        assert [point.searching for point in flight[: rows.start + 1]] == [False] * 3 + [True]
        assert flight[-1].time - flight[0].time <= timedelta(minutes=32)
        airspeeds = []
        drone = drone_in_wind(incident, number)
        seconds = np.array([(point.time - flight[0].time).total_seconds() for point in flight])
        for begin, end, speed in zip(flown, flown[1:], detour.ground_speeds(number), strict=False):
            way = end - begin
            if np.hypot(*way) > 500:
                wind = drone.wind(seconds[:1], begin[:, None])[:, 0]
                airspeeds.append(np.hypot(*(speed * way / np.hypot(*way) - wind)))
        assert airspeeds == pytest.approx([20.0] * len(airspeeds), rel=0.02)


def test_orders_and_missions_have_the_corners(detour, tmp_path):
    write(detour, tmp_path)
    assert "way out, corner 1 53°57.9'N 006°57." in detour.orders[0]
    assert "way home, corner 2 53°57.9'N 006°57." in detour.orders[0]
    items = json.loads((tmp_path / "drone1.plan").read_text("utf-8"))["mission"]["items"]
    points = np.array([each["params"][4:6] for each in items if each["command"] == 16], float)
    flown = [(point.latitude, point.longitude) for point in detour.flights[0][1:]]
    assert points == pytest.approx(np.array(flown), abs=1e-6)
    assert b"way out, corner 2" in (tmp_path / "plan.html").read_bytes()


def test_planes_loiter_beside_areas(tmp_path):
    """Downwind of the base, where a plane would loiter, nobody may fly."""
    downwind = "53-59.9N 006-55.1E; 54-00.1N 006-55.8E; 53-59.4N 006-55.8E; 53-59.4N 006-55.1E"
    incident = Incident(**BEHIND_IT, no_fly=downwind, aircraft="plane")
    made = plan(incident, seconds=1.5)
    write(made, tmp_path)
    for number in (1, 2):
        items = json.loads((tmp_path / f"drone{number}.plan").read_text("utf-8"))["mission"]
        (loiter,) = [each["params"][4:6] for each in items["items"] if each["command"] == 31]
        circle = shapely.Point(incident.plane.metres(*loiter)).buffer(75)
        assert not incident.forbidden.intersects(circle)


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
    # All around the base, which lies in a hole.
    outline = [[6.9, 53.9], [7.1, 53.9], [7.1, 54.1], [6.9, 54.1], [6.9, 53.9]]
    path = tmp_path / "firing.geojson"
    path.write_text(json.dumps({"type": "Polygon", "coordinates": [outline]}), "utf-8")
    options = ["--position", "54", "7", "--time", "2026-03-01T09:30Z", "--object", "PIW-1"]
    options += ["--wind", "300", "20kn", "--coast", "none", "--seconds", "1"]
    with pytest.raises(SystemExit):
        main(["plan", *options, "--no-fly", str(path), "--out", str(tmp_path / "plan")])
    assert "--no-fly must leave a way" in capsys.readouterr().err
    with pytest.raises(ValueError, match="no_fly must be a GeoJSON file with polygons"):
        Incident(**KNOWN, no_fly="nowhere.geojson")
