"""Leeway: persons, rafts and boats that drift with wind and current, in metres and seconds.

Leeway is an object's motion through the water because of the wind. It has a downwind component,
and a crosswind component to the right or to the left of the wind. In a wind of W m/s at a height of
10 m, an object's downwind leeway is (a + e/20) W + b + e/2 in cm/s, where a and b are the slope and
the offset of its class and e is normal with mean 0 and the class's standard deviation s, drawn once
for each object, and again while a + e/20 < 0. The crosswind leeway has the same form, with its own
coefficients and its own e. Half of the objects go to the right of the wind and half to the left.

Now and then, an object changes to the other side, which is called jibing: some 4% per hour.

Source of the model: Breivik and Allen, "An operational search and rescue model for the Norwegian
Sea and the North Sea", Journal of Marine Systems 69 (2008); of the rate of jibing: Allen, "Leeway
Divergence", USCG CG-D-05-05 (2005), also the default of OpenDrift. `CLASSES` names the source of
the coefficients.
"""

from __future__ import annotations

import csv
import math
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from statistics import NormalDist
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.arrays import Floats, Pair
from DroneSwarmSearch.geo.scale import Scale
from DroneSwarmSearch.persons.hypotheses import MAX_DIFFUSION, Drift, displaced
from DroneSwarmSearch.persons.person import Person, warn_of_mass_beyond

__all__ = ["CLASSES", "ObjectClass", "person", "persons"]

DIFFUSIVITY = 5.0  # of the turbulent sea, in m²/s
JIBING = 0.04  # the probability that an object changes sides in an hour

_PARTS = 32  # of the time adrift, in which objects may jibe

_FEWEST_JIBES = 0.01
_MOST_JIBES = 50.0
"""Expected before the search; fewer are left out, and more change the position no further."""

_FASTEST = 1000.0  # the highest speed of a wind in m/s

_UNTRUNCATED = 40.0
"""Standard deviations below the mean at which truncation has no effect in floats."""

_NEGLIGIBLE_CORRELATION = 0.25
"""With more, a plan on a map without the correlation finds up to four points less."""

SOURCE = (
    "A. Allen, U.S. Coast Guard, list of 2010-11-15, updated by O. Breivik on 2011-08-25; from "
    "Allen and Plourde, Review of Leeway, USCG CG-D-08-99 (1999), and Allen, Leeway Divergence, "
    "USCG CG-D-05-05 (2005)"
)


class Coefficients(NamedTuple):
    """See `ObjectClass`."""

    slope: float
    offset: float
    sd: float


class LeewaySpeeds(NamedTuple):
    """The means and standard deviations of the leeway in m/s, see `ObjectClass.speeds`."""

    downwind: float
    downwind_sd: float
    right: float
    right_sd: float
    left: float
    left_sd: float


