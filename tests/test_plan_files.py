"""The files of a flight plan in the readers that people use, and flights from CSV files."""

import csv
import json
from datetime import datetime, timedelta, timezone

import gpxpy
import numpy as np
import pygame
import pyproj
import pytest
import shapely
from fastkml import Folder, GroundOverlay, LineStyle, Placemark, kml
from fastkml.utils import find_all

from DroneSwarmSearch.incident import Incident, Waypoint, after, read_flights, simulate, write
from DroneSwarmSearch.incident import plan as plan_flights
from DroneSwarmSearch.rendering import drone_colour

pytest.importorskip("cmaes")

pytestmark = pytest.mark.thorough

GEOD = pyproj.Geod(ellps="WGS84")
NORTH_SEA = (54.18, 7.85)
FIJI = (-17.0, 180.0)
MILLISECOND = timedelta(milliseconds=1)


@pytest.fixture(scope="module", params=[NORTH_SEA, FIJI], ids=["north_sea", "date_line"])
def plan(request):
    incident = Incident(
        position=request.param,
        time="2026-03-01T05:30Z",
        object_class="LIFE-RAFT-SB-6",
        wind="300 20kn",
        current="160 0.5kn",
        altitude=80.0,
        endurance="25min",
        night=True,
    )
    return plan_flights(incident)


@pytest.fixture(scope="module")
def folder(plan, tmp_path_factory):
    there = tmp_path_factory.mktemp("plan")
    write(plan, there)
    return there


def away(point: tuple[float, ...], waypoint: Waypoint) -> float:
    """The larger difference in degrees of (longitude, latitude); -180 and 180 are the same."""
    across = (point[0] - waypoint.longitude + 180) % 360 - 180
    return max(abs(across), abs(point[1] - waypoint.latitude))


def test_gpx_has_a_route_for_each_drone(plan, folder):
    routes = gpxpy.parse((folder / "plan.gpx").read_text("utf-8")).routes
    assert [route.name for route in routes] == ["drone 1", "drone 2", "drone 3"]
    for route, flight in zip(routes, plan.flights, strict=True):
        assert route.description in plan.orders
        assert len({point.name for point in route.points}) == len(flight)
        for point, waypoint in zip(route.points, flight, strict=True):
            assert away((point.longitude, point.latitude), waypoint) < 1e-6
            assert abs(point.time - waypoint.time) < MILLISECOND
            assert point.elevation == waypoint.altitude
    assert routes[1].points[3].name == "2-03"


def test_kml_is_valid_and_shows_flights_in_time(plan, folder):
    # With lxml, fastkml checks the file against the schema of KML 2.2.
    (document,) = kml.KML.parse(folder / "plan.kml").features
    assert document.description == plan.incident.sentence
    marks = [each for each in document.features if isinstance(each, Placemark)]
    (known,) = [each for each in marks if each.name != "land"]
    flights = [each for each in document.features if isinstance(each, Folder)]
    assert known.name == "last known position"
    assert known.geometry.coords[0] == pytest.approx((*plan.incident.position[::-1], 0))
    for flight, waypoints in zip(flights, plan.flights, strict=True):
        line, *marks = flight.features
        parts = getattr(line.geometry, "geoms", [line.geometry])
        points = [point for part in parts for point in part.coords if abs(point[0]) < 180]
        places = [(round(each.longitude, 7), round(each.latitude, 7)) for each in waypoints]
        height = waypoints[0].altitude
        inside = [(*place, height) for place in places if abs(place[0]) < 180]
        assert np.array(points) == pytest.approx(np.array(inside), abs=1e-6)
        ends = [*waypoints[1:], waypoints[-1]]
        for mark, waypoint, end in zip(marks, waypoints, ends, strict=True):
            assert away(mark.geometry.coords[0], waypoint) < 1e-6
            assert abs(mark.times.begin.dt - waypoint.time) < MILLISECOND
            assert abs(mark.times.end.dt - end.time) < MILLISECOND
    lines = [style for each in flights for style in find_all(each.features[0], of_type=LineStyle)]
    assert len({line.color for line in lines}) == len(plan.flights)
    for drone, line in enumerate(lines):
        red, green, blue = drone_colour(drone)
        assert line.color == f"ff{blue:02x}{green:02x}{red:02x}"


