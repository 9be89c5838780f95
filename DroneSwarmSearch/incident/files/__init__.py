"""The files of a flight plan, for autopilots and people."""

from __future__ import annotations

import os
from pathlib import Path

from DroneSwarmSearch._internal.files import write_bytes, write_text
from DroneSwarmSearch.incident.files import chart, missions
from DroneSwarmSearch.incident.files.csv_table import csv_table
from DroneSwarmSearch.incident.files.folder import INCIDENT, replace_plan
from DroneSwarmSearch.incident.files.geojson import geojson
from DroneSwarmSearch.incident.files.gpx import gpx
from DroneSwarmSearch.incident.files.html_page import html_page
from DroneSwarmSearch.incident.files.kml import kml, overlays_of
from DroneSwarmSearch.incident.files.log_page import log_page
from DroneSwarmSearch.incident.flight_plan import FlightPlan

__all__ = ["write"]


def write(plan: FlightPlan, folder: str | os.PathLike[str]) -> list[str]:
    """Write a plan to a folder: files for autopilots and people, a map, and the incident.

    The folder then holds this plan alone: files of an earlier plan are removed once all new
    ones are complete.

    Returns:
        The names of files in the folder that no plan has written; they are left.

    Raises:
        ImportError: Matplotlib is missing.
        OSError: a file cannot be written. The folder stays as it was.
        ValueError: a file there has a name that the plan needs, but no plan has written it.
    """
    where = Path(folder)

    def write_all(spare: Path) -> None:
        overlays = overlays_of(plan)
        for overlay in overlays:
            write_bytes(spare / overlay.name, overlay.png)
        write_bytes(spare / "plan.gpx", gpx(plan))
        write_bytes(spare / "plan.kml", kml(plan, overlays))
        write_text(spare / "plan.geojson", geojson(plan))
        write_text(spare / "plan.csv", csv_table(plan))
        write_text(spare / "plan.html", html_page(plan))
        write_text(spare / "log.html", log_page(plan))
        missions.write(plan, spare)
        chart.write(plan, spare)
        write_text(spare / INCIDENT, plan.incident.as_json(where))

    return replace_plan(where, write_all)
