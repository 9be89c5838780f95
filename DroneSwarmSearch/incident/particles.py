"""Particles: possible persons who drift in continuous space, and which of them flights pass."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from DroneSwarmSearch._internal.arrays import Floats, Ints, Singles
from DroneSwarmSearch.persons.leeway import DIFFUSIVITY, JIBING, ObjectClass

Flow = Callable[[Any, Floats], Floats]
"""The velocity of wind or water, (east, north) in m/s, (2, 1) or (2, n), at a time in seconds and
positions in metres, (2, n); NaN on land."""

LONGEST_STEP = 60.0  # of the simulation, in seconds
MOST_STEPS = 720  # before the first time to keep: beyond half a day adrift, steps are longer


@dataclass(frozen=True, eq=False)
class Particles:
    """Where possible persons are at regular times.

    Times are in seconds after the last known position, positions in metres on a plane.

    Attributes:
        begin: the first time.
        step: between two times.
        positions: (east, north), float32, (2, times, n).
        weights: how likely each one is: float64, (n,); they sum to 1.
        ashore: the share of those who have stranded at the last time.
        found: the share of those whom earlier flights would have found, and who weigh less for it.
    """

    begin: float
    step: float
    positions: Singles
    weights: Floats
    ashore: float = 0.0
    found: float = 0.0

    @cached_property
    def fastest(self) -> float:
        """The highest speed along an axis, in m/s, over about a minute."""
        stride = max(1, round(LONGEST_STEP / self.step))
        moves = np.abs(np.diff(self.positions[:, ::stride], axis=1))
        return float(moves.max(initial=0.0)) / (stride * self.step)

    def rows(self, times: Floats) -> Ints:
        """The indices of the nearest times."""
        rows = np.rint((times - self.begin) / self.step).astype(np.int64)
        return np.clip(rows, 0, self.positions.shape[1] - 1)

    def at(self, time: float) -> Floats:
        """The positions at a time: float64, (n, 2)."""
        return self.positions[:, self.rows(np.array(time))].T.astype(np.float64)

    def mean(self, time: float) -> Floats:
        """The mean position at a time, (2,)."""
        mean: Floats = self.weights @ self.at(time)
        return mean

    def passes(self, legs: Floats, swath: float) -> tuple[Ints, Floats]:
        """The particles that drones pass, and when: the leg comes abeam of them, within the strip.

        Args:
            legs: time, east and north of the beginnings and of the ends: float64, (n, 2, 3).
            swath: the width of the strip.

        Returns:
            Indices of particles, one for each pass, and times.
        """
        legs = legs[np.any(legs[:, 0, 1:] != legs[:, 1, 1:], axis=1)]
        (begin, *start), (end, *stop) = np.moveaxis(legs, 0, -1)
        way = np.subtract(stop, start)
        length = np.hypot(*way)
        x, y = (way / length).astype(np.float32)
        right_of, up_of = np.array(start, np.float32)
        speed, half = length / (end - begin), swath / 2
        east, north = self.positions

        def beside(which: tuple[Any, ...], leg: Any) -> tuple[Singles, Singles]:
            """How far particles are along and across a leg."""
            right, up = east[which] - right_of[leg], north[which] - up_of[leg]
            return right * x[leg] + up * y[leg], up * x[leg] - right * y[leg]

        # First, which ones may be passed, from where they are half-way; then, where they are when
        # the drone comes abeam of them.
        row, column = self.rows((begin + end) / 2), np.arange(len(length))[:, None]
        along, across = beside((row,), column)
        reach = (half + self.fastest * (end - begin) / 2).astype(np.float32)[:, None]
        middle = (length / 2).astype(np.float32)[:, None]
        leg, who = np.nonzero((np.abs(across) < reach) & (np.abs(along - middle) < middle + reach))
        when = np.clip(begin[leg] + along[leg, who] / speed[leg], begin[leg], end[leg])
        along, across = beside((self.rows(when), who), leg)
        passed = (np.abs(across) <= half) & (along >= 0) & (along < length[leg])
        leg, along, who = leg[passed], along[passed], who[passed]
        return who, begin[leg] + along / speed[leg]

    def missed(self, legs: Floats, swath: float, detection: float) -> Floats:
        """The probability that all passes miss a particle, if it is where it is: float64, (n,)."""
        return self.missed_after(self.passes(legs, swath)[0], detection)

    def missed_after(self, who: Ints, detection: float) -> Floats:
        """The same, given the particles of `passes`."""
        passes = np.bincount(who, minlength=len(self.weights))
        missed: Floats = (1.0 - detection) ** passes.astype(np.float64)
        return missed


def drift(
    kind: ObjectClass,
    wind: Flow,
    current: Flow,
    *,
    begin: float,
    step: float,
    count: int,
    n: int,
    seed: int,
    position_sd: float,
    wind_error: float,
    current_error: float,
) -> Particles:
    """Simulate persons from the last known position on, at time 0 and (0, 0).

    The Leeway model of Breivik and Allen (2008), as `leeway` describes it, in each particle's own
    wind: an object's errors, and those of its wind and current, never change. Turbulence
    is a random walk. Who comes to land stays there. A step takes the velocity at its middle, where
    the last step's velocity leads.

    Args:
        kind: the class of the object.
        wind: at a height of 10 m.
        current: of the water.
        begin: the first time of the positions to keep, in seconds, at least 0.
        step: between these times.
        count: how many there are.
        n: the number of particles.
        seed: of the random numbers.
        position_sd: the standard deviation of the start along each axis, in metres.
        wind_error: the standard deviation of the wind's error along each axis, in m/s.
        current_error: the standard deviation of the current's error along each axis, in m/s.
    """
    rng = np.random.default_rng(seed)
    place = rng.normal(0.0, position_sd, (2, n))
    wind_off = rng.normal(0.0, wind_error, (2, n))
    current_off = rng.normal(0.0, current_error, (2, n))
    slope, offset, sd = kind.downwind
    along = rng.normal(0.0, sd, n)
    while np.any(wrong := slope + along / 20 < 0):
        along[wrong] = rng.normal(0.0, sd, int(wrong.sum()))
    sides = np.array([kind.right, kind.left])
    side, across = np.arange(n) % 2, rng.normal(size=n)

    def velocity(time: float, place: Floats) -> Floats:
        blown = wind(time, place) + wind_off
        speed = np.hypot(*blown)
        downwind = blown / np.maximum(speed, 1e-9)
        a, b, s = sides[side].T
        down = (slope + along / 20) * speed + offset + along / 2
        right = (a + s * across / 20) * speed + b + s * across / 2
        leeway: Floats = (down * downwind + right * (downwind[::-1] * [[1], [-1]])) / 100
        return leeway + current(time, place) + current_off

    positions = np.empty((2, count, n), np.float32)
    longest = max(LONGEST_STEP, begin / MOST_STEPS)
    now, ashore, speed = 0.0, np.zeros(n, np.bool_), velocity(0.0, place)
    for row, time in enumerate((begin + step * np.arange(count)).tolist()):
        for parts in range(int(np.ceil((time - now) / longest)), 0, -1):
            h = (time - now) / parts
            side ^= rng.random(n) < 1.0 - (1.0 - JIBING) ** (h / 3600)
            speed = velocity(now + h / 2, place + h / 2 * np.nan_to_num(speed))
            move = h * speed + rng.normal(0.0, np.sqrt(2 * DIFFUSIVITY * h), (2, n))
            ashore |= np.isnan(move[0])
            place += np.where(ashore, 0.0, move)
            now += h
        positions[:, row] = place
    return Particles(begin, step, positions, np.full(n, 1.0 / n), float(ashore.mean()))