def test_the_map_in_kml_lies_where_the_grid_does(plan, folder):
    overlays = list(find_all(kml.KML.parse(folder / "plan.kml"), of_type=GroundOverlay))
    matrix, (west, south), (east, north) = plan.density(plan.on_scene)
    opacity = []
    size = len(matrix)
    half = (east - west) / 2
    half += np.hypot(east + west, north + south) / 2  # from the last known position
    for overlay in overlays:
        picture = pygame.image.load(folder / overlay.icon.href)
        opacity.append(pygame.surfarray.array_alpha(picture).T)
    expected = 255 * matrix / matrix.max()
    assert np.concatenate(opacity, axis=1) == pytest.approx(expected, abs=0.5 + 1e-9)
    assert expected.min() < 0.5, "far from the last known position, it is transparent"
    boxes = [overlay.lat_lon_box for overlay in overlays]
    if len(boxes) == 2:
        assert boxes[0].east == 180 and boxes[1].west == -180
        assert opacity[0].shape[1] / size == pytest.approx(
            (180 - boxes[0].west) / (360 + boxes[1].east - boxes[0].west), abs=0.51 / size
        )
    corners = [(west, north), (east, north), (west, south), (east, south)]
    latitudes, longitudes = plan.incident.plane.degrees(corners).T
    west = boxes[0].west
    east = boxes[-1].east
    north = boxes[0].north
    south = boxes[0].south
    box = [west, east, west, east], [north, north, south, south]
    most = 1.1 * half**2 * abs(np.tan(np.radians(plan.incident.position[0]))) / 6.37e6
    assert max(GEOD.inv(*box, longitudes, latitudes)[2]) < most + 0.2


def when(text: str) -> datetime:
    return datetime.fromisoformat(text.replace("Z", "+00:00"))


def test_geojson_has_lines_and_waypoints(plan, folder):
    collection = json.loads((folder / "plan.geojson").read_text("utf-8"))
    assert collection["type"] == "FeatureCollection"
    known, *features = collection["features"]
    assert known["geometry"]["coordinates"] == list(plan.incident.position[::-1])
    for drone, flight in enumerate(plan.flights, 1):
        line, *waypoints = [each for each in features if each["properties"].get("drone") == drone]
        shape = shapely.geometry.shape(line["geometry"])
        properties = line["properties"]
        assert shape.is_valid
        latitudes = [w.latitude for w in flight]
        longitudes = [w.longitude for w in flight]
        length = GEOD.line_length(longitudes, latitudes)
        assert properties["distance_m"] == pytest.approx(length, abs=1)
        parts = shapely.get_parts(shape)
        sides = {np.sign(round(longitude, 7) % 360 - 180) for longitude in longitudes}
        assert (len(parts) > 1) == ({-1, 1} <= sides), "only lines across the date line are split"
        assert sum(map(GEOD.geometry_length, parts)) == pytest.approx(length, rel=1e-5)
        for part in parts:
            # Read on a plane, as most programs do, no part crosses the world.
            assert np.ptp(np.array(part.coords)[:, 0]) < 1
            assert abs(np.array(part.coords)[:, 0]).max() <= 180
        assert abs(when(properties["take_off_utc"]) - flight[0].time) < MILLISECOND
        assert abs(when(properties["landing_utc"]) - flight[-1].time) < MILLISECOND
        for number, (each, waypoint) in enumerate(zip(waypoints, flight, strict=True)):
            point = shapely.geometry.shape(each["geometry"])
            properties = each["properties"]
            assert away((point.x, point.y), waypoint) < 1e-6
            assert abs(when(properties["time_utc"]) - waypoint.time) < MILLISECOND
            assert properties["waypoint"] == number
            assert properties["altitude_m"] == waypoint.altitude
            assert properties["searching"] is waypoint.searching


