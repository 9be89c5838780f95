"""Missions that aircraft load: one for each drone, in the format of its autopilot; or routes."""

from __future__ import annotations

from pathlib import Path

from DroneSwarmSearch._internal.files import write_bytes, write_text
from DroneSwarmSearch.incident.files import mavlink, wpml
from DroneSwarmSearch.incident.files.gpx import gpx
from DroneSwarmSearch.incident.fleet import DJI, USUAL
from DroneSwarmSearch.incident.flight_plan import FlightPlan


def write(plan: FlightPlan, folder: Path) -> None:
    """Write drone1.plan and drone1.waypoints, or drone1.kmz for DJI; and those of all others.

    Boats and helicopters get a route, boat2.gpx or helicopter2.gpx.
    """
    for drone, craft in enumerate(plan.incident.craft):
        stem = f"drone{drone + 1}"
        if craft.aircraft in USUAL:
            write_bytes(folder / f"{craft.aircraft}{drone + 1}.gpx", gpx(plan, [drone]))
            continue
        if craft.aircraft == DJI:
            write_bytes(folder / f"{stem}.kmz", wpml.mission(plan, drone))
            continue
        items = mavlink.items_of(plan, drone)
        write_text(folder / f"{stem}.waypoints", mavlink.plain_text(plan, drone, items))
        write_text(folder / f"{stem}.plan", mavlink.qgroundcontrol(plan, drone, items))
