"""Missions for autopilots, read back as ground stations and aircraft read them."""

import io
import json
import math
import zipfile
from functools import cache
from typing import Any

import numpy as np
import pytest
import shapely
from lxml import etree
from pymavlink import mavwp

from DroneSwarmSearch.incident import FlightPlan, Incident, Waypoint, drone_in_wind, write
from DroneSwarmSearch.incident import plan as plan_flights

pytest.importorskip("cmaes")

pytestmark = pytest.mark.thorough

# Commands of MAVLink.
WAYPOINT = 16
RETURN = 20
LAND = 21
TAKE_OFF = 22
LOITER = 31
SPEED = 178
LANDING = 189

PLACES = {"north sea": (54.18, 7.85), "date line": (-17.0, 180.0)}


@cache
def planned(aircraft: str, place: str) -> FlightPlan:
    incident = Incident(
        position=PLACES[place],
        time="2026-03-01T05:30Z",
        object_class="LIFE-RAFT-SB-6",
        wind="300 20kn",
        current="160 0.5kn",
        endurance="25min",
        aircraft=aircraft,
        night=True,
    )
    return plan_flights(incident, seconds=0.1)


def away(latitude: float, longitude: float, waypoint: Waypoint) -> float:
    """The larger difference in degrees; -180 and 180 are the same."""
    across = (longitude - waypoint.longitude + 180) % 360 - 180
    return max(abs(across), abs(latitude - waypoint.latitude))


def loaded(path: Any) -> list[Any]:
    """The commands that pymavlink reads, without the base."""
    loader = mavwp.MAVWPLoader()
    assert loader.load(str(path)) > 3
    home, *items = [loader.wp(number) for number in range(loader.count())]
    assert (home.command, home.frame) == (WAYPOINT, 0)
    assert not any((home.param1, home.param2, home.param3, home.param4))
    return items


def seconds(flight: list[Waypoint]) -> np.ndarray:
    return np.array([(point.time - flight[0].time).total_seconds() for point in flight])


@pytest.mark.parametrize("place", PLACES)
def test_a_copter_keeps_the_times_of_the_plan_and_returns(place, tmp_path):
    plan = planned("copter", place)
    write(plan, tmp_path)
    for drone, flight in enumerate(plan.flights):
        items = loaded(tmp_path / f"drone{drone + 1}.waypoints")
        assert items[0].command == TAKE_OFF and items[-1].command == RETURN
        points = [item for item in items if item.command == WAYPOINT]
        for point, waypoint in zip(points, flight[1:], strict=True):
            assert (point.frame, point.autocontinue) == (3, 1)
            assert away(point.x, point.y, waypoint) < 1e-6
            assert point.z == waypoint.altitude
        assert away(points[-1].x, points[-1].y, flight[0]) < 1e-6, "home at its own height"

        # The times at these speeds, with climbs and turns: those of the plan.
        plane = plan.incident.plane
        metres = plane.metres(*np.array([point[1:3] for point in flight]).T)
        way = np.diff(metres, axis=0)
        length = np.hypot(*way.T)
        speeds = []
        speed = 0.0
        for item in items:
            if item.command == SPEED:
                assert item.param1 == 1, "over the ground"
                speed = item.param2
            elif item.command == WAYPOINT:
                speeds.append(speed)
        unit = way / length[:, None]
        turns = np.arccos(np.clip((unit[1:] * unit[:-1]).sum(axis=1), -1, 1)) / (math.pi / 2)
        climb = flight[0].altitude / plan.incident.climb
        flown = (length / speeds).sum() + plan.incident.turn * turns.sum() + 2 * climb
        assert flown == pytest.approx(seconds(flight)[-1], rel=0.01)