def test_csv_comes_back(plan, folder):
    flights = read_flights(folder / "plan.csv")
    assert [flight.drone for flight in flights] == [1, 2, 3]
    for flight, written in zip(flights, plan.flights, strict=True):
        for waypoint, other in zip(flight.waypoints, written, strict=True):
            assert away((waypoint.longitude, waypoint.latitude), other) < 1e-7
            assert abs(waypoint.time - other.time) < MILLISECOND
            assert waypoint.time.tzinfo is timezone.utc
            assert waypoint[3:] == other[3:]
    weights = [
        simulate(after(plan.incident, each), 2000, 0).weights
        for each in (folder / "plan.csv", plan)
    ]
    assert weights[0] == pytest.approx(weights[1], rel=1e-3)


def test_csv_names_units_and_the_speed_of_each_leg(plan, folder):
    with open(folder / "plan.csv", encoding="utf-8", newline="") as file:
        table = [*csv.DictReader(file)]
    columns = "drone,waypoint,time_utc,latitude_deg,longitude_deg,altitude_m,speed_m_s,searching"
    assert [*table[0]] == [*columns.split(","), "order"]
    assert len(table) == sum(map(len, plan.flights))
    assert [row["order"] for row in table if row["order"]] == plan.orders
    assert {row["altitude_m"] for row in table} == {"80.0", "100.0", "120.0"}
    speeds = [float(row["speed_m_s"]) for row in table]
    assert sorted(speeds)[3] > 0 and max(speeds) < plan.incident.speed + 14


FLOWN = """\ufeffdrone,time_utc,battery,latitude_deg,longitude_deg
4,2026-03-01T08:30:00+02:00,98,54.18,7.85
1,2026-03-01T06:31:00Z,97,54.20,7.86
4,2026-03-01T06:30:10.500Z,96,54.19,7.85
"""


def test_flights_really_flown_need_few_columns(tmp_path):
    path = tmp_path / "flown.csv"
    path.write_text(FLOWN, "utf-8")
    start = datetime(2026, 3, 1, 6, 30, tzinfo=timezone.utc)
    lines = [[f"{path}, line 3"], [f"{path}, line 2", f"{path}, line 4"]]
    flights = [
        [Waypoint(start + timedelta(minutes=1), 54.20, 7.86, 0.0, True)],
        [
            Waypoint(start, 54.18, 7.85, 0.0, True),
            Waypoint(start + timedelta(seconds=10.5), 54.19, 7.85, 0.0, True),
        ],
    ]
    assert read_flights(path) == [*zip(lines, flights, (1, 4), strict=True)]


GOOD = "drone,time_utc,latitude_deg,longitude_deg,searching\n0,2026-03-01T06:30Z,54.18,7.85,TRUE\n"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("latitude_deg", "lat", "line 2: latitude_deg must be from -90 to 90, got 'no such column"),
        (",", ";", "line 2: drone must be a whole number of at least 0, got 'no such column'"),
        ("\n0,", "\n0.5,", "line 2: drone must be a whole number of at least 0, got '0.5'"),
        ("\n0,", "\n-1,", "line 2: drone must be a whole number of at least 0, got '-1'"),
        ("54.18", "54,18", r"line 2: searching must be true or false, got '7.85'"),
        ("54.18", "", "line 2: latitude_deg must be from -90 to 90, got ''"),
        ("54.18", "nan", "line 2: latitude_deg must be from -90 to 90, got 'nan'"),
        ("54.18", "97.85", "line 2: latitude_deg must be from -90 to 90, got '97.85'"),
        ("7.85", "187.85", "line 2: longitude_deg must be from -180 to 180, got '187.85'"),
        (":30Z", ":30", r"line 2: time_utc must be a time with its zone, such as .*Z, got '2026"),
        ("2026-03-01T", "", "line 2: time_utc must be a time with its zone"),
        ("TRUE", "maybe", "line 2: searching must be true or false, got 'maybe'"),
        ("TRUE", "TRUE\n0,2026-03-01T06:30Z,54.2,7.9,TRUE", "line 3: time_utc must increase"),
        (GOOD.splitlines()[1], "", "must hold waypoints, one per line, got none"),
    ],
)
def test_errors_name_file_line_and_column(old, new, message, tmp_path):
    path = tmp_path / "flown.csv"
    path.write_text(GOOD, "utf-8")
    assert len(read_flights(path)) == 1
    path.write_text(GOOD.replace(old, new), "utf-8")
    with pytest.raises(ValueError, match=rf"flown\.csv.*{message}"):
        read_flights(path)