@dataclass(frozen=True)
class ObjectClass:
    """A kind of object and its leeway.

    The coefficients of each component are a named tuple: `slope`, in percent of the wind speed at
    10 m; `offset`, in cm/s; and `sd`, the standard deviation in cm/s.

    Attributes:
        name: the key in `CLASSES`.
        description: what it is.
        downwind: coefficients downwind.
        right: coefficients crosswind, positive to the right, for objects that go right.
        left: coefficients crosswind for objects that go left; the slope is negative.
        source: where the coefficients come from.

    Raises:
        TypeError: a coefficient is not a number.
        ValueError: a coefficient is out of its limits, or there are not three.
    """

    name: str
    description: str
    downwind: Coefficients
    right: Coefficients
    left: Coefficients
    source: str = SOURCE

    def __post_init__(self) -> None:
        for name in ("downwind", "right", "left"):
            what = "three numbers: slope (%), offset (cm/s), standard deviation (cm/s)"
            values = checks.items(name, getattr(self, name), what)
            if len(values) != 3:
                raise ValueError(f"{name} must be {what}, got {values!r}")
            slope, offset = (checks.real(f"{name}[{n}]", values[n]) for n in range(2))
            sd = checks.real(f"{name}[2]", values[2], 0)
            object.__setattr__(self, name, Coefficients(slope, offset, sd))

    def speeds(self, wind_speed: float) -> LeewaySpeeds:
        """The mean and the standard deviation of the leeway in a wind.

        With k = W/20 + 1/2, alpha = -20 a/s and h = phi(alpha) / (1 - Phi(alpha)), the downwind
        mean is (a W + b + k s h)/100 m/s and its standard deviation is
        k s sqrt(1 + alpha h - h²)/100: a normal distribution truncated at a + e/20 = 0.

        Args:
            wind_speed: W, at a height of 10 m, in m/s; from 0 to 1000.

        Returns:
            A named tuple of means and standard deviations in m/s: `downwind`, `downwind_sd`,
            `right`, `right_sd`, `left`, `left_sd`; crosswind speeds are positive to the right.
        """
        wind = checks.real("wind_speed", wind_speed, 0, _FASTEST)
        k = wind / 20 + 0.5
        slope, offset, sd = self.downwind
        # The mean and the standard deviation of e, in units of s.
        mean, share = _truncated_normal(-20 * slope / sd) if sd else (0.0, 0.0)
        downwind = (slope * wind + offset + k * sd * mean) / 100, k * sd * share / 100
        right, left = (
            ((side.slope * wind + side.offset) / 100, k * side.sd / 100)
            for side in (self.right, self.left)
        )
        return LeewaySpeeds(*downwind, *right, *left)


def _load() -> dict[str, ObjectClass]:
    path = Path(__file__).with_name("leeway_classes.csv")
    lines = path.read_text("utf-8").splitlines()
    classes = {}
    for row in csv.DictReader(line for line in lines if not line.startswith("#")):
        downwind, right, left = (
            Coefficients(*(float(row[f"{part}_{name}"]) for name in Coefficients._fields))
            for part in ("downwind", "right", "left")
        )
        classes[row["name"]] = ObjectClass(row["name"], row["description"], downwind, right, left)
    return classes


CLASSES: Mapping[str, ObjectClass] = MappingProxyType(_load())
"""The object classes by name, such as ``"PIW-1"``, a person in the water in an unknown state."""


