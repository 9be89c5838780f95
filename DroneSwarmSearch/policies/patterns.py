"""The search patterns of the IAMSAR Manual as policies.

What rescue services fly when they have nothing but a datum and a spread (IAMSAR Manual,
volume II; `tracks` has the geometry). A swarm flies to the commence points without
searching, then searches every cell of its tracks, and when all have done so begins again
around a new datum.

What decides all of them is where and how wide to search. The datum is where the person is
expected when the drones are half-way through, since it drifts while they fly. The area
reaches `REACH` standard deviations from it to each side, but holds no more cells than can
be searched once in the time that is left: beyond that, effort would go from likelier cells
to less likely ones. Track spacing is one cell, what a search covers.

With several persons the passes serve those still missing in turn, each with its share of
the time left: a mean over persons who are far apart would lie where nobody is.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch.drift.probability_matrix import ProbabilityMatrix
from DroneSwarmSearch.policies.belief_tracker import BeliefTracker
from DroneSwarmSearch.policies.conflicts import MOVES, resolve_conflicts
from DroneSwarmSearch.policies.swarm import SwarmPolicy
from DroneSwarmSearch.policies.tracks import (
    Rectangle,
    cells_along,
    divided,
    expanding_square,
    sector_search,
    strips,
    sweep,
)
from DroneSwarmSearch.rules import Action
from DroneSwarmSearch.scenario import Cell

__all__ = [
    "CreepingLinePolicy",
    "Datum",
    "ExpandingSquarePolicy",
    "ParallelSweepPolicy",
    "PatternPolicy",
    "SectorSearchPolicy",
]

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]
Route = list[Cell]

REACH = 2.0
"""Standard deviations from the datum to each side of the area."""

STEPS_PER_CELL = 2
"""What it takes to search one more cell of a track: a move and a search."""

STAIRS = 4 / math.pi
"""Cells per cell of length along a line of any direction, in the mean: |cos| + |sin|."""


class Datum(NamedTuple):
    """Where a person is expected, and what effort there is to search around it.

    Attributes:
        mean: (x, y), in cells.
        spread: standard deviations along x and y, in cells.
        cells: how many cells all drones together can search in the time left, at least 1.
    """

    mean: tuple[float, float]
    spread: tuple[float, float]
    cells: float

    @classmethod
    def of_forecast(cls, forecast: ProbabilityMatrix, step: int, cells: float) -> Datum:
        """The datum of a person's forecast at a step."""
        moments = [_moments(chances) for chances in forecast.marginals(step)]
        (x, spread_x), (y, spread_y) = moments
        return cls((x, y), (spread_x, spread_y), max(cells, 1.0))

    def area(self, grid_size: int) -> Rectangle:
        """The area to search: a rectangle around the datum, within the grid and the effort."""
        for tenths in range(round(10 * REACH), 0, -1):
            area = self._within(tenths / 10, grid_size)
            if area.area <= self.cells:
                return area
        return self._within(0.0, grid_size)

    def _within(self, reach: float, grid_size: int) -> Rectangle:
        """All cells within some standard deviations along each axis."""
        ranges = []
        for mean, spread in zip(self.mean, self.spread, strict=True):
            first = max(math.floor(mean - reach * spread + 0.5), 0)
            last = min(math.floor(mean + reach * spread + 0.5), grid_size - 1)
            ranges.append((first, last - first + 1))
        (x, width), (y, height) = ranges
        return Rectangle(x, y, width, height)


@dataclass
class _Flight:
    """A drone's track and how far it has come.

    Attributes:
        route: the cells to search, one after another.
        at: the place in it of the next one.
        flown: whether it has searched them all; it then flies the track backwards.
    """

    route: Route
    at: int = 0
    flown: bool = False

    @property
    def goal(self) -> Cell | None:
        """The cell to search next; None for a drone without a track."""
        return self.route[self.at] if self.route else None

    @property
    def done(self) -> bool:
        """Whether it has nothing left to search for the first time."""
        return self.flown or not self.route

    def searched(self) -> None:
        """The goal is being searched: go on to the next one."""
        self.at += 1
        if self.at == len(self.route):
            self.flown = True
            self.route = self.route[::-1]
            self.at = min(1, len(self.route) - 1)


@dataclass
class _Swarm:
    """The memory of a search.

    Attributes:
        knowledge: who is missing, and the forecasts.
        flights: of every drone.
        passes: how many times tracks have been laid out.
    """

    knowledge: BeliefTracker
    flights: list[_Flight] = field(default_factory=list)
    passes: int = 0


