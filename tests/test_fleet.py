"""Fleets: unlike drones, ships as bases, helicopters and boats, and what each of them sees."""

import json
from datetime import datetime, timedelta, timezone

import numpy as np
import pytest

from DroneSwarmSearch.cli import main
from DroneSwarmSearch.commands.plan import summary
from DroneSwarmSearch.geo import KNOT, TangentPlane
from DroneSwarmSearch.incident import (
    Drone,
    FlownFlight,
    Incident,
    after,
    drone_in_wind,
    plan,
    simulate,
    write,
)
from DroneSwarmSearch.incident.sweep_widths import DETECTION, sweep_width

pytest.importorskip("cmaes")

pytestmark = pytest.mark.thorough

TIME = datetime(2026, 3, 1, 5, 30, tzinfo=timezone.utc)
KNOWN = {
    "position": (54, 7),
    "time": TIME,
    "object_class": {"PIW-1": 0.5, "SKIFF-1": 0.5},
    "wind": "300 20kn",
    "current": "160 0.5kn",
    "coast": "none",
    "endurance": "30 min",
}
SHIP = {"base": (54.05, 7.0), "base_course": "S", "base_speed": "10kn", "base_time": "06:30Z"}
MIXED = [
    {"name": "Alpha", "speed": "25 m/s", "swath": {"PIW-1": 100, "SKIFF-1": 300}},
    {"name": "Bravo", **SHIP, "take_off": "06:40Z"},
    {"aircraft": "helicopter", "endurance": "1h", "base": (54.1, 7.1)},
    {"aircraft": "boat", "endurance": "1h", "swath": "400m", "probability_of_detection": 0.9},
]


@pytest.fixture(scope="module")
def mixed():
    return plan(Incident(**KNOWN, fleet=MIXED), seconds=3)


def test_drones_take_from_the_incident_what_they_do_not_state():
    incident = Incident(**KNOWN, fleet=MIXED, swath=250, altitude=60)
    alpha, bravo, helicopter, boat = incident.craft
    assert (alpha.name, alpha.speed, alpha.endurance, alpha.reserve) == ("Alpha", 25.0, 1800, 360)
    assert alpha.base == (54, 7)
    assert alpha.take_off == TIME + timedelta(hours=1)
    assert (bravo.swath, bravo.speed, bravo.altitude) == (250.0, 20.0, 80.0)
    assert bravo.take_off == TIME + timedelta(minutes=70)
    assert (helicopter.name, helicopter.altitude) == ("3", pytest.approx(152.4))
    assert helicopter.speed == pytest.approx(90 * KNOT)
    assert helicopter.reserve == 720
    assert (boat.altitude, boat.swath, boat.probability_of_detection) == (0.0, 400.0, 0.9)
    assert incident.start == TIME + timedelta(hours=1)
    assert incident.landed == incident.start + timedelta(minutes=48)


def test_a_fleet_of_equal_drones_is_their_number():
    alike = Incident(**KNOWN, fleet=[{}, Drone()])
    same = Incident(**KNOWN, drones=2)
    assert alike.craft == same.craft
    assert plan(alike, seconds=1).probability_of_success == pytest.approx(
        plan(same, seconds=1).probability_of_success, abs=0.05
    )


def test_every_drone_flies_as_it_can(mixed):
    incident = mixed.incident
    for number, (drone, flight) in enumerate(zip(incident.craft, mixed.flights, strict=True)):
        assert flight[0].time >= drone.take_off
        assert flight[-1].time - flight[0].time <= timedelta(seconds=drone.airborne + 1)
        assert {point.altitude for point in flight} == {drone.altitude}
        flying = drone_in_wind(incident, number)
        if drone.is_boat:
            assert flying.wind(np.zeros(1), np.zeros((2, 1)))[:, 0] == pytest.approx(
                incident.current.velocity(0.0, np.zeros((2, 1)))[:, 0]
            )
        fastest = drone.speed + 15
        assert max(mixed.ground_speeds(number)) <= fastest


def test_a_drone_lands_where_its_ship_is(mixed):
    flight = mixed.flights[1]
    plane = TangentPlane(54.05, 7.0)
    for point in (flight[0], flight[-1]):
        east, north = plane.metres(point.latitude, point.longitude)
        minutes = (point.time - TIME - timedelta(hours=1)).total_seconds() / 60
        assert north == pytest.approx(-10 * 1852 / 60 * minutes, abs=5)
        assert east == pytest.approx(0, abs=5)


