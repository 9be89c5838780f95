"""The choice of a search pattern for each drone, by CMA-ES on particles.

N. Hansen and A. Ostermeier, Completely derandomized self-adaptation in evolution strategies,
Evolutionary Computation 9:159 (2001).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from DroneSwarmSearch._internal.arrays import Floats
from DroneSwarmSearch._internal.extras import needed
from DroneSwarmSearch.incident.particles import Particles
from DroneSwarmSearch.incident.patterns import (
    KINDS,
    PARALLEL,
    SLOWEST,
    Drone,
    Pattern,
    ground_speed,
)
from DroneSwarmSearch.incident.report import Report

POPULATION, GENERATIONS = 8, 25  # of a run of CMA-ES

SAMPLES, STARTS = 64, 3
"""Patterns drawn at random for a drone, and how many of the best ones are improved."""

FIRST, LATER = 0.4, 0.15
"""The standard deviations with which CMA-ES begins: from drawn patterns, and from chosen ones."""

SHARES = 0.7, 0.15, 0.15  # how often each kind of pattern is drawn
TRIES = 10  # how many patterns are drawn for each that can be flown, before the incident is refused


class Guess(NamedTuple):
    """A pattern relative to the area, so that it can be tried in another incident.

    Attributes:
        kind: of the pattern, one of `KINDS`.
        moving: whether its points move with the mean drift.
        side: 1 if the drone turns to starboard, -1 if to port.
        parameters: the centre (x, y), the heading, and the logarithms of the legs' length, of the
            width and of the spacing, relative to what is usual: float64, (6,).
    """

    kind: str
    moving: bool
    side: int
    parameters: Floats


class Area:
    """Where persons may be during the flights, and what patterns there would find.

    Args:
        incident: the incident.
        particles: possible persons in it.
    """

    def __init__(self, incident: Report, particles: Particles) -> None:
        self._incident, self._particles = incident, particles
        self.drones = [incident.drone(number) for number in range(incident.drones)]
        self._start = incident.seconds(incident.start)
        half, weights = self.drones[0].endurance / 2, particles.weights
        self._away = particles.mean(self._start + 2 * half) - particles.mean(self._start)
        positions = particles.at(self._start + half)
        self._middle = weights @ positions
        off = positions - self._middle
        self._root = np.linalg.cholesky((weights * off.T) @ off + np.eye(2))
        self._size = np.sqrt(incident.swath * incident.speed * 1.4 * half)

    def pattern(self, guess: Guess) -> Pattern:
        """The pattern of a guess."""
        kind, moving, side, (x, y, heading, length, width, spacing) = guess
        drift = self._away / self.drones[0].endurance * moving
        centre = self._middle + self._root @ [x, y] - self._away / 2 * moving
        heading = heading * np.pi / 2 % (2 * np.pi)
        apart = self._incident.swath * np.exp(np.clip(0.2 * spacing, -1.0, 1.0))
        long = max(self._size * np.exp(np.clip(length / 2, -3.0, 2.0)), self._incident.swath)
        legs = 1
        if kind == PARALLEL:
            across = self._size * np.exp(np.clip(width / 2, -3.0, 2.0)) / apart
            legs = max(round(float(across)), 1)
            along = np.array([np.sin(heading), np.cos(heading)])
            centre = centre - along * long / 2
            centre = centre - (along[::-1] * [1, -1]) * side * (legs - 1) * apart / 2
        return Pattern(kind, centre, float(heading), float(long), float(apart), legs, side, drift)

    def missed(self, drone: Drone, guess: Guess | None) -> Floats | None:
        """The probability that a drone misses each particle; None if it cannot fly the pattern."""
        flight = None if guess is None else drone.fly(self.pattern(guess))
        if flight is None:
            return None
        flight[:, 0] += self._start
        legs = np.stack([flight[1:-1], flight[2:]], axis=1)  # all but the way there
        known = self._incident
        return self._particles.missed(legs, known.swath, known.probability_of_detection)

    def best(
        self, drone: Drone, others: Floats, near: Guess | None, rng: np.random.Generator
    ) -> Guess:
        """The best pattern of a drone, near another one or anywhere, given what others miss."""
        cmaes = needed("cmaes", "planning needs the package cmaes", "plan")
        weights = self._particles.weights * others

        def left(guess: Guess) -> float:
            missed = self.missed(drone, guess)
            return 1.0 if missed is None else float(weights @ missed)

        drawn = [near] if near else self._draw(drone, rng)
        starts = sorted(((left(pattern), n) for n, pattern in enumerate(drawn)))[:STARTS]
        best, chosen = starts[0][0], drawn[starts[0][1]]
        for _, number in starts:
            start = drawn[number]
            search = cmaes.CMA(
                mean=start.parameters,
                sigma=FIRST if near is None else LATER,
                population_size=POPULATION,
                seed=int(rng.integers(2**31)),
            )
            for _ in range(GENERATIONS):
                tried = [start._replace(parameters=search.ask()) for _ in range(POPULATION)]
                values = [*map(left, tried)]
                search.tell([(e.parameters, v) for e, v in zip(tried, values, strict=True)])
                if (lowest := min(values)) < best:
                    best, chosen = lowest, tried[values.index(lowest)]
        return chosen

    def _draw(self, drone: Drone, rng: np.random.Generator) -> list[Guess]:
        """Random patterns that the drone can fly, or a ValueError if there are none."""
        drawn: list[Guess] = []
        for _ in range(TRIES * SAMPLES):
            parameters = rng.normal(size=6) * [1, 1, 1.3, 0.7, 0.7, 0.5]
            kind = KINDS[rng.choice(len(KINDS), p=SHARES)]
            guess = Guess(kind, bool(rng.integers(2)), int(rng.choice([-1, 1])), parameters)
            if drone.fly(self.pattern(guess)) is not None:
                drawn.append(guess)
                if len(drawn) == SAMPLES:
                    break
        if not drawn:
            raise ValueError(self._refusal(drone))
        return drawn

    def _refusal(self, drone: Drone) -> str:
        """Why no drone can search, and what would help."""
        way, zero = (self._middle - drone.base)[:, None], np.zeros(1)
        length, wind = np.hypot(*way), drone.wind(zero, self._middle[:, None])
        unit = way / np.maximum(length, 1e-9)
        speeds = [ground_speed(drone.airspeed, wind, track) for track in (unit, -unit)]
        both_ways = sum(float((length / speed)[0]) for speed in speeds)
        if np.isnan(both_ways):
            blows = float(np.hypot(*wind)[0])
            return (
                f"speed must exceed the headwind, {blows:.1f} m/s at the height of the "
                f"flight, got {drone.airspeed:g} m/s: use drones of {blows / (1 - SLOWEST):.0f} "
                "m/s, fly lower, or wait until there is less wind"
            )
        return (
            f"endurance must leave time to search, got {drone.endurance / 60:.0f} minutes without "
            f"the reserve, of which the way to the area and back takes {both_ways / 60:.0f}: "
            "take off nearer or earlier, or use drones that fly longer or faster"
        )


def choose(
    areas: Sequence[Area], near: Sequence[Guess], report: Callable[[float], object]
) -> list[Guess]:
    """Choose patterns, drone after drone, once on each area.

    Args:
        areas: the area to search, with different particles in each element.
        near: patterns of the first drones to begin with.
        report: is told the share of the work that is done.

    Raises:
        ValueError: no drone can search the area.
    """
    rng, drones = np.random.default_rng(0), areas[0].drones
    chosen: list[Guess | None] = [*near, *[None] * len(drones)][: len(drones)]
    for lap, area in enumerate(areas):
        missed = [area.missed(*pair) for pair in zip(drones, chosen, strict=True)]
        for number, drone in enumerate(drones):
            before, missed[number] = missed[number], None
            others = np.prod([share for share in missed if share is not None], axis=0)
            start = None if before is None else chosen[number]
            chosen[number] = area.best(drone, others, start, rng)
            missed[number] = area.missed(drone, chosen[number])
            report((lap + (number + 1) / len(drones)) / len(areas))
    return [flight for flight in chosen if flight is not None]