class PatternPolicy(SwarmPolicy):
    """Lays out tracks around a datum and lets the drones search along them.

    Args:
        scenario: the parameters of every search that the policy is going to steer.

    Raises:
        TypeError: `scenario` is no `Scenario`.
    """

    @abstractmethod
    def routes(self, datum: Datum, passes: int) -> list[list[Route]]:
        """The tracks to fly, each with the ways in which it can be flown.

        Args:
            datum: where to search, and how much there is time for.
            passes: how many times tracks have been laid out before.

        Returns:
            For each drone or for fewer, at least one, routes to choose from: the cells to
            search in order. The nearest drone flies the one that begins nearest to it.
        """

    def begin(self) -> _Swarm:
        return _Swarm(BeliefTracker(self._scenario))

    def choose(self, memory: _Swarm, cells: list[Cell], matrix: Singles) -> list[Action]:
        memory.knowledge.observe(matrix)
        if all(flight.done for flight in memory.flights):
            self._lay_out(memory, cells)
        wishes, searching = _wishes(memory.flights, cells)
        nexts = resolve_conflicts(cells, wishes)
        actions = []
        for drone, ((x, y), (next_x, next_y)) in enumerate(zip(cells, nexts, strict=True)):
            if drone in searching:
                memory.flights[drone].searched()
                actions.append(Action.SEARCH)
            else:
                actions.append(MOVES[next_x - x, next_y - y])
        memory.knowledge.acted(cells, actions)
        return actions

    def _lay_out(self, memory: _Swarm, cells: list[Cell]) -> None:
        """New tracks around a new datum."""
        routes = self.routes(self._datum(memory, cells), memory.passes)
        memory.flights = _assigned(routes, cells)
        memory.passes += 1

    def _datum(self, memory: _Swarm, cells: list[Cell]) -> Datum:
        """Where the next person to serve is when the drones are half-way through."""
        knowledge, limit = memory.knowledge, self._scenario.timestep_limit
        turn = memory.passes % len(knowledge.missing)
        forecast = knowledge.forecasts[knowledge.missing[turn]]
        left = (limit - knowledge.step) / (len(knowledge.missing) - turn)
        half_way, effort = knowledge.step, len(cells) * left / STEPS_PER_CELL
        # The way there, the size of the area and the time it takes depend on each other.
        for _ in range(4):
            datum = Datum.of_forecast(forecast, half_way, effort)
            area = datum.area(self._scenario.grid_size)
            way = sum(_distance(cell, area) for cell in cells) / len(cells)
            effort = len(cells) * (left - way) / STEPS_PER_CELL
            duration = STEPS_PER_CELL * area.area / len(cells)
            half_way = min(knowledge.step + round(way + duration / 2), limit)
        return Datum.of_forecast(forecast, half_way, effort)


class ParallelSweepPolicy(PatternPolicy):
    """Parallel sweep, PS: legs along the area's longer side, each drone in a strip of its own.

    Args:
        scenario: the parameters of every search that the policy is going to steer.

    Raises:
        TypeError: `scenario` is no `Scenario`.
    """

    _along_longer = True

    def routes(self, datum: Datum, passes: int) -> list[list[Route]]:
        size = self._scenario.grid_size
        area = datum.area(size)
        along_x = (area.width >= area.height) == self._along_longer
        return [
            [cells_along(sweep(strip, along_x, corner), size) for corner in strip.corners]
            for strip in strips(area, self._scenario.n_drones, along_x)
        ]


class CreepingLinePolicy(ParallelSweepPolicy):
    """Creeping line, CS: legs along the area's shorter side, each drone in a strip of its own.

    Args:
        scenario: the parameters of every search that the policy is going to steer.

    Raises:
        TypeError: `scenario` is no `Scenario`.
    """

    _along_longer = False


class ExpandingSquarePolicy(PatternPolicy):
    """Expanding square, SS: from the datum outwards, the next time turned by 45°.

    Several drones divide the area into parts as nearly square as can be, and each flies
    its square from the middle of its part: that keeps them apart, and each pattern whole.
    The first leg leads against the drift.

    Args:
        scenario: the parameters of every search that the policy is going to steer.

    Raises:
        TypeError: `scenario` is no `Scenario`.
    """

    def routes(self, datum: Datum, passes: int) -> list[list[Route]]:
        size = self._scenario.grid_size
        heading = 90.0 * round(_drift_heading(self._scenario.vector) / 90.0 + 2.0)
        turned = passes % 2 == 1
        routes = []
        for part in divided(datum.area(size), self._scenario.n_drones):
            side = math.sqrt(part.area / (2.0 if turned else 1.0))  # in spacings
            centre = tuple(math.floor(axis + 0.5) for axis in part.centre)
            legs = 2 * max(1, round(side)) - 1 if part.area > 1 else 0
            track = expanding_square((centre[0], centre[1]), legs, heading + 45.0 * turned)
            routes.append([cells_along(track, size)])
        return routes


