"""Missions for DJI's aircraft: archives of WPML 1.0.6, for DJI Pilot 2 and FlightHub 2.

DJI's Cloud API, "WPML": "Template.kml", "Waylines.wpml" and "Common elements". The files name the
Mavic 3T; Pilot 2 offers to change that when it imports them for another aircraft.
"""

from __future__ import annotations

import io
import xml.etree.ElementTree as ET
import zipfile
from typing import Any

from DroneSwarmSearch.incident.files.lines import lengths
from DroneSwarmSearch.incident.files.xml import add, as_bytes
from DroneSwarmSearch.incident.flight_plan import FlightPlan

NAMESPACE = "http://www.dji.com/wpmz/1.0.6"
AUTHOR = "DroneSwarmSearch"

MAVIC_3T = {"droneEnumValue": 77, "droneSubEnumValue": 1}
ITS_CAMERA = {"payloadEnumValue": 67, "payloadSubEnumValue": 0, "payloadPositionIndex": 0}

STOP_AND_TURN = "toPointAndStopWithDiscontinuityCurvature"
LEAST_SPEED = 1.0  # m/s; WPML allows no lower one

SAVED = (1980, 1, 1, 0, 0, 0)  # the time of files in an archive, so that equal plans are equal


def mission(plan: FlightPlan, drone: int) -> bytes:
    """The archive with the mission of a drone."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, root in (
            ("wpmz/template.kml", _template(plan, drone)),
            ("wpmz/waylines.wpml", _waylines(plan, drone)),
        ):
            archive.writestr(zipfile.ZipInfo(name, SAVED), as_bytes(root))
    return content.getvalue()


def _template(plan: FlightPlan, drone: int) -> ET.Element:
    """What Pilot 2 shows and edits."""
    root, document = _document()
    milliseconds = round(plan.incident.began.timestamp() * 1000)
    _add(document, author=AUTHOR, createTime=milliseconds, updateTime=milliseconds)
    document.append(_configuration(plan, drone))
    flight = plan.flights[drone]
    folder = ET.SubElement(document, "Folder")
    _add(
        folder,
        templateType="waypoint",
        templateId=0,
        waylineCoordinateSysParam={
            "coordinateMode": "WGS84",
            "heightMode": "relativeToStartPoint",
        },
        autoFlightSpeed=f"{_fastest(plan, drone):g}",
        globalHeight=f"{flight[0].altitude:g}",
        gimbalPitchMode="manual",
        globalWaypointHeadingParam=_heading(),
        globalWaypointTurnMode=STOP_AND_TURN,
        globalUseStraightLine=1,
    )
    for index, speed in enumerate(_speeds(plan, drone)):
        placemark = _placemark(plan, drone, index)
        _add(
            placemark,
            index=index,
            height=f"{flight[index + 1].altitude:g}",
            useGlobalHeight=1,
            useGlobalSpeed=0,
            waypointSpeed=f"{speed:.1f}",
            useGlobalHeadingParam=1,
            useGlobalTurnParam=1,
        )
        folder.append(placemark)
    return root


def _waylines(plan: FlightPlan, drone: int) -> ET.Element:
    """What the aircraft flies."""
    root, document = _document()
    document.append(_configuration(plan, drone))
    flight = plan.flights[drone]
    seconds = (flight[-1].time - flight[1].time).total_seconds()
    folder = ET.SubElement(document, "Folder")
    _add(
        folder,
        templateId=0,
        executeHeightMode="relativeToStartPoint",
        waylineId=0,
        distance=f"{lengths(plan, flight[1:]).sum():.0f}",
        duration=f"{seconds:.0f}",
        autoFlightSpeed=f"{_fastest(plan, drone):g}",
    )
    for index, speed in enumerate(_speeds(plan, drone)):
        placemark = _placemark(plan, drone, index)
        _add(
            placemark,
            index=index,
            executeHeight=f"{flight[index + 1].altitude:g}",
            waypointSpeed=f"{speed:.1f}",
            waypointHeadingParam=_heading(),
            waypointTurnParam={"waypointTurnMode": STOP_AND_TURN, "waypointTurnDampingDist": 0},
            useStraightLine=1,
        )
        folder.append(placemark)
    return root


def _document() -> tuple[ET.Element, ET.Element]:
    root = ET.Element("kml", {"xmlns": "http://www.opengis.net/kml/2.2", "xmlns:wpml": NAMESPACE})
    return root, ET.SubElement(root, "Document")


def _configuration(plan: FlightPlan, drone: int) -> ET.Element:
    """What holds for the whole mission: it climbs to its own height first, and returns there."""
    height = f"{plan.flights[drone][0].altitude:g}"
    configuration = ET.Element("wpml:missionConfig")
    _add(
        configuration,
        flyToWaylineMode="safely",
        finishAction="goHome",
        exitOnRCLost="executeLostAction",
        executeRCLostAction="goBack",
        takeOffSecurityHeight=height,
        globalTransitionalSpeed=f"{max(plan.ground_speeds(drone)[0], LEAST_SPEED):.1f}",
        globalRTHHeight=height,
        droneInfo=MAVIC_3T,
        payloadInfo=ITS_CAMERA,
    )
    return configuration


def _fastest(plan: FlightPlan, drone: int) -> float:
    """The speed where no other one is given."""
    craft = plan.incident.craft[drone]
    return min(craft.speed, craft.fastest_over_ground)


def _speeds(plan: FlightPlan, drone: int) -> list[float]:
    """The speed from each waypoint after the take-off to the next one, over the ground."""
    _, *speeds = plan.ground_speeds(drone)
    return [max(speed, LEAST_SPEED) for speed in (*speeds, speeds[-1])]


def _placemark(plan: FlightPlan, drone: int, index: int) -> ET.Element:
    """The position of a waypoint; the first one is that after the take-off."""
    waypoint = plan.flights[drone][index + 1]
    placemark = ET.Element("Placemark")
    coordinates = f"{waypoint.longitude:.7f},{waypoint.latitude:.7f}"
    add(placemark, "Point", coordinates=coordinates)
    return placemark


def _heading() -> dict[str, Any]:
    return {"waypointHeadingMode": "followWayline"}


def _add(parent: ET.Element, **children: Any) -> None:
    """Add elements of WPML: texts, or elements as dicts."""
    for name, child in children.items():
        element = ET.SubElement(parent, f"wpml:{name}")
        if isinstance(child, dict):
            _add(element, **child)
        else:
            element.text = str(child)