def test_a_plane_takes_off_steeply_and_lands_into_the_wind(tmp_path):
    plan = planned("plane", "north sea")
    write(plan, tmp_path)
    loiters = []
    for drone, flight in enumerate(plan.flights):
        items = loaded(tmp_path / f"drone{drone + 1}.waypoints")
        take_off, speed, *middle, landing, loiter, land = items
        assert (take_off.command, take_off.param1) == (TAKE_OFF, 15)
        assert (speed.command, speed.param1, speed.param2) == (SPEED, 0, plan.incident.speed)
        assert {item.command for item in middle} == {WAYPOINT}
        assert len(middle) == len(flight) - 1 and middle[-1].z == flight[0].altitude
        assert [item.command for item in (landing, loiter, land)] == [LANDING, LOITER, LAND]
        assert away(land.x, land.y, flight[-1]) < 1e-6 and land.z == 0
        metres = plan.incident.plane.metres(loiter.x, loiter.y)
        flying = drone_in_wind(plan.incident, drone)
        wind = flying.wind(np.zeros(1), np.zeros((2, 1)))[:, 0]
        way_in = flying.base - metres
        assert way_in @ wind < 0, "against the wind"
        assert 300 < np.hypot(*way_in) < 1500 and loiter.z < flight[0].altitude
        loiters.append(metres)
    for number, one in enumerate(loiters):
        for other in loiters[:number]:
            assert np.hypot(*(one - other)) > 2 * loiter.param2, "their circles do not meet"


FIELDS = {"autoContinue", "command", "doJumpId", "frame", "params", "type"}


@pytest.mark.parametrize(
    ("aircraft", "place", "kind"),
    [("copter", "north sea", 2), ("copter", "date line", 2), ("plane", "north sea", 1)],
)
def test_qgroundcontrol_reads_the_same_mission_with_a_fence(aircraft, place, kind, tmp_path):
    plan = planned(aircraft, place)
    write(plan, tmp_path)
    for drone, flight in enumerate(plan.flights, 1):
        whole = json.loads((tmp_path / f"drone{drone}.plan").read_text("utf-8"))
        assert (whole["fileType"], whole["version"]) == ("Plan", 1)
        assert whole["rallyPoints"] == {"version": 2, "points": []}
        mission = whole["mission"]
        assert mission["version"] == 2
        assert mission["vehicleType"] == kind
        assert mission["plannedHomePosition"][:2] == pytest.approx(plan.incident.base)
        items = mission["items"]
        read = loaded(tmp_path / f"drone{drone}.waypoints")
        assert [each["doJumpId"] for each in items] == [*range(1, len(read) + 1)]
        for item, other in zip(items, read, strict=True):
            assert set(item) >= FIELDS and item["type"] == "SimpleItem"
            assert (item["command"], item["frame"]) == (other.command, other.frame)
            assert len(item["params"]) == 7
            assert item["params"][4:] == pytest.approx([other.x, other.y, other.z], abs=1e-6)

        (fence,) = whole["geoFence"]["polygons"]
        assert fence["inclusion"] is True
        plane = plan.incident.plane
        area = shapely.Polygon([plane.metres(*corner) for corner in fence["polygon"]])
        positions = [item["params"][4:6] for item in items if item["frame"] == 3]
        for position in (*positions, *(point[1:3] for point in flight)):
            point = shapely.Point(plane.metres(*position))
            assert area.contains(point) and area.exterior.distance(point) > 100


