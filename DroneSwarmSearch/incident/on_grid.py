"""The search on a grid for an incident, to train on or to play."""

from __future__ import annotations

import math
from functools import lru_cache
from statistics import median
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from DroneSwarmSearch._internal.arrays import Floats, Ints
from DroneSwarmSearch._internal.cells import cell_number, cell_position
from DroneSwarmSearch.core.named_search import NamedSearch
from DroneSwarmSearch.core.scenario import Scenario
from DroneSwarmSearch.geo.scale import Scale
from DroneSwarmSearch.incident.coast import Coast
from DroneSwarmSearch.incident.incident import Incident
from DroneSwarmSearch.incident.particles import Particles, simulate
from DroneSwarmSearch.persons.person import Person
from DroneSwarmSearch.persons.tracks import Tracks

PARTICLES = 10_000  # the number of tracks
LEAST_CELLS = 12  # along each side
MOST_CELLS = 48

STARTS_HOLD = 0.9
"""The drones begin in cells of the smallest area that holds this share of the probability."""


class _OnGrid(NamedTuple):
    """A search on a grid, and the cell (x, y) at the last known position, real numbers."""

    search: NamedSearch
    scale: Scale
    middle: Floats


def search_on_grid(incident: Incident) -> NamedSearch:
    """The search on a grid, to train on or to play; its person drifts as the particles do.

    A cell is as wide as the strip that a drone sees, or several times as wide if the area is
    large, and a drone moves and searches while a real one crosses it in still air. The drones of a
    mixed fleet are as the one in the middle.

    Returns:
        The scenario with its start cells and its `Scale`; its `reason` is the incident.
    """
    return _on_grid(incident).search


def locate(incident: Incident, cells: ArrayLike) -> Floats:
    """Where cells of `search_on_grid` are.

    Args:
        incident: the incident.
        cells: (x, y), real numbers: (..., 2).

    Returns:
        (latitude, longitude) in degrees: float64, (..., 2).
    """
    grid = _on_grid(incident)
    metres = (np.asarray(cells) - grid.middle) * (1, -1) * grid.scale.metres_per_cell
    return incident.plane.degrees(metres)


@lru_cache(maxsize=4)
def _on_grid(incident: Incident) -> _OnGrid:
    """Lay a grid over the particles, from the drones' arrival to their departure."""
    cloud = simulate(incident, PARTICLES, 0)
    begin, end = _hours(incident, cloud)
    at_ends = cloud.positions[:, cloud.rows(np.array([begin, end]))]
    low, high = np.percentile(at_ends, (0.25, 99.75), (1, 2))
    extent = float((high - low).max())
    craft = incident.craft
    swath = median(cloud.mean_of(drone.swath) for drone in craft)
    speed = median(drone.speed for drone in craft)
    detection = median(cloud.mean_of(drone.probability_of_detection) for drone in craft)
    wide = math.ceil((extent / swath + 1) / MOST_CELLS)
    metres = wide * swath
    scale = Scale(metres, metres / (2 * speed))
    size = max(math.ceil(extent / metres) + 1, LEAST_CELLS)
    centre = np.mean([low, high], axis=0)
    middle = (size - 1) / 2 - centre * (1, -1) / metres

    limit = scale.whole_steps(end - begin)
    times = begin + scale.seconds_per_step * np.arange(limit + 1, dtype=np.float64)
    cells = _interpolated(cloud, times) * (1, -1) / metres + middle
    tracks = Tracks(cells.clip(0, size - 1), cloud.weights)
    person = Person(tracks, detection / wide, fine=1)
    scenario = Scenario(
        size,
        len(craft),
        persons=(person,),
        timestep_limit=limit,
        bayesian_update=True,
    )

    # The drones begin in likely cells, those nearest to the base.
    likely = _likely_cells(tracks, size, len(craft))
    base = incident.plane.metres(*incident.base)
    away = np.hypot(*((likely - middle) * (1, -1) * metres - base).T)
    nearest = np.argsort(away, kind="stable")[: len(craft)]
    starts = tuple((x, y) for x, y in likely[nearest].tolist())
    search = NamedSearch(
        name="incident",
        reason=incident.sentence,
        scenario=scenario,
        drones=starts,
        scale=scale,
        land=_land_cells(incident, size, middle, metres),
    )
    return _OnGrid(search, scale, middle)


def _land_cells(
    incident: Incident, size: int, middle: Floats, metres: float
) -> tuple[tuple[int, int], ...]:
    """The cells (x, y) whose centres are on land."""
    x, y = cell_position(np.arange(size**2), size)
    centres = (np.stack([x, y], axis=-1) - middle) * (1, -1) * metres
    is_land = Coast(incident).is_land(centres.T)
    return tuple(zip(x[is_land].tolist(), y[is_land].tolist(), strict=True))


def _hours(incident: Incident, cloud: Particles) -> tuple[float, float]:
    """When drones arrive at the mean position, and when they leave, in seconds."""
    start = incident.seconds(incident.start)
    away = cloud.mean(start) - incident.plane.metres(*incident.base)
    speed = median(drone.speed for drone in incident.craft)
    endurance = max(drone.endurance for drone in incident.craft)
    first = start + float(np.hypot(*away)) / speed
    last = max(2 * start + endurance - first, first + endurance / 10)
    return first, last


def _interpolated(cloud: Particles, times: Floats) -> Floats:
    """The positions of particles at some times, in metres: (times, n, 2)."""
    steps = (times - cloud.begin) / cloud.step
    row = np.minimum(steps.astype(np.int64), cloud.positions.shape[1] - 2)
    part = (steps - row).clip(0, 1)[:, None].astype(np.float32)
    here = cloud.positions[:, row]
    ahead = cloud.positions[:, row + 1]
    positions: Floats = np.stack(here + part * (ahead - here), axis=-1)
    return positions


def _likely_cells(tracks: Tracks, size: int, fewest: int) -> Ints:
    """The cells (x, y) of the smallest area that holds most of the probability: (n, 2)."""
    x, y = np.rint(tracks.positions[0].T).astype(np.int64)
    mass = np.bincount(cell_number(x, y, size), tracks.weights, size**2)
    likely = np.argsort(-mass, kind="stable")
    count = int(np.searchsorted(mass[likely].cumsum(), STARTS_HOLD)) + 1
    return np.stack(cell_position(likely[: max(count, fewest)], size), axis=1)