class SectorSearchPolicy(PatternPolicy):
    """Sector search, VS: three triangles through the datum, the next time with legs between.

    Several drones fly it around the same datum, turned against each other so that their
    legs divide the circle evenly. The first leg leads along the drift.

    Args:
        scenario: the parameters of every search that the policy is going to steer.

    Raises:
        TypeError: `scenario` is no `Scenario`.
    """

    def routes(self, datum: Datum, passes: int) -> list[list[Route]]:
        size, drones = self._scenario.grid_size, self._scenario.n_drones
        reach = REACH * math.sqrt((datum.spread[0] ** 2 + datum.spread[1] ** 2) / 2)
        affordable = datum.cells / drones / (9 * STAIRS)
        radius = max(min(reach, affordable), 1.0)
        sector = 60.0 / drones  # legs lead out of the datum every 60°
        first = _drift_heading(self._scenario.vector) + (passes % 2) * sector / 2
        return [
            [cells_along(sector_search(datum.mean, radius, first + drone * sector), size)]
            for drone in range(drones)
        ]


def _assigned(choices: Sequence[Sequence[Route]], cells: Sequence[Cell]) -> list[_Flight]:
    """The nearest drone gets the nearest track, and flies it from its nearest beginning."""
    ways = sorted(
        (_steps(cell, route[0]), drone, track, way)
        for drone, cell in enumerate(cells)
        for track, routes in enumerate(choices)
        for way, route in enumerate(routes)
    )
    flights = [_Flight([]) for _ in cells]
    given: set[int] = set()
    for _, drone, track, way in ways:
        if not flights[drone].route and track not in given:
            given.add(track)
            flights[drone] = _Flight(choices[track][way])
    return flights


def _wishes(flights: Sequence[_Flight], cells: Sequence[Cell]) -> tuple[list[Cell], set[int]]:
    """Where every drone wants to be next, and which drones search.

    Drones that are done make way for the others, by changing places with them: nobody
    waits for them in vain.
    """
    wishes = list(cells)
    searching = {
        drone
        for drone, flight in enumerate(flights)
        if flight.goal == cells[drone] and not flight.done
    }
    held = {cells[drone] for drone in searching}
    wanted: dict[Cell, int] = {}
    for drone in sorted(range(len(cells)), key=lambda drone: flights[drone].done):
        cell, goal = cells[drone], flights[drone].goal
        if flights[drone].done and cell in wanted:
            wishes[drone] = cells[wanted[cell]]
        elif goal == cell:
            searching.add(drone)
        elif goal is not None:
            wishes[drone] = _nearer(cell, goal, held)
            if not flights[drone].done:
                wanted.setdefault(wishes[drone], drone)
    return wishes, searching


def _nearer(cell: Cell, goal: Cell, held: set[Cell]) -> Cell:
    """The next cell on the way: the longer leg first, round those who stay if there is a way."""
    x, y = cell
    across, down = goal[0] - x, goal[1] - y
    ways = []
    if across:
        ways.append((abs(across), (x + (1 if across > 0 else -1), y)))
    if down:
        ways.append((abs(down), (x, y + (1 if down > 0 else -1))))
    return min(ways, key=lambda way: (way[1] in held, -way[0]))[1]


def _steps(cell: Cell, other: Cell) -> int:
    return abs(cell[0] - other[0]) + abs(cell[1] - other[1])


def _distance(cell: Cell, area: Rectangle) -> int:
    """Steps from a cell to the nearest of an area."""
    x, y = cell
    across = max(area.x - x, 0, x - (area.x + area.width - 1))
    down = max(area.y - y, 0, y - (area.y + area.height - 1))
    return across + down


def _moments(chances: Floats) -> tuple[float, float]:
    """Mean and standard deviation of the number of a column or row."""
    numbers = np.arange(len(chances))
    mean = float(chances @ numbers)
    variance = float(chances @ (numbers - mean) ** 2)
    return mean, math.sqrt(variance)


def _drift_heading(vector: tuple[float, float]) -> float:
    """The drift's direction in degrees, clockwise from up; 0 without a drift."""
    x, y = vector
    return math.degrees(math.atan2(x, -y)) if x or y else 0.0