# What DJI documents of its files, WPML 1.0.6: elements in any order, with their types and limits.
SCHEMA = """<xs:schema xmlns:xs="http://www.w3.org/2001/XMLSchema" elementFormDefault="qualified"
 targetNamespace="http://www.dji.com/wpmz/1.0.6" xmlns="http://www.dji.com/wpmz/1.0.6">
 <xs:simpleType name="speed"><xs:restriction base="xs:decimal">
  <xs:minInclusive value="1"/><xs:maxInclusive value="15"/></xs:restriction></xs:simpleType>
 <xs:simpleType name="height"><xs:restriction base="xs:decimal">
  <xs:minInclusive value="1.2"/><xs:maxInclusive value="1500"/></xs:restriction></xs:simpleType>
 <xs:element name="missionConfig"><xs:complexType><xs:all>
  <xs:element name="flyToWaylineMode"><xs:simpleType><xs:restriction base="xs:string">
   <xs:enumeration value="safely"/><xs:enumeration value="pointToPoint"/>
  </xs:restriction></xs:simpleType></xs:element>
  <xs:element name="finishAction"><xs:simpleType><xs:restriction base="xs:string">
   <xs:enumeration value="goHome"/><xs:enumeration value="noAction"/>
   <xs:enumeration value="autoLand"/><xs:enumeration value="gotoFirstWaypoint"/>
  </xs:restriction></xs:simpleType></xs:element>
  <xs:element name="exitOnRCLost"><xs:simpleType><xs:restriction base="xs:string">
   <xs:enumeration value="goContinue"/><xs:enumeration value="executeLostAction"/>
  </xs:restriction></xs:simpleType></xs:element>
  <xs:element name="executeRCLostAction"><xs:simpleType><xs:restriction base="xs:string">
   <xs:enumeration value="goBack"/><xs:enumeration value="landing"/>
   <xs:enumeration value="hover"/>
  </xs:restriction></xs:simpleType></xs:element>
  <xs:element name="takeOffSecurityHeight" type="height"/>
  <xs:element name="globalTransitionalSpeed" type="speed"/>
  <xs:element name="globalRTHHeight" type="height"/>
  <xs:element name="droneInfo"><xs:complexType><xs:all>
   <xs:element name="droneEnumValue" type="xs:integer"/>
   <xs:element name="droneSubEnumValue" type="xs:integer"/>
  </xs:all></xs:complexType></xs:element>
  <xs:element name="payloadInfo"><xs:complexType><xs:all>
   <xs:element name="payloadEnumValue" type="xs:integer"/>
   <xs:element name="payloadSubEnumValue" type="xs:integer"/>
   <xs:element name="payloadPositionIndex" type="xs:integer"/>
  </xs:all></xs:complexType></xs:element>
 </xs:all></xs:complexType></xs:element>
</xs:schema>"""

KML = "{http://www.opengis.net/kml/2.2}"
WPML = "{http://www.dji.com/wpmz/1.0.6}"

OF_A_WAYPOINT = {
    "index": int,
    "executeHeight": float,
    "waypointSpeed": float,
    "waypointHeadingParam": str,
    "waypointTurnParam": str,
    "useStraightLine": int,
}


def test_dji_flies_waylines_within_its_limits(tmp_path):
    plan = planned("dji", "date line")
    write(plan, tmp_path)
    assert not [*tmp_path.glob("*.plan")]
    schema = etree.XMLSchema(etree.fromstring(SCHEMA))
    heights = []
    for drone, flight in enumerate(plan.flights):
        content = (tmp_path / f"drone{drone + 1}.kmz").read_bytes()
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            assert archive.namelist() == ["wpmz/template.kml", "wpmz/waylines.wpml"]
            template, waylines = (etree.fromstring(archive.read(n)) for n in archive.namelist())
        for root in (template, waylines):
            configuration = root.find(f"{KML}Document/{WPML}missionConfig")
            schema.assertValid(etree.ElementTree(configuration))
        heights.append(configuration.findtext(f"{WPML}globalRTHHeight"))
        folder = waylines.find(f"{KML}Document/{KML}Folder")
        assert folder.findtext(f"{WPML}executeHeightMode") == "relativeToStartPoint"
        marks = folder.findall(f"{KML}Placemark")
        assert len(template.findall(f".//{KML}Placemark")) == len(marks) == len(flight) - 1
        for index, (mark, waypoint) in enumerate(zip(marks, flight[1:], strict=True)):
            values = {
                name: kind(mark.findtext(f"{WPML}{name}")) for name, kind in OF_A_WAYPOINT.items()
            }
            assert (values["index"], values["executeHeight"]) == (index, waypoint.altitude)
            assert 1 <= values["waypointSpeed"] <= 15
            longitude, latitude = map(
                float, mark.findtext(f"{KML}Point/{KML}coordinates").split(",")
            )
            assert away(latitude, longitude, waypoint) < 1e-6
        assert max(plan.ground_speeds(drone)) <= 15.001
    assert len(set(heights)) == len(plan.flights)
    assert "at most 15 m/s (29 kn) over the ground" in " ".join(plan.assumptions)


def test_an_unknown_aircraft_is_refused():
    with pytest.raises(
        ValueError,
        match=r"aircraft must be one of 'copter', 'plane', 'dji', 'helicopter', 'boat', got",
    ):
        planned("balloon", "north sea")
