"""Missions that aircraft load: one for each drone, in the format of its autopilot."""

from __future__ import annotations

from pathlib import Path

from DroneSwarmSearch._internal.files import write_bytes, write_text
from DroneSwarmSearch.incident.files import mavlink, wpml
from DroneSwarmSearch.incident.flight_plan import FlightPlan
from DroneSwarmSearch.incident.incident import DJI


def write(plan: FlightPlan, folder: Path) -> None:
    """Write drone1.plan and drone1.waypoints, or drone1.kmz for DJI; and those of all others."""
    for drone in range(len(plan.flights)):
        stem = f"drone{drone + 1}"
        if plan.incident.aircraft == DJI:
            write_bytes(folder / f"{stem}.kmz", wpml.mission(plan, drone))
            continue
        items = mavlink.items_of(plan, drone)
        write_text(folder / f"{stem}.waypoints", mavlink.plain_text(plan, drone, items))
        write_text(folder / f"{stem}.plan", mavlink.qgroundcontrol(plan, drone, items))
