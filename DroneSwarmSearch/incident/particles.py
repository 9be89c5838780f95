"""Particles: possible persons who drift in continuous space, and which of them drones pass."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from datetime import timedelta
from functools import cached_property
from pathlib import Path
from typing import Protocol

import numpy as np

from DroneSwarmSearch._internal.arrays import Flags, Floats, Ints, Singles
from DroneSwarmSearch.geo.flows import Flow
from DroneSwarmSearch.geo.scale import Scale
from DroneSwarmSearch.incident.by_class import ByClass, of_classes
from DroneSwarmSearch.incident.coast import ON_A_LAKE, Coast
from DroneSwarmSearch.incident.flights import legs_of
from DroneSwarmSearch.incident.hypothesis import Hypothesis
from DroneSwarmSearch.incident.incident import Incident
from DroneSwarmSearch.persons import leeway
from DroneSwarmSearch.persons.leeway import DIFFUSIVITY, JIBING
from DroneSwarmSearch.persons.track_files import positions

LONGEST_STEP = 60.0  # of the simulation, in seconds
MOST_STEPS_ADRIFT = 720  # before the first time to keep: beyond half a day, steps are longer

SHORTEST_STEP = 15.0  # between the times that are kept, in seconds
MOST_STEPS = 400  # that are kept

FEWEST_TRACKS = 20

MOST_CANDIDATES = 1000  # positions that are drawn at a time in place of those on land
MOST_IN_VAIN = 100  # times that they are all on land


class Searcher(Protocol):
    """A drone, or a flight that was flown."""

    @property
    def swath(self) -> ByClass: ...

    @property
    def probability_of_detection(self) -> ByClass: ...


@dataclass(frozen=True, eq=False)
class Particles:
    """Where possible persons are at regular times.

    Times are in seconds after the last known position, positions in metres on a plane.

    Attributes:
        begin: the first time.
        step: between two times.
        positions: (east, north), float32, (2, times, n).
        weights: how likely each one is: float64, (n,); they sum to 1.
        begun: when each one begins to drift, in seconds: float64, (n,). Before, nobody can find it.
        hypotheses: the number of the hypothesis of each one: (n,).
        kinds: the number of the object class of each one: (n,).
        classes: the object classes; none of tracks.
        ashore: the share of those who have stranded at the last time.
        found: the share of those whom earlier flights would have found, and who weigh less for it.
        worth: what each earlier flight has added to that share, in their order.
    """

    begin: float
    step: float
    positions: Singles
    weights: Floats
    begun: Floats
    hypotheses: Ints
    kinds: Ints
    classes: tuple[str, ...] = ()
    ashore: float = 0.0
    found: float = 0.0
    worth: tuple[float, ...] = ()

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

    def first(self, n: int) -> Particles:
        """The first n of them, or all."""
        return replace(
            self,
            positions=self.positions[..., :n],
            weights=self.weights[:n] / self.weights[:n].sum(),
            begun=self.begun[:n],
            hypotheses=self.hypotheses[:n],
            kinds=self.kinds[:n],
        )

    # Flights.

    def sweeps(self, legs: Floats, swath: ByClass) -> tuple[Ints, Floats]:
        """The particles that drones sweep: they come abeam of a leg, within half the swath.

        Args:
            legs: time, east and north of the beginnings and of the ends: float64, (n, 2, 3).
            swath: the width of the strip, perhaps by object class.

        Returns:
            The index of a particle and the time in seconds, for each sweep: (m,) each.
        """
        moving = np.any(legs[:, 0, 1:] != legs[:, 1, 1:], axis=1)
        lines = _Legs.of(legs[moving])
        half = self.of_each(swath) / 2

        # First, which ones may be passed, from where they are half-way.
        row = self.rows((lines.begin + lines.end) / 2)
        leg = np.arange(len(lines.length))[:, None]
        east, north = self.positions
        along, across = lines.beside(leg, east[row], north[row])
        drifting = self.fastest * (lines.end - lines.begin) / 2
        reach = (half + drifting[:, None]).astype(np.float32)
        middle = (lines.length / 2).astype(np.float32)[:, None]
        is_near = (np.abs(across) < reach) & (np.abs(along - middle) < middle + reach)
        leg, who = np.nonzero(is_near)

        # Then, where they are when the drone comes abeam of them.
        begin = lines.begin[leg]
        speed = lines.speed[leg]
        when = np.clip(begin + along[leg, who] / speed, begin, lines.end[leg])
        row = self.rows(when)
        along, across = lines.beside(leg, east[row, who], north[row, who])
        is_swept = (np.abs(across) <= half[who]) & (along >= 0) & (along < lines.length[leg])
        is_swept &= when >= self.begun[who]
        return who[is_swept], begin[is_swept] + along[is_swept] / speed[is_swept]

    def missed(self, legs: Floats, searcher: Searcher) -> Floats:
        """The probability that flights miss each particle, if it is where it is: float64, (n,)."""
        swept, _ = self.sweeps(legs, searcher.swath)
        return self.missed_after(swept, searcher.probability_of_detection)

    def missed_after(self, swept: Ints, detection: ByClass) -> Floats:
        """The same, given the particles of `sweeps`."""
        times = np.bincount(swept, minlength=len(self.weights))
        missed: Floats = (1.0 - self.of_each(detection)) ** times.astype(np.float64)
        return missed

    def of_each(self, value: ByClass) -> Floats:
        """A value that may differ by object class, for each particle: float64, (n,)."""
        values: Floats = of_classes(value, self.classes)[self.kinds]
        return values

    def usual_of(self, value: ByClass) -> float:
        """The geometric mean of such a value over all particles."""
        if isinstance(value, float):
            return value
        return math.exp(self.weights @ np.log(self.of_each(value)))

    def mean_of(self, value: ByClass) -> float:
        """The mean of such a value over all particles."""
        if isinstance(value, float):
            return value
        return float(self.weights @ self.of_each(value))


@dataclass(frozen=True, eq=False)
class _Legs:
    """Straight legs: beginnings and ends in seconds, directions, lengths and speeds, each (n,)."""

    begin: Floats
    end: Floats
    east: Singles  # of the beginnings
    north: Singles
    x: Singles  # the direction
    y: Singles
    length: Floats

    @classmethod
    def of(cls, legs: Floats) -> _Legs:
        begin, east, north = legs[:, 0].T
        end, to_east, to_north = legs[:, 1].T
        way = np.array([to_east - east, to_north - north])
        length = np.hypot(*way)
        x, y = (way / length).astype(np.float32)
        return cls(
            begin=begin,
            end=end,
            east=east.astype(np.float32),
            north=north.astype(np.float32),
            x=x,
            y=y,
            length=length,
        )

    @property
    def speed(self) -> Floats:
        """In m/s."""
        return self.length / (self.end - self.begin)

    def beside(self, leg: Ints, east: Singles, north: Singles) -> tuple[Singles, Singles]:
        """How far positions are along and across some legs."""
        right = east - self.east[leg]
        up = north - self.north[leg]
        along = right * self.x[leg] + up * self.y[leg]
        across = up * self.x[leg] - right * self.y[leg]
        return along, across


def simulate(incident: Incident, n: int, seed: int, longer: float = 0.0) -> Particles:
    """Possible persons during all flights, weighted by what earlier ones have missed.

    Args:
        incident: what is known.
        n: how many, or fewer if there are not so many tracks.
        seed: of the random numbers; 0 and 1 take different tracks.
        longer: seconds after the end of the endurance, until which persons also drift.
    """
    starts = [incident.start, *(flight.waypoints[0].time for flight in incident.flown)]
    begin = max(incident.seconds(min(starts)), 0.0)  # before the report, there are no particles
    last = max(each.take_off + timedelta(seconds=each.endurance) for each in incident.craft)
    last = max([last, *(flight.landing for flight in incident.flown)])  # some still fly
    duration = incident.seconds(last) + longer - begin
    step = max(SHORTEST_STEP, duration / MOST_STEPS)
    count = math.ceil(duration / step) + 1
    times = begin + step * np.arange(count, dtype=np.float64)
    if incident.tracks is None:
        drifting = _Drifting(incident, n, seed)
        cloud = drifting.at_times(times, step)
    else:
        cloud = _of_tracks(incident, times, step, n, seed)

    weights = cloud.weights
    worth = []
    for flight in incident.flown:
        legs = legs_of(flight.waypoints, incident.plane, incident.began)
        left = weights * cloud.missed(legs, flight)
        worth.append(float((weights - left).sum()))
        weights = left
    found = math.fsum(worth)
    return replace(cloud, weights=weights / weights.sum(), found=found, worth=tuple(worth))


def _of_tracks(incident: Incident, times: Floats, step: float, n: int, seed: int) -> Particles:
    """Particles from the tracks of an incident, at most n; odd seeds take every other track."""
    begin = float(times[0])
    cells, *_ = positions(
        Path(incident.tracks or ""),
        Scale(1.0, step),
        origin=incident.origin.position,
        cell=(0.0, 0.0),
        start=incident.origin.at(begin).isoformat(),
        steps=len(times) - 1,
        diffusivity=0.0,
        seed=0,
    )
    if cells.shape[1] < FEWEST_TRACKS:
        raise ValueError(
            f"tracks must be at least {FEWEST_TRACKS}, half of which choose the patterns, got "
            f"{cells.shape[1]} in {incident.tracks}"
        )
    metres = cells[:, seed % 2 :: 2] * (1, -1)
    some = metres[:, :n].astype(np.float32)
    count = some.shape[1]
    none = np.zeros(count, np.int64)
    return Particles(
        begin=begin,
        step=step,
        positions=np.ascontiguousarray(some.transpose(2, 0, 1)),
        weights=np.full(count, 1.0 / count),
        begun=np.zeros(count),
        hypotheses=none,
        kinds=none,
    )


class _Drifting:
    """Persons who drift from where and when the hypotheses say.

    The Leeway model of Breivik and Allen (2008), as `leeway` describes it, in each particle's own
    wind: an object's errors, and those of its wind and current, never change. Turbulence
    is a random walk. Who comes to land stays there. A step takes the velocity at its middle, where
    the last step's velocity leads.
    """

    def __init__(self, incident: Incident, n: int, seed: int) -> None:
        self._incident = incident
        self._wind: Flow = incident.wind
        self._current: Flow = incident.current
        self._rng = np.random.default_rng(seed)
        self._n = n
        self._coast = Coast(incident)
        self._hypotheses, self._kinds = _shared_out(incident, n, seed)
        classes = [leeway.class_of(name) for name in incident.object_classes]
        self._downwind = np.array([kind.downwind for kind in classes])[self._kinds].T
        self._crosswind = np.array([(kind.right, kind.left) for kind in classes])
        self._position = np.empty((2, n))
        self._begun = np.empty(n)
        for number in range(len(incident.cases)):
            self._start(number)
        self._wind_off = self._rng.normal(0.0, incident.wind_error, (2, n))
        self._current_off = self._rng.normal(0.0, incident.current_error, (2, n))
        self._members = np.arange(n)
        self._along = self._downwind_errors()
        self._side = np.arange(n) % 2  # 0: right of the wind
        self._across = self._rng.normal(size=n)

    def _start(self, number: int) -> None:
        """Set where, at sea, and when those of a hypothesis begin."""
        case = self._incident.cases[number]
        who = (self._hypotheses == number).nonzero()[0]
        points, begun = self._drawn(case, len(who))
        wrong = self._coast.is_land(points).nonzero()[0]
        in_vain = 0
        while wrong.size:
            others, times = self._drawn(case, MOST_CANDIDATES)
            at_sea = (~self._coast.is_land(others)).nonzero()[0][: len(wrong)]
            in_vain = 0 if at_sea.size else in_vain + 1
            if in_vain == MOST_IN_VAIN:
                raise ValueError(
                    f"what is known must be at sea, at least in part, got {case.place.words}, of "
                    f"which nearly everything is on land; {ON_A_LAKE}"
                )
            done = wrong[: len(at_sea)]
            points[:, done] = others[:, at_sea]
            begun[done] = times[at_sea]
            wrong = wrong[len(done) :]
        self._position[:, who] = points
        self._begun[who] = begun

    def _drawn(self, case: Hypothesis, n: int) -> tuple[Floats, Floats]:
        """Where n persons begin, (2, n), and when, in seconds: (n,)."""
        first, last = map(self._incident.seconds, case.time)
        points, shares = case.place.draw(self._incident.plane, self._rng, n)
        if first == last:
            return points, np.full(n, first)
        if shares is None:
            shares = self._rng.random(n)
        return points, first + shares * (last - first)

    def _downwind_errors(self) -> Floats:
        """The downwind errors, drawn again where an object would drift against the wind."""
        slope, _, sd = self._downwind
        along = self._rng.normal(0.0, sd, self._n)
        wrong = slope + along / 20 < 0
        while np.any(wrong):
            along[wrong] = self._rng.normal(0.0, sd[wrong])
            wrong = slope + along / 20 < 0
        return along

    def _velocity(self, time: float, position: Floats) -> Floats:
        """(east, north) in m/s, (2, n); NaN on land."""
        self._wind.check_within(time, position)
        self._current.check_within(time, position)
        blown = self._wind.velocity(time, position, self._members % self._wind.members)
        blown = blown + self._wind_off
        speed = np.hypot(*blown)
        downwind = blown / np.maximum(speed, 1e-9)
        slope, offset, _ = self._downwind
        down = (slope + self._along / 20) * speed + offset + self._along / 2
        a, b, s = self._crosswind[self._kinds, self._side].T
        right = (a + s * self._across / 20) * speed + b + s * self._across / 2
        to_the_right = downwind[::-1] * [[1], [-1]]
        leeway_velocity: Floats = (down * downwind + right * to_the_right) / 100
        members = self._members % self._current.members
        current = self._current.velocity(time, position, members)
        return leeway_velocity + current + self._current_off

    def at_times(self, times: Floats, step: float) -> Particles:
        """The persons at regular times, in seconds, the first at least 0."""
        n = self._n
        kept = np.empty((2, len(times), n), np.float32)
        longest = max(LONGEST_STEP, times[0] / MOST_STEPS_ADRIFT)
        now = 0.0
        ashore: Flags = np.zeros(n, np.bool_)
        velocity = self._velocity(0.0, self._position)
        for row, time in enumerate(times.tolist()):
            for parts in range(math.ceil((time - now) / longest), 0, -1):
                h = (time - now) / parts
                jibes = 1.0 - (1.0 - JIBING) ** (h / 3600)
                self._side ^= self._rng.random(n) < jibes
                half_way = self._position + h / 2 * np.nan_to_num(velocity)
                velocity = self._velocity(now + h / 2, half_way)
                walk = self._rng.normal(0.0, np.sqrt(2 * DIFFUSIVITY * h), (2, n))
                adrift = np.clip((now + h - self._begun) / h, 0.0, 1.0)
                moved = self._position + adrift * h * velocity + np.sqrt(adrift) * walk
                is_afloat = (adrift > 0.0) & ~ashore
                ashore |= is_afloat & np.isnan(moved[0])
                is_afloat &= ~ashore
                ashore[is_afloat] = self._coast.is_land(moved[:, is_afloat])
                self._position = np.where(is_afloat & ~ashore, moved, self._position)
                now += h
            kept[:, row] = self._position
        return Particles(
            begin=float(times[0]),
            step=step,
            positions=kept,
            weights=np.full(n, 1.0 / n),
            begun=self._begun,
            hypotheses=self._hypotheses,
            kinds=self._kinds,
            classes=self._incident.object_classes,
            ashore=float(ashore.mean()),
        )


def _shared_out(incident: Incident, n: int, seed: int) -> tuple[Ints, Ints]:
    """The hypothesis and the object class of each particle, as many of each as its weight says."""
    classes = incident.object_classes
    cases = [
        (number, classes.index(name), each.weight * weight)
        for number, each in enumerate(incident.cases)
        for name, weight in each.object_class
    ]
    hypotheses, kinds, weights = zip(*cases, strict=True)
    ends = np.cumsum(weights) / np.sum(weights)
    which = ends.searchsorted((np.arange(n) + 0.5) / n)
    np.random.default_rng((seed, len(cases))).shuffle(which)
    return np.array(hypotheses)[which], np.array(kinds)[which]
