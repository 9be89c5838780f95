"""The choice of a search pattern for each drone, by CMA-ES on particles.

N. Hansen and A. Ostermeier, Completely derandomized self-adaptation in evolution strategies,
Evolutionary Computation 9:159 (2001).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from DroneSwarmSearch._internal.arrays import Floats
from DroneSwarmSearch._internal.extras import needed
from DroneSwarmSearch.incident.drone import SLOWEST, Drone, drone_of
from DroneSwarmSearch.incident.incident import Incident
from DroneSwarmSearch.incident.particles import Particles
from DroneSwarmSearch.incident.patterns import KINDS, PARALLEL, Pattern

POPULATION = 8  # of a run of CMA-ES
GENERATIONS = 25

SAMPLES = 64  # patterns that are drawn at random for a drone
STARTS = 3  # how many of the best ones are improved

FIRST = 0.4  # the standard deviation with which CMA-ES begins from a drawn pattern
LATER = 0.15  # the same from a chosen one

SHARES = (0.7, 0.15, 0.15)  # how often each kind of pattern is drawn
TRIES = 10  # how many patterns are drawn for each that can be flown, before the incident is refused


class CannotFlyError(ValueError):
    """No drone can fly to the area, search and come back."""


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

    def __init__(self, incident: Incident, particles: Particles) -> None:
        self._incident = incident
        self._particles = particles
        self.drones = [drone_of(incident, number) for number in range(incident.drones)]
        self._start = incident.seconds(incident.start)
        half = self.drones[0].endurance / 2
        weights = particles.weights
        self._away = particles.mean(self._start + 2 * half) - particles.mean(self._start)
        positions = particles.at(self._start + half)
        self._middle = weights @ positions
        off = positions - self._middle
        self._root = np.linalg.cholesky((weights * off.T) @ off + np.eye(2))
        self._size = np.sqrt(incident.swath * incident.speed * 1.4 * half)

    def pattern(self, guess: Guess) -> Pattern:
        """The pattern of a guess."""
        x, y, heading, length, width, spacing = guess.parameters
        drift = self._away / self.drones[0].endurance * guess.moving
        centre = self._middle + self._root @ [x, y] - self._away / 2 * guess.moving
        heading = heading * np.pi / 2 % (2 * np.pi)
        swath = self._incident.swath
        apart = swath * np.exp(np.clip(0.2 * spacing, -1.0, 1.0))
        long = max(self._size * np.exp(np.clip(length / 2, -3.0, 2.0)), swath)
        legs = 1
        start = centre
        if guess.kind == PARALLEL:
            across = self._size * np.exp(np.clip(width / 2, -3.0, 2.0)) / apart
            legs = max(round(float(across)), 1)
            along = np.array([np.sin(heading), np.cos(heading)])
            to_the_side = along[::-1] * [1, -1] * guess.side
            start = centre - along * long / 2
            start = start - to_the_side * (legs - 1) * apart / 2
        return Pattern(
            kind=guess.kind,
            start=start,
            heading=float(heading),
            length=float(long),
            spacing=float(apart),
            legs=legs,
            side=guess.side,
            drift=drift,
        )

    def missed(self, drone: Drone, guess: Guess) -> Floats | None:
        """The probability that a drone misses each particle; None if it cannot fly the pattern."""
        flight = drone.fly(self.pattern(guess))
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
        weights = self._particles.weights * others

        def left(guess: Guess) -> float:
            missed = self.missed(drone, guess)
            return 1.0 if missed is None else float(weights @ missed)

        drawn = [near] if near else self._draw(drone, rng)
        values = [left(guess) for guess in drawn]
        order = sorted(range(len(drawn)), key=values.__getitem__)[:STARTS]
        chosen = drawn[order[0]]
        best = values[order[0]]
        step = FIRST if near is None else LATER
        for number in order:
            guess, value = _improved(drawn[number], left, step, int(rng.integers(2**31)))
            if value < best:
                best = value
                chosen = guess
        return chosen

    def _draw(self, drone: Drone, rng: np.random.Generator) -> list[Guess]:
        """Random patterns that the drone can fly.

        Raises:
            CannotFlyError: there are none.
        """
        drawn: list[Guess] = []
        for _ in range(TRIES * SAMPLES):
            parameters = rng.normal(size=6) * [1, 1, 1.3, 0.7, 0.7, 0.5]
            kind = KINDS[rng.choice(len(KINDS), p=SHARES)]
            moving = bool(rng.integers(2))
            side = int(rng.choice([-1, 1]))
            guess = Guess(kind, moving, side, parameters)
            if drone.fly(self.pattern(guess)) is not None:
                drawn.append(guess)
                if len(drawn) == SAMPLES:
                    break
        if not drawn:
            raise CannotFlyError(self._refusal(drone))
        return drawn

    def _refusal(self, drone: Drone) -> str:
        """Why no drone can search, and what would help."""
        way = (self._middle - drone.base)[:, None]
        length = np.hypot(*way)
        unit = way / np.maximum(length, 1e-9)
        wind = drone.wind(np.zeros(1), self._middle[:, None])
        there = length / drone.ground_speed(wind, unit)
        back = length / drone.ground_speed(wind, -unit)
        both_ways = float((there + back)[0])
        if np.isnan(both_ways):
            blows = float(np.hypot(*wind)[0])
            return (
                f"speed must exceed the headwind, {blows:.1f} m/s at the height of the flight, got "
                f"{drone.airspeed:g} m/s: use drones of {blows / (1 - SLOWEST):.0f} m/s, fly "
                "lower, or wait until there is less wind"
            )
        return (
            f"endurance must leave time to search, got {drone.endurance / 60:.0f} minutes without "
            f"the reserve, of which the way to the area and back takes {both_ways / 60:.0f}: take "
            "off nearer or earlier, or use drones that fly longer or faster"
        )


def _improved(
    start: Guess, left: Callable[[Guess], float], step: float, seed: int
) -> tuple[Guess, float]:
    """The best pattern in a run of CMA-ES from another one, and what is left to find after it."""
    cmaes: Any = needed("cmaes", "planning needs the package cmaes", "plan")
    search = cmaes.CMA(mean=start.parameters, sigma=step, population_size=POPULATION, seed=seed)
    best = np.inf
    chosen = start
    for _ in range(GENERATIONS):
        tried = [start._replace(parameters=search.ask()) for _ in range(POPULATION)]
        values = [left(guess) for guess in tried]
        by_parameters = zip(tried, values, strict=True)
        search.tell([(guess.parameters, value) for guess, value in by_parameters])
        lowest = min(values)
        if lowest < best:
            best = lowest
            chosen = tried[values.index(lowest)]
    return chosen, best


def choose(
    areas: Sequence[Area], near: Sequence[Guess], on_progress: Callable[[float], object]
) -> list[Guess]:
    """Choose patterns, drone after drone, once on each area.

    Args:
        areas: the area to search, with different particles in each element.
        near: patterns of the first drones to begin with.
        on_progress: called with the share of the work that is done.

    Raises:
        CannotFlyError: no drone can search the area.
    """
    rng = np.random.default_rng(0)
    drones = areas[0].drones
    chosen: list[Guess | None] = [None] * len(drones)
    chosen[: len(near)] = near[: len(drones)]
    for lap, area in enumerate(areas):
        missed = [
            None if guess is None else area.missed(drone, guess)
            for drone, guess in zip(drones, chosen, strict=True)
        ]
        for number, drone in enumerate(drones):
            start = None if missed[number] is None else chosen[number]
            others = [missed[n] for n in range(len(drones)) if n != number]
            missed_by_others = np.prod([own for own in others if own is not None], axis=0)
            best = area.best(drone, missed_by_others, start, rng)
            chosen[number] = best
            missed[number] = area.missed(drone, best)
            on_progress((lap + (number + 1) / len(drones)) / len(areas))
    return [guess for guess in chosen if guess is not None]