def person(
    object_class: str | ObjectClass,
    *,
    start: Pair,
    position_sd: float = 0.0,
    wind: Pair | Mapping[float, Pair],
    current: Pair | Mapping[float, Pair] = (0.0, 0.0),
    diffusivity: float = DIFFUSIVITY,
    adrift: float = 0.0,
    jibing: float = JIBING,
    scale: Scale,
    probability_of_detection: float = 1.0,
    grid_size: int | None = None,
    timestep_limit: int | None = None,
) -> Person:
    """A person, raft or boat that drifts with the wind and the current.

    The result has one hypothesis for each side of the wind, or three for each side where the wind
    is oblique to the axes and the errors downwind and crosswind differ much. If the object is
    adrift for 15 minutes or more, another one for each side stands for objects that have jibed.
    In a calm there is no leeway, and a single hypothesis. Wind and current are constant, or vary
    in time::

        person = leeway.person(
            "PIW-1",
            start=(30, 30),
            position_sd=500,
            wind=geo.wind_from(240, 20 * geo.KNOT),
            current={0: (0.1, 0.2), 3 * 3600: (-0.1, -0.2)},
            adrift=3600,
            scale=Scale.for_drone(speed=10, swath=130),
        )

    Args:
        object_class: a key of `CLASSES`, or your own `ObjectClass`.
        start: the last known position, a cell (x, y); real numbers, also outside the grid, if
            `position_sd` or `adrift` is positive.
        position_sd: its standard deviation along each axis, in metres.
        wind: at a height of 10 m, in m/s, (east, north): where it blows to; see `geo.wind_from`.
            Or a mapping of seconds from the last known position to winds, linear in between, and
            constant before the first and after the last one.
        current: in m/s, (east, north): where it flows to; see `geo.current_towards`. Or a mapping.
        diffusivity: of the turbulent sea, in m²/s; usually 1 to 10.
        adrift: seconds from the last known position to the search, rounded to whole steps.
        jibing: how often the object changes the side of the wind, per hour, from 0 to 1. Jibes
            during the search widen the map: the diffusion is larger by `jibing` cells² per cell
            of leeway, which was fitted to tracks of OpenDrift.
        scale: the size of cells and the duration of steps.
        probability_of_detection: of a search of the person's cell, from 0 to 1.
        grid_size: if given, with `timestep_limit`, there is a warning if more than 1% of the
            forecast lies beyond such a grid within the limit.
        timestep_limit: steps in an episode.

    Raises:
        TypeError: an argument is of the wrong type.
        ValueError: an argument is out of its limits, the class is unknown, or the steps are
            too long or the cells too small for the diffusivity.
    """
    kind = class_of(object_class)
    per_hour = checks.real("jibing", jibing, 0, 1)
    known = _known(start, position_sd, diffusivity, adrift, scale)
    winds, currents = _in_each_step(scale, wind=wind, current=current)
    hypotheses = partial(_hypotheses, kind, winds, currents, scale, known, per_hour)
    jibes = min(per_hour * scale.seconds(known.adrift) / 3600, _MOST_JIBES)
    if jibes < _FEWEST_JIBES or not winds.any():
        jibes = 0.0
    drifts = hypotheses(share=math.exp(-jibes), split=True)
    if jibes:
        others = hypotheses(share=-math.expm1(-jibes), split=False)
        drifts += _jibed(others, known, jibes)
    fastest = max(np.abs(np.asarray(drift.vector)).max() for drift in drifts)
    if fastest > 1.0:
        warnings.warn(
            f"the mean drift is {fastest:.3g} cells per step along an axis, and persons move at "
            "most one: take shorter steps or larger cells",
            stacklevel=2,
        )
    result = Person(tuple(drifts), probability_of_detection)
    if (grid_size is None) != (timestep_limit is None):
        raise ValueError(
            f"grid_size and timestep_limit must be given together, got {grid_size!r} and "
            f"{timestep_limit!r}"
        )
    if grid_size is not None and timestep_limit is not None:
        warn_of_mass_beyond([result], grid_size, timestep_limit, stacklevel=2)
    return result


def persons(
    object_classes: Sequence[str | ObjectClass],
    *,
    start: Pair,
    position_sd: float = 0.0,
    wind: Pair | Mapping[float, Pair],
    wind_sd: float = 0.0,
    current: Pair | Mapping[float, Pair] = (0.0, 0.0),
    current_sd: float = 0.0,
    diffusivity: float = DIFFUSIVITY,
    adrift: float = 0.0,
    jibing: float = JIBING,
    scale: Scale,
    probability_of_detection: float = 1.0,
    hypotheses: int = 16,
) -> list[Person]:
    """Persons, rafts and boats of one wreck, in one sea whose wind and current are uncertain.

    Each hypothesis is a wind and a current, the same for all, with equal weights: hypothesis k of
    each person is what they do with that object, for `Scenario.shared_drift`::

        group = leeway.persons(
            ["PIW-1", "PIW-1", "LIFE-RAFT-NB-1"],
            start=(30, 30),
            wind=(8, 0),
            wind_sd=2.5,
            current=(0.2, 0.1),
            current_sd=0.2,
            adrift=3600,
            scale=scale,
        )
        scenario = Scenario(60, 4, persons=group, shared_drift=True, bayesian_update=True)

    The side of the wind to which an object drifts is its own, so it is no part of the hypothesis:
    the drift of each is normal, with the mean and the variances of both sides together.

    Args:
        object_classes: one for each person, as for `person`.
        start: the last known position of all, as for `person`.
        position_sd: as for `person`.
        wind: as for `person`.
        wind_sd: the standard deviation of the wind's error along each axis, in m/s; an error stays
            the same for the whole search.
        current: as for `person`.
        current_sd: the same for the current.
        diffusivity: as for `person`.
        adrift: as for `person`.
        jibing: as for `person`; only the map is wider by it.
        scale: as for `person`.
        probability_of_detection: of a search of the cell of any of them, from 0 to 1.
        hypotheses: how many winds and currents; at least 2. They are points of a quasi-random
            sequence (M. Roberts, The unreasonable effectiveness of quasirandom sequences, 2018),
            shifted and stretched to the right mean and covariance. Without errors there is one.

    Raises:
        TypeError: an argument is of the wrong type.
        ValueError: an argument is out of its limits, see `person`.
    """
    what = "a sequence of object classes, one for each person"
    kinds = [class_of(kind) for kind in checks.items("object_classes", object_classes, what)]
    if not kinds:
        raise ValueError(f"object_classes must be {what}, got {object_classes!r}")
    per_hour = checks.real("jibing", jibing, 0, 1)
    in_wind = checks.real("wind_sd", wind_sd, 0, _FASTEST)
    in_current = checks.real("current_sd", current_sd, 0, _FASTEST)
    deviations = np.array([in_wind, in_wind, in_current, in_current])  # to the east and north
    count = checks.integer("hypotheses", hypotheses, 2)
    known = _known(start, position_sd, diffusivity, adrift, scale)
    winds, currents = _in_each_step(scale, wind=wind, current=current)
    errors = np.zeros((1, 4))
    if deviations.any():
        errors = _normal_points(count) * deviations
    group = []
    for kind in kinds:
        drifts = []
        for error in errors:
            both = _hypotheses(
                kind,
                winds + error[:2],
                currents + error[2:],
                scale,
                known,
                per_hour,
                share=1.0,
                split=False,
            )
            drifts.append(replace(_both_sides(both), weight=1.0 / len(errors)))
        group.append(Person(tuple(drifts), probability_of_detection))
    return group


