"""Incidents: from what is known to flights, to files, and to a search on a grid."""

from __future__ import annotations

import os
from dataclasses import fields
from datetime import datetime
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.arrays import Floats
from DroneSwarmSearch.core.named_search import NamedSearch
from DroneSwarmSearch.core.scenario import Scenario
from DroneSwarmSearch.incident import files
from DroneSwarmSearch.incident.flight_plan import FlightPlan
from DroneSwarmSearch.incident.on_grid import GridSearch
from DroneSwarmSearch.incident.report import Report


class Incident(Report):
    """What a rescue centre knows: who drifts, where they were last seen, and which drones can fly.

    Positions are (latitude, longitude) in degrees, or text such as ("54-10.8N", "007-51.0E");
    lengths are in metres, durations in seconds and speeds in m/s, or text with units, such as
    "20 kn", "0.5 NM" and "45 min". Times are datetimes with a time zone, or text such as
    "2026-03-01T05:30Z".

    Attributes:
        position: the last known position.
        time: when the person was there.
        position_sd: its standard deviation along each axis; 926 m, half a nautical mile, is usual
            for a position reported by an aircraft, and tens of metres for GPS.
        object_class: a key of `leeway.CLASSES`, such as "PIW-1", a person in the water.
        wind: where it comes from and its speed, at 10 m: "300 25kn", or "NW 12 m/s"; or (east,
            north), where it blows to. One that changes is a list of texts with times, such as
            ["300 25kn", "320 30kn@08:00Z"], a mapping of seconds after `time` to winds, or a CSV
            file with the columns time, direction and speed. Between times it is interpolated. Or
            the NetCDF file of a weather model, .nc, with a field by CF standard name.
        current: in the forms of the wind, but the direction is where it flows to. Where the file of
            an ocean model has no values, there is land, on which persons strand.
        wind_error: the standard deviation along each axis of the error of the wind, constant in an
            incident. By default 2 m/s, the target accuracy of satellite winds (EUMETSAT OSI SAF,
            wind products); forecasts are no better.
        current_error: the standard deviation of the error of the current. By default 0.13 m/s: a
            probable error of 0.3 kn, which the IAMSAR Manual (volume II, appendix K) takes where
            none is known, divided by 1.18.
        tracks: a file of a drift simulation, see `Tracks.read`, in place of class and current;
            `wind` is then only that on the drones, by default none. Position and time are by
            default the mean of its first positions, and when.
        start: when the drones take off, at most 72 hours after `time`; by default an hour after
            it. Of a time of the clock, such as "06:00Z", the nearest to `time` counts, here and
            where a wind or a current changes.
        drones: how many.
        speed: their airspeed, at most 200 m/s.
        swath: the width of the strip that a drone sees, from 1 m to 10 km.
        probability_of_detection: that a drone which flies over the person, within the strip, finds
            the person; from 0 to 1.
        endurance: of a drone, from take-off to landing; at most 12 hours.
        reserve: what must be left of the endurance at the landing.
        base: where the drones take off and land; by default the last known position.
        altitude: of the first drone above the sea; each further one flies 20 m higher.
        turn: seconds in which a drone turns by a right angle.
        flown: earlier flights that found nobody, each a `FlownFlight`, see `after`; or the
            waypoints of a flight, flown with this swath and probability of detection.

    Raises:
        ImportError: `tracks` needs netCDF4.
        TypeError: a value is of the wrong type.
        ValueError: a value is out of its limits.
    """

    # Plans.

    def plan(self) -> FlightPlan:
        """Plan the flights of all drones: out, a search pattern, and back.

        Raises:
            ImportError: the package cmaes, of the extra "plan", is missing.
            ValueError: the drones cannot fly in that wind, or not reach the area and return.
        """
        return FlightPlan.of(self)

    def after(
        self,
        flown: FlightPlan | str | os.PathLike[str],
        at: datetime | str | None = None,
        **changes: Any,
    ) -> Incident:
        """The incident after flights that found nobody: its map is the posterior.

        What was flown never changes: each flight keeps the swath and the probability of detection
        with which it was flown, and was flown in the wind of this incident. With a later report,
        a new `time`, persons drift from there, and flights count from that time on.

        Args:
            flown: a plan that was flown, or a CSV file of what was really flown, such as the
                `plan.csv` of a plan; the columns are drone, time_utc, latitude_deg, longitude_deg
                and optionally searching.
            at: when the first drone takes off again, `start`; by default half an hour after the
                last one has landed, or at a later `time`.
            changes: other values of the incident for the next flights. A wind or a current without
                a time holds from the last landing on.

        Raises:
            OSError: there is no such file.
            TypeError, ValueError: the file or a value is unsuitable, or drones cannot have flown
                so: farther than they can be, faster than 1.5 times their airspeed plus the wind,
                before the last report or days after it. Names the row.
        """
        known = [field.name for field in fields(Incident) if field.name not in ("start", "flown")]
        checks.known_keys("changes", changes, known)
        if isinstance(flown, (str, os.PathLike)):
            flights = files.read_csv(Path(flown))
        else:
            flights = [
                ([f"drone {number}, waypoint {row}" for row in range(len(flight))], flight)
                for number, flight in enumerate(flown.flights, 1)
            ]
        return self._after(flights, at, changes)

    # The search on a grid.

    def scenario(self) -> Scenario:
        """The search on a grid, to train on or to play; its person drifts as the particles do.

        A cell is as wide as the strip that a drone sees, or several times as wide if the area is
        large, and a drone moves and searches while a real one crosses it in still air.
        """
        return self.search().scenario

    def search(self) -> NamedSearch:
        """The search with its start cells and its `Scale`; its `reason` is the incident."""
        scenario, starts, scale, _ = self._on_grid
        return NamedSearch("incident", self.sentence, scenario, starts, scale)

    def locate(self, cell: ArrayLike) -> Floats:
        """The (latitude, longitude) in degrees of cells (x, y), real numbers: (..., 2)."""
        _, _, scale, middle = self._on_grid
        return self.plane.degrees((np.asarray(cell) - middle) * (1, -1) * scale.metres_per_cell)

    @cached_property
    def _on_grid(self) -> GridSearch:
        return GridSearch.of(self)
