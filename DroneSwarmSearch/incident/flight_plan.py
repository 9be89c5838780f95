"""A plan that drones can fly, and what it is expected to find."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from functools import cached_property
from pathlib import Path

import numpy as np

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.arrays import Floats, Ints
from DroneSwarmSearch.drift.belief import Belief
from DroneSwarmSearch.evaluation.suite import NamedSearch
from DroneSwarmSearch.incident.flights import Waypoint, schedule, turns, without_exchanges
from DroneSwarmSearch.incident.report import Incident
from DroneSwarmSearch.policies.greedy import PosteriorGreedyPolicy
from DroneSwarmSearch.policies.planned import searching_in_flight
from DroneSwarmSearch.policies.planner import PlannerPolicy
from DroneSwarmSearch.scenario import Cell

QUICK = "greedy-posterior"
POLICIES = "planner", QUICK
"""The policies that plan flights; the second one takes a second."""


@dataclass(frozen=True, eq=False)
class FlightPlan:
    """The flights of all drones, from take-off to landing.

    A drone flies straight and evenly from one waypoint to the next. It searches from the first cell
    to the landing, also on its way back. Legs follow the grid, so that strips lie side by side.
    Drones take off and land one after another, and are never in one cell at the same time.

    Attributes:
        incident: the incident.
        policy: what planned the search; "greedy-posterior" also where it found more than "planner".
        waypoints: those of the first drone in the order of their times, then those of the others.
    """

    incident: Incident
    policy: str
    waypoints: tuple[Waypoint, ...] = field(repr=False)

    @classmethod
    def of(cls, incident: Incident, policy: str) -> FlightPlan:
        """`Incident.plan`."""
        checks.choice("policy", policy, POLICIES)
        cells = without_exchanges(_searched_cells(incident.search(), policy))
        plan = cls(incident, policy, tuple(_waypoints(incident, cells)))
        if policy != QUICK:  # its drones may have to turn back earlier
            quick = cls.of(incident, QUICK)
            if quick.probability_of_success > plan.probability_of_success:
                return quick
        return plan

    @cached_property
    def flights(self) -> list[list[Waypoint]]:
        """The waypoints of each drone."""
        drones = sorted({each.drone for each in self.waypoints})
        return [[each for each in self.waypoints if each.drone == drone] for drone in drones]

    @cached_property
    def search(self) -> NamedSearch:
        """The search on a grid, see `Incident.search`."""
        return self.incident.search()

    @property
    def first(self) -> datetime:
        """When the search begins: step 0."""
        return self.incident.layout.first

    @property
    def probability_of_success(self) -> float:
        """The probability that the flights find the person."""
        return float(self.success[-1])

    @cached_property
    def success(self) -> Floats:
        """The probability that the person is found before each step: float64, (steps + 1,).

        The last entry is that when the last drone has landed.
        """
        return np.array([1.0 - belief.kept for belief in self._beliefs(None)])

    def prior(self, step: int) -> Floats:
        """The map at a step, without these flights: float64, (N, N), indexed [y, x]."""
        (model,) = self.search.scenario.forecasts()
        return model.exact(step)

    def posterior(self, step: int) -> Floats:
        """The map before a step if nobody was found: float64, (N, N), indexed [y, x]."""
        *_, last = self._beliefs(step)
        return last.map().copy()

    def _beliefs(self, last: int | None) -> Iterator[Belief]:
        """The belief before each step up to the last one, by default the landing."""
        scenario, layout = self.search.scenario, self.incident.layout
        (model,), (detection,) = scenario.forecasts(), scenario.detections
        cells = layout.grid.searched(self.flights, layout.first)
        belief, size = Belief(model, detection, model.joint(0)), scenario.grid_size
        yield belief
        for step in range(self._steps if last is None else last):
            if step in cells:
                belief = belief.after_search([y * size + x for x, y in cells[step]])
            belief = belief.after_drift(step)
            yield belief

    @property
    def _steps(self) -> int:
        """The steps until the last landing, or until the tracks end."""
        landed = max(flight[-1].time for flight in self.flights)
        steps = self.incident.layout.grid.scale.whole_steps((landed - self.first).total_seconds())
        tracks = self.incident.layout.person.tracks
        return steps if tracks is None else min(steps, tracks.steps)

    def save(self, folder: str | os.PathLike[str]) -> None:
        """Write the plan to a folder: GPX, KML, GeoJSON, CSV, a map as PNG and SVG, the incident.

        Raises:
            ImportError: Matplotlib is missing.
            OSError: a file cannot be written.
        """
        from DroneSwarmSearch.incident import chart, files

        where = Path(folder)
        files.save(self, where)
        chart.save(self, where)
        self.incident.save(where / "incident.json")


def _searched_cells(search: NamedSearch, policy: str) -> Ints:
    """The cells (x, y) that the drones search in every second step, (n, drones, 2)."""
    scenario = search.scenario
    planner = PlannerPolicy(scenario, in_flight=True)
    act = searching_in_flight(PosteriorGreedyPolicy(scenario).actions)
    tracker, cells = planner.begin().tracker, list(search.drones)
    searched: list[list[Cell]] = []
    while tracker.step < scenario.timestep_limit:
        if policy == "planner":
            steps = planner.plan(tracker, cells)
        else:
            steps, _ = planner.simulated(act, tracker, cells)
        for number, (cells, actions) in enumerate(steps):
            if number % 2 == 0:
                searched.append(cells)
            tracker.update(cells, actions)
        cells = planner.ahead(*steps[-1])
    return np.array(searched)


def _waypoints(incident: Incident, cells: Ints) -> Iterator[Waypoint]:
    """The waypoints of drones that search some cells, (n, drones, 2), as long as they can."""
    grid, _, _, first, _ = incident.layout
    speed, crossing = incident.speed, 2 * grid.scale.seconds_per_step
    gap = grid.gap(speed)
    points = grid.metres(cells)
    base = grid.plane.metres(*incident.base)
    distances = np.hypot(*np.moveaxis(points - base, -1, 0))  # (n, drones)
    there = schedule(distances[0], speed, gap)
    for count in range(len(points), 0, -1):
        ended, back = crossing * (count - 1), schedule(distances[count - 1], speed, gap)
        if np.all(there + ended + back <= incident.endurance):
            break
    for drone in range(incident.drones):
        turning = turns(points[:count, drone])
        way, home = distances[[0, count - 1], drone] / speed
        begun, landed = -there[drone], ended + back[drone]
        route = [
            (begun, base, False),
            (begun + way, points[0, drone], False),
            *((crossing * each, points[each, drone], True) for each in turning),
            (landed - home, points[count - 1, drone], True),
            (landed, base, False),
        ]
        degrees = grid.plane.degrees(np.array([point for _, point, _ in route])).tolist()
        for number, ((seconds, _, searching), place) in enumerate(zip(route, degrees, strict=True)):
            is_last = number == len(route) - 1
            if not is_last and route[number + 1][0] - seconds < 1e-3:
                continue  # no wait here
            latitude, longitude = place
            when = first + timedelta(seconds=seconds)
            yield Waypoint(drone, when, latitude, longitude, searching)