def test_what_a_drone_sees_depends_on_the_object():
    """Of skiffs, a strip that is three times as wide, and nine in ten of them."""
    values = {**KNOWN, "swath": "PIW-1:100m; SKIFF-1:300m"}
    incident = Incident(
        **{**values, "probability_of_detection": {"PIW-1": 0.5, "SKIFF-1": 0.9}}, drones=1
    )
    cloud = simulate(incident, 20_000, 0)
    leg = np.array([[[3600.0, -9000.0, 0.0], [3605.0, 9000.0, 0.0]]])
    missed = cloud.missed(leg, incident.craft[0])
    north = cloud.at(3602)[:, 1]
    for number, (half, detection) in enumerate(((50, 0.5), (150, 0.9))):
        mine = cloud.kinds == number
        assert set(missed[mine].round(6)) == {1.0, round(1 - detection, 6)}
        near = np.abs(north[mine]) < 0.9 * half
        far = np.abs(north[mine]) > 1.2 * half + 10
        assert np.all(missed[mine][near] < 1) and np.all(missed[mine][far] == 1)
    made = plan(incident, seconds=1)
    person, skiff = made.parts
    assert skiff.probability_of_success > person.probability_of_success + 0.05
    assert "100 m (PIW-1), 300 m (SKIFF-1)" in " ".join(made.assumptions)


def test_flights_keep_what_each_drone_saw(mixed):
    second = after(mixed.incident, mixed)
    for flight, drone in zip(second.flown, mixed.incident.craft, strict=True):
        assert (flight.swath, flight.probability_of_detection) == (
            drone.swath,
            drone.probability_of_detection,
        )
    found = simulate(second, 25_000, 0).found
    assert found == pytest.approx(mixed.probability_of_success, abs=0.03)
    waypoints = second.flown[0].waypoints
    assert isinstance(FlownFlight(waypoints, {"PIW-1": 100.0}, 0.5).swath, tuple)


@pytest.mark.parametrize(
    ("object_class", "wind", "speed", "miles"),
    [
        ("PIW-1", 5, 90, 0.1),
        ("PIW-3", 10, 90, 0.05),
        ("PIW-6", 15, 60, 0.0375),
        ("LIFE-RAFT-DB-18", 5, 90, 3.3),
        ("FISHING-VESSEL-1", 15, 90, 6.2 * 0.9),
    ],
)
def test_sweep_widths_of_helicopters_are_those_of_the_tables(object_class, wind, speed, miles):
    width = sweep_width(
        "helicopter", object_class, visibility=18_520, wind=wind, speed=speed * KNOT
    )
    assert width == pytest.approx(miles * 1852)


def test_helicopters_and_boats_see_by_the_tables():
    craft = [{"aircraft": "helicopter"}, {"aircraft": "boat"}]
    known = {name: value for name, value in KNOWN.items() if name != "endurance"}
    incident = Incident(**known, fleet=craft, visibility="5NM")
    for drone in incident.craft:
        assert drone.probability_of_detection == DETECTION
        widths = dict(drone.swath)
        expected = sweep_width(
            drone.aircraft, "SKIFF-1", visibility=5 * 1852, wind=20 * KNOT, speed=drone.speed
        )
        assert widths["SKIFF-1"] == pytest.approx(expected / DETECTION)
        assert widths["SKIFF-1"] > widths["PIW-1"]
    debris = {**known, "object_class": "FV-DEBRIS"}
    with pytest.raises(ValueError, match="swath must be given for FV-DEBRIS: the tables"):
        Incident(**debris, fleet=craft)


def test_orders_and_files_are_after_their_kind(mixed, tmp_path):
    text = " ".join(summary(mixed))
    assert "2 drones, 1 helicopter and 1 boat from 06:30" in text
    alpha, _, helicopter, boat = mixed.orders
    assert alpha.startswith("Alpha: ")
    assert helicopter.startswith("Helicopter 3: ")
    assert " height 152 m," in helicopter and "height" not in boat
    assert "Boat 4: 10 m/s (20 kn), current 0.26 m/s (0.5 kn), at most 48 min" in text
    write(mixed, tmp_path)
    names = {path.name for path in tmp_path.iterdir()}
    assert names >= {"drone1.plan", "drone2.plan", "helicopter3.gpx", "boat4.gpx"}
    assert not names & {"drone3.plan", "drone4.plan"}
    last = (tmp_path / "drone2.waypoints").read_text("utf-8").splitlines()[-1].split("\t")
    assert last[3] == "21", "it lands on its ship, and does not return to where it took off"
    assert Incident.read(tmp_path / "incident.json").craft == mixed.incident.craft


