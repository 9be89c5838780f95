"""The search on a grid for an incident, to train on or to play."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from DroneSwarmSearch._internal.arrays import Floats
from DroneSwarmSearch.core.grid import Cell
from DroneSwarmSearch.core.scenario import Scenario
from DroneSwarmSearch.geo.scale import Scale
from DroneSwarmSearch.incident.report import Report
from DroneSwarmSearch.persons.person import Person
from DroneSwarmSearch.persons.tracks import Tracks

PARTICLES, LEAST_CELLS, MOST_CELLS = 10_000, 12, 48
"""The number of tracks, and the fewest and most cells along each side."""

STARTS_HOLD = 0.9
"""The drones begin in cells of the smallest area that holds this share of the probability."""


class GridSearch(NamedTuple):
    """A scenario, the drones' start cells, the scale, and the cell (x, y) at the plane's origin."""

    scenario: Scenario
    starts: tuple[Cell, ...]
    scale: Scale
    middle: Floats

    @classmethod
    def of(cls, report: Report) -> GridSearch:
        """Lay a grid over the particles, from the drones' arrival to their departure."""
        cloud, start = report.particles(PARTICLES, 0), report.seconds(report.start)
        base = report.plane.metres(*report.base)
        first = start + float(np.hypot(*(cloud.mean(start) - base))) / report.speed
        last = max(2 * start + report.endurance - first, first + report.endurance / 10)
        rows = cloud.rows(np.array([first, last]))
        ends = np.percentile(cloud.positions[:, rows], (0.25, 99.75), (1, 2))
        extent = float((ends[1] - ends[0]).max())
        wide = math.ceil((extent / report.swath + 1) / MOST_CELLS)
        metres = wide * report.swath
        scale = Scale(metres, metres / (2 * report.speed))
        size = max(math.ceil(extent / metres) + 1, LEAST_CELLS)
        middle = (size - 1) / 2 - ends.mean(axis=0) * (1, -1) / metres
        limit = scale.whole_steps(last - first)
        times = (first + scale.seconds_per_step * np.arange(limit + 1) - cloud.begin) / cloud.step
        row = np.minimum(times.astype(np.int64), cloud.positions.shape[1] - 2)
        part = (times - row).clip(0, 1)[:, None].astype(np.float32)
        here, ahead = cloud.positions[:, row], cloud.positions[:, row + 1]
        cells = np.stack(here + part * (ahead - here), axis=-1) * (1, -1) / metres + middle
        tracks = Tracks(cells.clip(0, size - 1), cloud.weights)
        # The drones begin in likely cells, those nearest to the base.
        x, y = np.rint(tracks.positions[0].T).astype(np.int64)
        mass = np.bincount(y * size + x, tracks.weights, size**2)
        likely = np.argsort(-mass, kind="stable")
        count = int(np.searchsorted(mass[likely].cumsum(), STARTS_HOLD)) + 1
        y, x = np.divmod(likely[: max(count, report.drones)], size)
        away = np.hypot(*((np.stack([x, y], axis=1) - middle) * (1, -1) * metres - base).T)
        nearest = np.argsort(away, kind="stable")[: report.drones].tolist()
        person = Person(tracks, report.probability_of_detection / wide, fine=1)
        scenario = Scenario(
            size,
            report.drones,
            persons=(person,),
            timestep_limit=limit,
            bayesian_update=True,
        )
        return cls(scenario, tuple((int(x[k]), int(y[k])) for k in nearest), scale, middle)