def _normal_points(count: int) -> Floats:
    """Points of four dimensions with mean 0 and covariance 1, like those of a normal: (count, 4).

    With few points, only the mean and the variances are exact.
    """
    dimensions = 4
    root = 1.0  # the solution of x^5 = x + 1
    for _ in range(64):
        root = (1.0 + root) ** (1.0 / (dimensions + 1))
    steps = root ** -np.arange(1.0, dimensions + 1.0)
    uniform = (0.5 + np.outer(np.arange(1, count + 1), steps)) % 1.0
    normal = NormalDist()
    points = np.array([[normal.inv_cdf(number) for number in row] for row in uniform.tolist()])
    points -= points.mean(axis=0)
    if count > 2 * dimensions:
        covariance = points.T @ points / count
        points = points @ np.linalg.inv(np.linalg.cholesky(covariance)).T
    else:
        points /= points.std(axis=0)
    shaped: Floats = points
    return shaped


def _both_sides(sides: list[Drift]) -> Drift:
    """One drift with the mean and the variances of the displacements of equally likely ones."""
    vectors: Any = [side.vector for side in sides]
    deviations: Any = [side.vector_sd for side in sides]
    paths = np.array([np.cumsum(np.atleast_2d(vector), axis=0) for vector in vectors])
    steps = paths.shape[1:]
    each = [np.broadcast_to(np.atleast_2d(deviation), steps) for deviation in deviations]
    spreads = np.cumsum(each, axis=1)
    mean = paths.mean(axis=0)
    variance = (spreads**2 + (paths - mean) ** 2).mean(axis=0)
    spread = np.maximum.accumulate(np.sqrt(variance), axis=0)
    diffusion = float(np.mean([side.diffusion for side in sides]))
    return replace(
        sides[0],
        vector=np.diff(mean, axis=0, prepend=0.0),
        vector_sd=np.diff(spread, axis=0, prepend=0.0),
        diffusion=diffusion,
    )