def test_a_fleet_is_a_table(tmp_path, capsys):
    table = tmp_path / "fleet.csv"
    table.write_text(
        "name,aircraft,speed,swath,take_off\n"
        "Alpha,plane,30 m/s,PIW-1:100m; SKIFF-1:300m,\n"
        "Bravo,,,,06:45Z\n",
        "utf-8",
    )
    options = ["--position", "54", "7", "--time", "2026-03-01T05:30Z", "--wind", "300", "20kn"]
    options += ["--object", "PIW-1:1", "--object", "SKIFF-1:1", "--coast", "none"]
    options += ["--seconds", "1", "--no-alternatives", "--endurance", "30min"]
    out = tmp_path / "plan"
    main(["plan", *options, "--fleet", str(table), "--out", str(out)])
    text = " ".join(capsys.readouterr().out.split())
    assert "Alpha: " in text and "Bravo: " in text
    alpha, bravo = Incident.read(out / "incident.json").craft
    assert (alpha.aircraft, alpha.speed) == ("plane", 30.0)
    assert f"{bravo.take_off:%H:%M}" == "06:45"
    rows = json.loads((out / "incident.json").read_text("utf-8"))["fleet"]
    assert [row["name"] for row in rows] == ["Alpha", "Bravo"]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"fleet": [{"speeed": 3}]}, "speeed"),
        ({"fleet": [{"speed": "-3m/s"}]}, r"fleet\[0\]: speed: "),
        ({"aircraft": "helicopter", "speed": 30}, "aircraft must be .* a helicopter is a row of a"),
        ({"fleet": "no.csv"}, "there is no 'no.csv'"),
        ({"fleet": [{}, {}], "drones": 3}, "drones cannot be given together with fleet"),
        ({"fleet": [{"speed": 30}], "speed": 25}, "speed cannot be given together with a fleet"),
        ({"fleet": [{"take_off": "06:40Z"}], "start": "06:50Z"}, "start cannot be given together"),
        ({"visibility": "5NM"}, "visibility matters only for helicopters and boats"),
        ({"visibility": "5NM", "fleet": [{"name": "A"}]}, "visibility matters only"),
        (
            {"visibility": "5NM", "fleet": [{"aircraft": "boat", "swath": 900}]},
            "visibility matters",
        ),
        ({"fleet": [{"name": "A"}, {"name": "A"}]}, "fleet must have different names"),
        ({"fleet": [{"base_speed": 3}]}, "base_course must be given with base_speed"),
        ({"fleet": [{"base_speed": 3, "base_course": 5}]}, "base_time, when the ship is at base"),
        ({"fleet": [{"base": (58, 7)}]}, "base of 1 must be within 100 km"),
        ({"fleet": [{"take_off": "2026-03-01T05:00Z"}]}, "take_off of 1 must not be before time"),
        ({"fleet": [{"reserve": "50min"}]}, "reserve must be less than the endurance"),
        ({"fleet": [{"swath": {"PIW-1": 100}}]}, "swath must also be given for SKIFF-1"),
        ({"swath": {"PIW-1": 9, "SKIFF-1": 9, "PIW-2": 9}}, "swath is given for PIW-2, which no"),
        ({"probability_of_detection": {"PIW-1": 2}}, "probability_of_detection for PIW-1 must be"),
    ],
)
def test_what_no_fleet_can_do_is_refused(changes, message):
    with pytest.raises((TypeError, ValueError), match=message):
        Incident(**{**KNOWN, **changes})


@pytest.mark.parametrize(
    ("values", "heights"),
    [
        ({"drones": 3, "floor": "60m"}, (80, 100, 120)),
        ({"drones": 6, "floor": "60m"}, (60, 80, 100, 120, 60, 80)),
        ({"drones": 2, "floor": "150m"}, (150, 150)),
        ({"fleet": [{"altitude": 70}, {}, {}], "floor": 40}, (70, 100, 120)),
    ],
)
def test_drones_fly_between_the_floor_and_the_ceiling(values, heights):
    assert Incident(**{**KNOWN, **values}).heights == pytest.approx(heights)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"floor": 90, "altitude": 80}, "floor must be at most the altitude and the ceiling, 80 m"),
        ({"floor": 130, "ceiling": 120}, "floor must be at most the altitude and the ceiling, 120"),
        ({"fleet": [{"altitude": 150}]}, "altitude of 1 must be from the floor, 20 m, to the ceil"),
    ],
)
def test_heights_that_contradict_each_other_are_refused(values, message):
    with pytest.raises(ValueError, match=message):
        Incident(**{**KNOWN, **values})


def test_unlike_drones_find_more_together_than_one_of_them(mixed):
    """Each flies where it finds most, given the others."""
    alone = [
        plan(Incident(**known_for(drone), fleet=[drone]), seconds=1).probability_of_success
        for drone in (MIXED[0], MIXED[2])
    ]
    assert mixed.probability_of_success > max(alone) + 0.05


def known_for(drone):
    """What the incident states, without what the drone does."""
    return {name: value for name, value in KNOWN.items() if name not in drone}


def test_a_drone_that_cannot_search_is_named():
    far = {"name": "Bravo", "base": (54.5, 7.0)}
    with pytest.raises(ValueError, match=r"(speed|endurance) of Bravo must"):
        plan(Incident(**KNOWN, fleet=[{}, far]), seconds=1)


def test_another_fleet_forgets_what_only_the_first_one_took():
    first = [{"name": "A"}, {"name": "B", "aircraft": "boat"}]
    incident = Incident(**{**KNOWN, "endurance": "50min"}, fleet=first, visibility="5NM")
    again = incident.changed(fleet=[{"name": "C", "endurance": "30min"}])
    assert again.visibility == Incident(**KNOWN).visibility
    assert [each.endurance for each in again.craft] == [1800.0]
    with pytest.raises(ValueError, match="endurance cannot be given together with a fleet"):
        incident.changed(fleet=[{"name": "C", "endurance": "30min"}], endurance="40min")
