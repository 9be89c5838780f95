"""The search patterns of the IAMSAR Manual as policies.

The drones fly to the commence search points without searching, then search every cell of their
tracks (IAMSAR Manual, volume II; `pattern_tracks` has the tracks, `datum` the area). When all
have finished, they start again around a new datum: the person's expected position when they are
half-way through. The track spacing is one cell.

Each person and each group of hypotheses apart has its own datum. The drones search around one
after another and divide the remaining time: equally among the missing persons, and by weight.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field

from DroneSwarmSearch._internal.arrays import Singles
from DroneSwarmSearch.core.collision_avoidance import ACTION_OF, resolve_conflicts
from DroneSwarmSearch.core.grid import Cell, moves_between
from DroneSwarmSearch.core.rules import PASS, Action
from DroneSwarmSearch.policies.base import AGREED, SwarmPolicy
from DroneSwarmSearch.policies.belief_tracker import BeliefTracker
from DroneSwarmSearch.policies.datum import REACH, Datum, datums_of
from DroneSwarmSearch.policies.pattern_tracks import (
    Rectangle,
    cells_along,
    expanding_square,
    parallel_track,
    parts_of,
    sector_search,
    strips_of,
)

Route = list[Cell]

CELLS_PER_LENGTH = 4 / math.pi
"""Cells per unit of length along a line, the mean over all directions: |cos| + |sin|."""


@dataclass
class _RouteProgress:
    """A drone's progress along its route, which may be empty.

    `at` is the index of the next cell. Once all are searched (`is_done`), the drone flies back.
    """

    route: Route
    at: int = 0
    is_done: bool = False

    @property
    def next_cell(self) -> Cell | None:
        return self.route[self.at] if self.route else None

    def arrive(self, cell: Cell) -> None:
        """A drone that searches in flight is in a cell, which it has searched."""
        if self.next_cell == cell and not self.is_done:
            self.advance()

    def advance(self) -> None:
        """The next cell is being searched; continue with the one after it."""
        self.at += 1
        if self.at == len(self.route):
            self.is_done = True
            self.route = self.route[::-1]
            self.at = min(1, len(self.route) - 1)


@dataclass
class _PatternMemory:
    """The beliefs, each drone's progress, and how many times tracks have been laid out."""

    tracker: BeliefTracker
    progress: list[_RouteProgress] = field(default_factory=list)
    laid_out: int = 0


class PatternPolicy(SwarmPolicy):
    """Lays out tracks around a datum; the drones search along them.

    In a search with a `radio_range`, they fly as agreed before the start, whatever they hear.
    """

    knows = AGREED

    @abstractmethod
    def routes(self, datum: Datum, laid_out: int) -> list[list[Route]]:
        """Alternative routes for each drone, or for fewer, at least one: cells to search in order.

        The nearest drone takes the one that starts nearest to it. `laid_out` is how many times
        tracks have been laid out before.
        """

    def begin(self) -> _PatternMemory:
        return _PatternMemory(BeliefTracker(self.scenario))

    def choose(self, memory: _PatternMemory, cells: list[Cell], matrix: Singles) -> list[Action]:
        if self.scenario.radio_range is None:
            memory.tracker.observe(matrix)
        if self.scenario.search_in_flight:
            for progress, cell in zip(memory.progress, cells, strict=False):
                progress.arrive(cell)
        if all(progress.is_done for progress in memory.progress):
            routes = self.routes(self._datum(memory, cells), memory.laid_out)
            memory.progress = _assigned(routes, cells)
            memory.laid_out += 1
        wanted, searching = _wanted(memory.progress, cells)
        nexts = wanted
        if self.scenario.crash != PASS:
            nexts = resolve_conflicts(cells, wanted)
        actions = []
        for drone, ((x, y), (next_x, next_y)) in enumerate(zip(cells, nexts, strict=True)):
            if drone in searching:
                memory.progress[drone].advance()
                actions.append(Action.SEARCH)
            else:
                actions.append(ACTION_OF[next_x - x, next_y - y])
        return actions

    def learn(self, memory: _PatternMemory, searched: list[int], actions: list[int]) -> None:
        memory.tracker.learn(searched, actions)

    @property
    def _steps_per_cell(self) -> int:
        """The steps to search one more cell of a track: a move, and unless in flight a search."""
        return 1 if self.scenario.search_in_flight else 2

    def _datum(self, memory: _PatternMemory, cells: list[Cell]) -> Datum:
        """The next datum, as it will be when the drones are half-way through."""
        tracker = memory.tracker
        limit = self.scenario.timestep_limit
        half_way = tracker.step
        way = 0.0
        # The way there, the size of the area and the duration depend on each other: iterate.
        for _ in range(5):
            forecasts = [tracker.forecasts[person] for person in tracker.missing]
            datums = [datum for forecast in forecasts for datum in datums_of(forecast, half_way)]
            datum, *later = datums[memory.laid_out % len(datums) :]
            weight = sum(other.weight for other in later) + datum.weight
            left = (limit - tracker.step) * datum.weight / weight
            effort = len(cells) * (left - way) / self._steps_per_cell
            datum = datum._replace(effort=max(effort, 1.0))
            area = datum.area(self.scenario.grid_size)
            way = sum(_steps_to_area(cell, area) for cell in cells) / len(cells)
            duration = self._steps_per_cell * area.area / len(cells)
            half_way = min(tracker.step + round(way + duration / 2), limit)
        return datum


