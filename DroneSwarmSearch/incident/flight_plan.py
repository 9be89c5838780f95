"""A plan that drones can fly: how it is made, and its files."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from datetime import timedelta
from pathlib import Path
from typing import Any

from DroneSwarmSearch._internal.files import write_text
from DroneSwarmSearch._internal.progress import progress
from DroneSwarmSearch.incident import chart, files, missions
from DroneSwarmSearch.incident.choice import Area, Guess, choose
from DroneSwarmSearch.incident.flights import Waypoint
from DroneSwarmSearch.incident.plan_folder import INCIDENT, replace_plan
from DroneSwarmSearch.incident.planned_flights import PlannedFlights
from DroneSwarmSearch.incident.report import APART, Report

FEW, MANY = 2_000, 8_000  # particles for the first choice of patterns, and to improve them


class FlightPlan(PlannedFlights):
    """The flights of all drones, from take-off to landing.

    Each drone flies a search pattern until it must return. It searches from the commence search
    point to the landing, also on its way back. Drones fly at heights of their own.

    Attributes:
        incident: the incident.
        patterns: one for each drone.
        flights: the waypoints of each drone, in the order of their times.
        guesses: the patterns relative to the area.
    """

    @classmethod
    def of(cls, incident: Report, near: Sequence[Guess] = ()) -> FlightPlan:
        """Plan an incident, quickly if it begins near the patterns of another plan."""
        many = incident.particles(FEW if near else MANY, 1)
        weights = many.weights[:FEW] / many.weights[:FEW].sum()
        few = replace(many, positions=many.positions[..., :FEW], weights=weights)
        areas = [Area(incident, cloud) for cloud in ([few] if near else [few, many, many])]
        with progress("planning", 1.0) as bar:
            guesses = choose(areas, near, bar)
        patterns = tuple(map(areas[-1].pattern, guesses))
        flights = []
        for number, (drone, pattern) in enumerate(zip(areas[0].drones, patterns, strict=True)):
            flown = drone.fly(pattern)
            assert flown is not None
            degrees = incident.plane.degrees(flown[:, 1:]).tolist()
            times = [incident.start + timedelta(seconds=second) for second in flown[:, 0].tolist()]
            height, last = incident.altitude + APART * number, len(flown) - 1
            rows = enumerate(zip(times, degrees, strict=True))
            flights.append(
                [Waypoint(t, lat, lon, height, 0 < n < last) for n, (t, (lat, lon)) in rows]
            )
        return cls(incident, patterns, tuple(flights), tuple(guesses))

    def with_changes(self, **values: Any) -> FlightPlan:
        """A quick plan for the incident with other values, which begins with these patterns."""
        return self.of(replace(self.incident, **values), self.guesses)

    def save(self, folder: str | os.PathLike[str]) -> list[str]:
        """Write the plan to a folder: files for autopilots and people, a map, and the incident.

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

        def write(spare: Path) -> None:
            files.save(self, spare)
            missions.save(self, spare)
            chart.save(self, spare)
            write_text(spare / INCIDENT, self.incident.as_json(where))

        return replace_plan(where, write)
