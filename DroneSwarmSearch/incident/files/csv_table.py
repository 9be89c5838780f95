"""CSV: a row for each waypoint, which `flights.read_flights` reads again."""

from __future__ import annotations

import csv
import io

import numpy as np

from DroneSwarmSearch._internal.files import csv_cell
from DroneSwarmSearch.incident.files.lines import lengths, utc
from DroneSwarmSearch.incident.flight_plan import FlightPlan

COLUMNS = (
    "drone",
    "waypoint",
    "time_utc",
    "latitude_deg",
    "longitude_deg",
    "altitude_m",
    "speed_m_s",
    "searching",
    "order",
)


def csv_table(plan: FlightPlan) -> str:
    """The content of plan.csv; speed and searching are those of the leg that begins there."""
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(COLUMNS)
    for drone, (flight, order) in enumerate(zip(plan.flights, plan.orders, strict=True), 1):
        seconds = np.diff([waypoint.time.timestamp() for waypoint in flight])
        speeds = [*(lengths(plan, flight) / seconds), 0.0]
        for number, (point, speed) in enumerate(zip(flight, speeds, strict=True)):
            row = (
                drone,
                number,
                utc(point.time),
                f"{point.latitude:.7f}",
                f"{point.longitude:.7f}",
                point.altitude,
                f"{speed:.2f}",
                point.searching,
                csv_cell(order) if number == 0 else "",
            )
            rows.writerow(row)
    return text.getvalue()