class ParallelSweepPolicy(PatternPolicy):
    """Parallel sweep search (PS): legs along the longer side of the area, a strip per drone."""

    _along_longer_side = True

    def routes(self, datum: Datum, laid_out: int) -> list[list[Route]]:
        size = self.scenario.grid_size
        area = datum.area(size)
        along_x = (area.width >= area.height) == self._along_longer_side
        return [
            [cells_along(parallel_track(strip, along_x, corner), size) for corner in strip.corners]
            for strip in strips_of(area, self.scenario.n_drones, along_x)
        ]


class CreepingLinePolicy(ParallelSweepPolicy):
    """Creeping line search (CS): legs along the shorter side of the area, a strip per drone."""

    _along_longer_side = False


class ExpandingSquarePolicy(PatternPolicy):
    """Expanding square search (SS): from the datum outwards; every second time turned by 45°.

    Several drones divide the area into nearly square parts, and each flies its square from the
    middle of its part. That keeps the drones apart and each pattern whole. The first leg leads
    against the drift.
    """

    def routes(self, datum: Datum, laid_out: int) -> list[list[Route]]:
        size = self.scenario.grid_size
        heading = 90.0 * round(_drift_heading(self.scenario.mean_vector) / 90.0 + 2.0)
        turned = laid_out % 2 == 1
        routes = []
        for part in parts_of(datum.area(size), self.scenario.n_drones):
            side = math.sqrt(part.area / (2.0 if turned else 1.0))  # in track spacings
            x, y = (math.floor(coordinate + 0.5) for coordinate in part.centre)
            legs = 2 * max(1, round(side)) - 1 if part.area > 1 else 0
            track = expanding_square((x, y), legs, heading + 45.0 * turned)
            routes.append([cells_along(track, size)])
        return routes


class SectorSearchPolicy(PatternPolicy):
    """Sector search (VS): three triangles through the datum; every second time turned.

    Several drones fly it around the same datum, turned so that their legs divide the circle
    evenly; every second time the legs are half-way between the earlier ones. The first leg leads
    along the drift.
    """

    def routes(self, datum: Datum, laid_out: int) -> list[list[Route]]:
        size = self.scenario.grid_size
        drones = self.scenario.n_drones
        reach = REACH * math.sqrt((datum.deviation[0] ** 2 + datum.deviation[1] ** 2) / 2)
        affordable = datum.effort / drones / (9 * CELLS_PER_LENGTH)
        radius = max(min(reach, affordable), 1.0)
        sector = 60.0 / drones  # one drone's legs leave the datum every 60°
        first = _drift_heading(self.scenario.mean_vector) + (laid_out % 2) * sector / 2
        return [
            [cells_along(sector_search(datum.mean, radius, first + drone * sector), size)]
            for drone in range(drones)
        ]


def _assigned(choices: Sequence[Sequence[Route]], cells: Sequence[Cell]) -> list[_RouteProgress]:
    """Assign the routes to the nearest drones, each from its nearest start."""
    pairs = sorted(
        (_steps(cell, route[0]), drone, track, alternative)
        for drone, cell in enumerate(cells)
        for track, routes in enumerate(choices)
        for alternative, route in enumerate(routes)
    )
    progress = [_RouteProgress([], is_done=True) for _ in cells]
    assigned: set[int] = set()
    for _, drone, track, alternative in pairs:
        if not progress[drone].route and track not in assigned:
            assigned.add(track)
            progress[drone] = _RouteProgress(choices[track][alternative])
    return progress


def _wanted(
    progress: Sequence[_RouteProgress], cells: Sequence[Cell]
) -> tuple[list[Cell], set[int]]:
    """Every drone's desired next cell, and who searches; finished drones let others pass."""
    wanted = list(cells)
    searching = {
        drone
        for drone, cell in enumerate(cells)
        if progress[drone].next_cell == cell and not progress[drone].is_done
    }
    occupied = {cells[drone] for drone in searching}
    wanted_by: dict[Cell, int] = {}
    for drone in sorted(range(len(cells)), key=lambda drone: progress[drone].is_done):
        cell = cells[drone]
        goal = progress[drone].next_cell
        if progress[drone].is_done and cell in wanted_by:
            wanted[drone] = cells[wanted_by[cell]]
        elif goal == cell:
            searching.add(drone)
        elif goal is not None:
            wanted[drone] = _step_towards(goal, cell, occupied)
            if not progress[drone].is_done:
                wanted_by.setdefault(wanted[drone], drone)
    return wanted, searching


def _step_towards(goal: Cell, cell: Cell, occupied: set[Cell]) -> Cell:
    """The next cell on the way to another one: around occupied cells, the longer leg first."""
    x, y = cell
    to_x = goal[0] - x
    to_y = goal[1] - y
    along_x = abs(to_x), (x + (1 if to_x > 0 else -1), y)
    along_y = abs(to_y), (x, y + (1 if to_y > 0 else -1))
    options = [option for option in (along_x, along_y) if option[0]]
    return min(options, key=lambda option: (option[1] in occupied, -option[0]))[1]


def _steps(cell: Cell, other: Cell) -> int:
    return int(moves_between(other[0] - cell[0], other[1] - cell[1]))


def _steps_to_area(cell: Cell, area: Rectangle) -> int:
    x, y = cell
    steps_x = max(area.x - x, 0, x - (area.x + area.width - 1))
    steps_y = max(area.y - y, 0, y - (area.y + area.height - 1))
    return steps_x + steps_y


def _drift_heading(vector: tuple[float, float]) -> float:
    """The drift's direction in degrees, clockwise from up; 0 without a drift."""
    x, y = vector
    return math.degrees(math.atan2(x, -y)) if x or y else 0.0