def class_of(object_class: object) -> ObjectClass:
    """An object class by its key, or one of your own; an error names the nearest keys."""
    if isinstance(object_class, ObjectClass):
        return object_class
    if not isinstance(object_class, str):
        raise TypeError(f"object_class must be a key of leeway.CLASSES, got {object_class!r}")
    if object_class in CLASSES:
        return CLASSES[object_class]
    text = object_class.strip().lower()
    described = [f"{kind.name}, {kind.description}" for kind in CLASSES.values()]
    near = [line for line in described if text and text in line.lower()]
    raise ValueError(
        f"object_class must be a key of leeway.CLASSES, got {object_class!r}; "
        + (f"the nearest are {'; '.join(near)}" if near else f"the keys are {', '.join(CLASSES)}")
    )


def _known(
    start: Pair, position_sd: float, diffusivity: float, adrift: float, scale: object
) -> Drift:
    """What is known of where an object is, before it drifts with wind and current."""
    if not isinstance(scale, Scale):
        raise TypeError(f"scale must be a Scale, got {scale!r}")
    return Drift(
        start,
        start_sd=scale.cells(checks.real("position_sd", position_sd, 0)),
        diffusion=_diffusion(diffusivity, scale),
        adrift=scale.whole_steps(checks.real("adrift", adrift, 0)),
    )


def _diffusion(diffusivity: object, scale: Scale) -> float:
    """A diffusivity in m²/s as a diffusion that a person on the grid can have."""
    number = checks.real("diffusivity", diffusivity, 0)
    diffusion = scale.diffusion(number)
    if diffusion > MAX_DIFFUSION:
        raise ValueError(
            f"diffusivity must be at most {number * MAX_DIFFUSION / diffusion:.3g} m²/s with "
            f"{scale}, got {diffusivity!r}: take shorter steps or larger cells"
        )
    return diffusion


def _in_each_step(scale: Scale, **series: Any) -> list[Floats]:
    """The wind and the current in the middle of each step, (T, 2); (1, 2) for a constant one."""
    given = []
    for name, value in series.items():
        points = value if isinstance(value, Mapping) and value else {0.0: value}
        what = f"a time of {name}, in seconds from the last known position,"
        times = sorted(checks.real(what, time, -1e7, 1e7) for time in points)  # four months
        count = None if len(times) > 1 else 1
        given.append((count, times, np.array([checks.pair(name, points[time]) for time in times])))
    last = max(scale.whole_steps(times[-1]) for _, times, _ in given)
    middles = scale.seconds_per_step * (np.arange(max(last, 0) + 1) + 0.5)
    return [
        np.stack([np.interp(middles[:count], times, column) for column in points.T], axis=-1)
        for count, times, points in given
    ]


def _jibed(sides: list[Drift], known: Drift, jibes: float) -> list[Drift]:
    """Each side of the wind for objects that have jibed and were on the other one before."""
    times = np.linspace(0, known.adrift, _PARTS + 1)[:, None]
    paths = [displaced(np.asarray(side.vector), times) for side in sides]
    drifts = []
    for side, path, other in zip(sides, paths, paths[::-1], strict=True):
        shift, shift_sd = _after_jibes(other - path, jibes)
        start = np.add(known.start, shift)
        start_sd = np.hypot(known.start_sd, shift_sd)
        drifts.append(replace(side, start=tuple(start), start_sd=tuple(start_sd)))
    return drifts


def _after_jibes(apart: Floats, jibes: float) -> tuple[Floats, Floats]:
    """The mean and the standard deviation of the shift of objects that have jibed, (x, y).

    The shift is from where an object is that was always on their last side. Jibes are a Poisson
    process: b expected jibes before the end, the object is on the other side with the probability
    (1 - exp(-2 b))/2, and if so, it also was g expected jibes earlier with (1 + exp(-2 g))/2.

    Args:
        apart: how far an object that is always on the other side is from one that is always on
            this one, at regular times from the start to the end: shape (n + 1, 2).
        jibes: how many are expected; there is at least one.
    """
    parts = np.diff(apart, axis=0)
    before_end = np.arange(len(parts) - 0.5, 0, -1) * (jibes / len(parts))
    there = np.expm1(-2 * before_end) / (2 * np.expm1(-jibes))
    still = (1 + np.exp(-2 * np.abs(before_end[:, None] - before_end))) / 2
    mean = there @ parts
    squares = np.einsum("na,nm,ma->a", parts, still * np.minimum(there[:, None], there), parts)
    return mean, np.sqrt(np.maximum(squares - mean**2, 0.0))


