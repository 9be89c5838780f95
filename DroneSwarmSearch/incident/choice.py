"""The choice of search patterns, by CMA-ES on particles.

N. Hansen and A. Ostermeier, Completely derandomized self-adaptation in evolution strategies,
Evolutionary Computation 9:159 (2001).
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

import numpy as np

from DroneSwarmSearch._internal.arrays import Floats
from DroneSwarmSearch._internal.extras import needed
from DroneSwarmSearch.geo.units import radioed
from DroneSwarmSearch.incident.drone import SLOWEST
from DroneSwarmSearch.incident.families import Area, Boxes, FreePattern, FreePatterns
from DroneSwarmSearch.incident.fleet import Drone
from DroneSwarmSearch.incident.patterns import KINDS

POPULATION = 8  # of a run of CMA-ES
GENERATIONS = 15

BOXES_DRAWN = 48  # at random
DRAWN = 32  # patterns of a drone
STARTS = 2  # how many of the best ones are improved; of unlike drones, who begin in two ways, one

FIRST = 0.4  # the standard deviation with which CMA-ES begins from a drawn pattern
LATER = 0.15  # the same from a chosen one

SPREAD = np.array([1, 1, 1.3, 0.7, 0.7, 0.5])  # the standard deviations of drawn parameters
SPREAD_OF_BOXES = np.array([0.5, 0.5, 1.3, 0.7, 0.7, 0.5])
SHARES = (0.7, 0.15, 0.15)  # how often each kind of pattern is drawn
TRIES = 10  # how many patterns are drawn for each that can be flown, before the incident is refused


class CannotFlyError(ValueError):
    """No drone can fly to the area, search and come back."""


class Deadline:
    """The CPU time at which an improvement stops.

    Args:
        seconds: from now on; None for no limit.
    """

    def __init__(self, seconds: float | None) -> None:
        self.is_set = seconds is not None
        self._begin = time.process_time()
        self._seconds = math.inf if seconds is None else seconds

    @property
    def elapsed(self) -> float:
        """The share of the time that has passed."""
        return (time.process_time() - self._begin) / max(self._seconds, 1e-9)

    @property
    def is_over(self) -> bool:
        """Whether the time is up."""
        return self.elapsed >= 1.0


@dataclass(frozen=True)
class Effort:
    """How much work an improvement may take.

    Attributes:
        deadline: when to stop.
        generations: of each run of CMA-ES.
        starts: how many of the best drawn shapes are improved.
    """

    deadline: Deadline
    generations: int = field(default_factory=lambda: GENERATIONS)
    starts: int = STARTS


Tuned = TypeVar("Tuned", Boxes, FreePattern)


@dataclass(frozen=True)
class _Tried(Generic[Tuned]):
    """A shape, and the probability that is left undetected with it."""

    left: float
    shape: Tuned


# Boxes.


def first_boxes(area: Area, effort: Effort) -> Boxes:
    """The best adjacent boxes near the best of some that are drawn at random.

    If the time is up, the best of those that have been tried.

    Raises:
        CannotFlyError: no drone can search the area.
    """
    rng = np.random.default_rng(0)
    drawn = []
    for _ in range(TRIES * BOXES_DRAWN):
        boxes = Boxes(
            abreast=bool(rng.integers(2)),
            moving=bool(rng.integers(2)),
            side=int(rng.choice([-1, 1])),
            parameters=rng.normal(size=6) * SPREAD_OF_BOXES,
            order=() if area.is_uniform else tuple(rng.permutation(len(area.drones)).tolist()),
        )
        tried = _Tried(area.left(boxes), boxes)
        if tried.left < 1.0:
            drawn.append(tried)
            if len(drawn) == BOXES_DRAWN or effort.deadline.is_over:
                break
    if not drawn:
        raise CannotFlyError(refusal(area))
    drawn.sort(key=_left)
    improved = [
        _improved(start, area.left, FIRST, effort, seed)
        for seed, start in enumerate(drawn[: effort.starts])
    ]
    return min(improved, key=_left).shape


def better_boxes(area: Area, boxes: Boxes, effort: Effort, seed: int = 0) -> Boxes:
    """Adjacent boxes near others, at least as good."""
    start = _Tried(area.left(boxes), boxes)
    return _improved(start, area.left, LATER, effort, seed).shape


# Free patterns.


def free_patterns(
    area: Area, near: Sequence[FreePattern], effort: Effort, seed: int = 0
) -> FreePatterns | None:
    """Patterns for all drones, chosen drone after drone; None if the time is up before.

    Args:
        area: where to search.
        near: patterns of the first drones to begin with; the others' are drawn at random.
        effort: how much work that may take.
        seed: of the random numbers.

    Raises:
        CannotFlyError: no drone can search the area.
    """
    rng = np.random.default_rng(seed)
    drones = area.drones
    chosen: list[FreePattern | None] = [*near[: len(drones)]]
    chosen += [None] * (len(drones) - len(chosen))
    missed = [
        None if free is None else area.missed_by(number, free) for number, free in enumerate(chosen)
    ]
    for number in range(len(drones)):
        if effort.deadline.is_over:
            break
        others = [missed[n] for n in range(len(drones)) if n != number]
        by_others = np.prod([own for own in others if own is not None], axis=0)
        known = None if missed[number] is None else chosen[number]
        best = _best_pattern(area, number, by_others, known, effort, rng)
        chosen[number] = best
        missed[number] = area.missed_by(number, best)
    if any(free is None for free in chosen):
        return None
    return tuple(free for free in chosen if free is not None)


def _best_pattern(
    area: Area,
    number: int,
    missed_by_others: Floats,
    known: FreePattern | None,
    effort: Effort,
    rng: np.random.Generator,
) -> FreePattern:
    """The best pattern of a drone near a known one, or near the best of some that are drawn."""
    weights = area.particles.weights * missed_by_others

    def left(free: FreePattern) -> float:
        missed = area.missed_by(number, free)
        return 1.0 if missed is None else float(weights @ missed)

    step = FIRST if known is None else LATER
    starts = _drawn(area, number, rng) if known is None else [known]
    tried = sorted((_Tried(left(free), free) for free in starts), key=_left)
    improved = [
        _improved(start, left, step, effort, int(rng.integers(2**31)))
        for start in tried[: effort.starts]
    ]
    return min(improved, key=_left).shape


def _drawn(area: Area, number: int, rng: np.random.Generator) -> list[FreePattern]:
    """Random patterns that the drone can fly.

    Raises:
        CannotFlyError: there are none.
    """
    drawn: list[FreePattern] = []
    for _ in range(TRIES * DRAWN):
        free = FreePattern(
            kind=KINDS[rng.choice(len(KINDS), p=SHARES)],
            moving=bool(rng.integers(2)),
            side=int(rng.choice([-1, 1])),
            parameters=rng.normal(size=6) * SPREAD,
        )
        if area.missed_by(number, free) is not None:
            drawn.append(free)
            if len(drawn) == DRAWN:
                break
    if not drawn:
        raise CannotFlyError(refusal(area, number))
    return drawn


# Both.


def _improved(
    start: _Tried[Tuned], left: Callable[[Tuned], float], step: float, effort: Effort, seed: int
) -> _Tried[Tuned]:
    """The best of a start and of all that a run of CMA-ES from there tries."""
    cmaes: Any = needed("cmaes", "planning needs the package cmaes", "plan")
    search = cmaes.CMA(
        mean=start.shape.parameters, sigma=step, population_size=POPULATION, seed=seed
    )
    best = start
    for _ in range(effort.generations):
        if effort.deadline.is_over:
            break
        shapes = [start.shape._replace(parameters=search.ask()) for _ in range(POPULATION)]
        tried = [_Tried(left(shape), shape) for shape in shapes]
        search.tell([(each.shape.parameters, each.left) for each in tried])
        best = min(best, *tried, key=_left)
    return best


def _left(tried: _Tried[Any]) -> float:
    return tried.left


def refusal(area: Area, number: int | None = None) -> str:
    """Why a drone cannot search, by default the one with the least time, and what would help."""
    if number is None:
        times = [drone.time_around(area.middle) for drone in area.drones]
        number = int(np.argmin(times))
    drone = area.drones[number]
    whose = "" if area.is_uniform else f" of {drone.craft.label}"
    there, back = drone.ways(area.middle)
    both_ways = there + back + 2 * drone.climbing
    if drone.around is not None and (math.isnan(both_ways) or not drone.craft.is_boat):
        return _no_way(area, drone.craft)
    if math.isnan(both_ways):
        blows = float(np.hypot(*drone.wind(np.zeros(1), area.middle[:, None]))[0])
        return (
            f"speed{whose} must exceed the headwind, {blows:.1f} m/s at the height of the flight, "
            f"got {drone.airspeed:g} m/s: use drones of {blows / (1 - SLOWEST):.0f} m/s, fly "
            "lower, or wait until there is less wind"
        )
    return (
        f"endurance{whose} must leave time to search, got {drone.endurance / 60:.0f} minutes "
        f"without the reserve, of which the way to the area and back takes {both_ways / 60:.0f}: "
        "take off nearer or earlier, or use drones that fly longer or faster"
    )


def _no_way(area: Area, craft: Drone) -> str:
    """Why a drone cannot search among areas that it does not enter."""
    if craft.is_boat:
        return (
            f"base of {craft.label} must have a way over the sea to the area, got "
            f"{radioed(craft.base)}"
        )
    return (
        "no_fly must leave a way to the area and back, and room to search there, got "
        f"{area.incident.no_fly!r:.100}: take off elsewhere, or use drones that fly longer"
    )