def _hypotheses(
    kind: ObjectClass,
    winds: Floats,
    currents: Floats,
    scale: Scale,
    known: Drift,
    widening: float,
    share: float,
    split: bool,
) -> list[Drift]:
    """The hypotheses about objects on either side of the wind, the right one first.

    `widening` is the diffusion, in cells² per cell of leeway, that stands for jibes during the
    search and for places within cells. `share` is the sum of the weights; with `split`, there may
    be three hypotheses on each side.
    """
    lengths = np.hypot(*winds.T)
    checks.real("the speed of wind", float(lengths.max()), 0, _FASTEST)
    grid = scale.seconds_per_step / scale.metres_per_cell * np.array([1.0, -1.0])
    if not lengths.any():
        return [replace(known, vector=currents * grid, weight=share)]
    downwind = winds / np.where(lengths, lengths, 1.0)[:, None]
    rightward = downwind[:, ::-1] * (1, -1)  # (east, north) turned to (north, -east)
    speeds = np.array([kind.speeds(speed) if speed else (0.0,) * 6 for speed in lengths.tolist()])
    along, along_sd, *sides = speeds.T[..., None]
    found = []
    for across, across_sd in (sides[:2], sides[2:]):
        mean = currents + along * downwind + across * rightward
        spread = widening * float(np.hypot(*((mean - currents) * grid).T).mean())
        diffusion = min(known.diffusion + spread, MAX_DIFFUSION)
        # An object's two errors are its own for life: their displacements are vectors.
        errors = np.cumsum([along_sd * downwind, across_sd * rightward], axis=1)
        for shift, deviation, weight in _spread(errors, split):
            vector = (mean + np.diff(shift, axis=0, prepend=0.0)) * grid
            vector_sd = np.diff(deviation, axis=0, prepend=0.0) * np.abs(grid)
            varying = {"vector": vector, "vector_sd": vector_sd, "diffusion": diffusion}
            found.append(replace(known, **varying, weight=weight / 2 * share))
    return found


def _spread(errors: Floats, split: bool) -> list[tuple[Floats, Floats, float]]:
    """A normal displacement as a mixture of normal ones with independent components.

    The correlated part of the covariance is a single vector. The means of three lie along it with
    binomial weights, so that mean and covariance of the mixture are exact, and the components
    overlap. Without `split`, or if there is little correlation, there is only one component.
    Returned is each one's shift and standard deviations after each step, (T, 2), and weight.

    `errors` are the displacements after each step by one standard deviation of either error,
    (2, T, 2).
    """
    sd = np.hypot(*errors)
    both = errors.prod(axis=2).sum(axis=0)
    squares = sd.prod(axis=1)
    correlation = both / np.where(both, squares, 1.0)
    if not split or np.abs(correlation).max() <= _NEGLIGIBLE_CORRELATION:
        return [(0.0 * sd, sd, 1.0)]
    alone = np.sqrt(np.maximum(1.0 - np.abs(correlation), 0.0))[:, None] * sd
    shift = np.sqrt(2 * np.abs(correlation))[:, None] * sd
    shift[:, 1] *= np.sign(correlation)
    return [(-shift, alone, 0.25), (0.0 * sd, alone, 0.5), (shift, alone, 0.25)]


def _truncated_normal(alpha: float) -> Pair:
    """The mean and the standard deviation of a standard normal number that is at least alpha."""
    # Limited, so that squares stay finite.
    alpha = max(alpha, -_UNTRUNCATED)
    tail = 0.5 * math.erfc(alpha / math.sqrt(2))
    if tail == 0.0:  # far in the tail, where the distribution is a step at alpha
        return alpha, 0.0
    ratio = math.exp(-0.5 * alpha**2) / math.sqrt(2 * math.pi) / tail  # the inverse Mills ratio
    return ratio, math.sqrt(max(1 + alpha * ratio - ratio**2, 0.0))
