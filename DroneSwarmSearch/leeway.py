"""Leeway: persons, rafts and boats that drift with wind and current, in metres and seconds.

Leeway is an object's motion through the water because of the wind. It has a downwind component,
and a crosswind component to the right or to the left of the wind. In a wind of W m/s at a height of
10 m, an object's downwind leeway is (a + e/20) W + b + e/2 in cm/s, where a and b are the slope and
the offset of its class and e is normal with mean 0 and the class's standard deviation s, drawn once
for each object, and again while a + e/20 < 0. The crosswind leeway is likewise, with its own
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
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.arrays import Floats
from DroneSwarmSearch.drift.persons import MAX_DIFFUSION, Drift, Person, warn_of_mass_beyond
from DroneSwarmSearch.drift.scale import Scale

__all__ = [
    "CLASSES",
    "KNOT",
    "ObjectClass",
    "current_towards",
    "person",
    "wind_from",
]

Pair = tuple[float, float]

KNOT = 1852 / 3600
"""One knot in m/s."""

_PARTS = 64
"""Of the time adrift, in which objects may jibe."""

_FEWEST_JIBES, _MOST_JIBES = 0.01, 50.0
"""Expected before the search; fewer are left out, and more change the position no further."""

_FASTEST = 1000.0
"""The highest speed of a wind in m/s."""

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


class _Hypothesis(NamedTuple):
    """The mean drift and its standard deviation, (x, y) in cells per step, and the weight."""

    vector: Pair
    vector_sd: Pair
    weight: float


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
        left: the same for objects that go left; the slope is negative.
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
    path = Path(__file__).with_name("drift") / "leeway_classes.csv"
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


def wind_from(direction: float, speed: float) -> Pair:
    """The vector of a wind that comes from a direction, as winds are reported.

    Args:
        direction: where the wind comes from, in degrees clockwise from north.
        speed: at least 0. Multiply knots by `KNOT` for m/s.

    Returns:
        (east, north): where the wind blows to, in the unit of the speed.

    Raises:
        TypeError: an argument is not a number.
        ValueError: an argument is not finite, or the speed is negative.
    """
    east, north = current_towards(direction, speed)
    return 0.0 - east, 0.0 - north


def current_towards(direction: float, speed: float) -> Pair:
    """The vector of a current that sets towards a direction, as currents are reported.

    Like `wind_from`, but the direction is where the current flows to.
    """
    angle = math.radians(checks.real("direction", direction) % 360)
    length = checks.real("speed", speed, 0)
    return length * math.sin(angle), length * math.cos(angle)


def person(
    object_class: str | ObjectClass,
    *,
    start: Pair,
    position_sd: float = 0.0,
    wind: Pair,
    current: Pair = (0.0, 0.0),
    diffusivity: float = 5.0,
    adrift: float = 0.0,
    jibing: float = 0.04,
    scale: Scale,
    probability_of_detection: float = 1.0,
    hypotheses_per_side: int | None = None,
    grid_size: int | None = None,
    timestep_limit: int | None = None,
) -> Person:
    """A person, raft or boat that drifts with the wind and the current.

    The result has one hypothesis for each side of the wind, or three for each side where the wind
    is oblique to the axes and the errors downwind and crosswind differ much. If the object is
    adrift for 15 minutes or more, another one for each side stands for objects that have jibed.
    In a calm there is no leeway, and a single hypothesis. Wind and current are constant::

        person = leeway.person(
            "PIW-1",
            start=(30, 30),
            position_sd=500,
            wind=leeway.wind_from(240, 20 * leeway.KNOT),
            current=(0.1, 0.2),
            adrift=3600,
            scale=Scale.for_drone(speed=10, swath=130),
        )

    Args:
        object_class: a key of `CLASSES`, or your own `ObjectClass`.
        start: the last known position, a cell (x, y); real numbers, also outside the grid, if
            `position_sd` or `adrift` is positive.
        position_sd: its standard deviation along each axis, in metres.
        wind: at a height of 10 m, in m/s, (east, north): where it blows to; see `wind_from`.
        current: in m/s, (east, north): where it flows to; see `current_towards`.
        diffusivity: of the turbulent sea, in m²/s; usually 1 to 10.
        adrift: seconds from the last known position to the search, rounded to whole steps.
        jibing: how often the object changes the side of the wind, per hour, from 0 to 1. Jibes
            during the search widen the map: the diffusion is larger by `jibing` cells² per cell
            of leeway, which was fitted to tracks of OpenDrift.
        scale: the size of cells and the duration of steps.
        probability_of_detection: of a search of the person's cell, from 0 to 1.
        hypotheses_per_side: from 1 to 9, for objects that have not jibed. One ignores the
            correlation of the leeway along x and y; more represent it. By default, three if it
            exceeds 1/4, and else one.
        grid_size: if given, with `timestep_limit`, there is a warning if more than 1% of the
            forecast lies beyond such a grid within the limit.
        timestep_limit: steps in an episode.

    Raises:
        TypeError: an argument is of the wrong type.
        ValueError: an argument is out of its limits, the class is unknown, or the steps are
            too long or the cells too small for the diffusivity.
    """
    kind = _class_of(object_class)
    if not isinstance(scale, Scale):
        raise TypeError(f"scale must be a Scale, got {scale!r}")
    if hypotheses_per_side is not None:
        checks.integer("hypotheses_per_side", hypotheses_per_side, 1, 9)
    steps = scale.whole_steps(checks.real("adrift", adrift, 0))
    per_hour = checks.real("jibing", jibing, 0, 1)
    position_sd = scale.cells(checks.real("position_sd", position_sd, 0))
    diffusion = _diffusion(diffusivity, scale)
    winds = checks.pair("wind", wind), checks.pair("current", current)

    def drift(start: Pair, start_sd: float | Pair, hypothesis: _Hypothesis, share: float) -> Drift:
        vector, vector_sd, weight = hypothesis
        leeway = math.dist(vector, scale.vector(winds[1]))
        return Drift(
            start,
            start_sd=start_sd,
            vector=vector,
            vector_sd=vector_sd,
            diffusion=min(diffusion + per_hour * leeway, MAX_DIFFUSION),
            adrift=steps,
            weight=weight * share,
        )

    sides = _hypotheses(kind, *winds, scale, 1)
    jibes = min(per_hour * scale.seconds(steps) / 3600, _MOST_JIBES)
    if len(sides) == 1 or jibes < _FEWEST_JIBES:
        jibes = 0.0
    drifts = [
        drift(start, position_sd, each, math.exp(-jibes))
        for each in _hypotheses(kind, *winds, scale, hypotheses_per_side)
    ]
    for side, other in (sides, sides[::-1]) if jibes else ():
        apart = np.linspace(0, steps, _PARTS + 1)[:, None] * np.subtract(other.vector, side.vector)
        shift, shift_sd = _after_jibes(apart, jibes)
        place = np.add(checks.pair("start", start), shift)
        start_sd = np.hypot(position_sd, shift_sd)
        drifts.append(drift(place.tolist(), start_sd.tolist(), side, -math.expm1(-jibes)))
    fastest = max(abs(speed) for drift in drifts for speed in drift.vector)
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


def _class_of(object_class: object) -> ObjectClass:
    if isinstance(object_class, ObjectClass):
        return object_class
    if not isinstance(object_class, str):
        raise TypeError(f"object_class must be a key of leeway.CLASSES, got {object_class!r}")
    if object_class in CLASSES:
        return CLASSES[object_class]
    text = object_class.strip().lower()
    described = [f"{kind.name}, {kind.description}" for kind in CLASSES.values()]
    near = [each for each in described if text and text in each.lower()]
    raise ValueError(
        f"object_class must be a key of leeway.CLASSES, got {object_class!r}; "
        + (f"the nearest are {'; '.join(near)}" if near else f"the keys are {', '.join(CLASSES)}")
    )


def _diffusion(diffusivity: object, scale: Scale) -> float:
    """A diffusivity in m²/s as a diffusion that a person on the grid can have."""
    number = checks.real("diffusivity", diffusivity, 0)
    diffusion = scale.diffusion(number)
    if diffusion > MAX_DIFFUSION:
        ratio = diffusion / MAX_DIFFUSION
        # One percent is more than the figures in the message can be off by rounding.
        longest = 0.99 * scale.seconds_per_step / ratio
        smallest = 1.01 * scale.metres_per_cell * math.sqrt(ratio)
        raise ValueError(
            f"diffusivity must be at most {number / ratio:.3g} m²/s with {scale}, got "
            f"{diffusivity!r}; take steps of at most {longest:.3g} s, or cells of at least "
            f"{smallest:.3g} m"
        )
    return diffusion


def _after_jibes(apart: Floats, jibes: float) -> tuple[Floats, Floats]:
    """The displacement of objects that have jibed, from one that is always on their last side.

    Jibes are a Poisson process. So the object, b expected jibes before the end, is on the other
    side with the probability (1 - exp(-2 b))/2, and if it is, it also was g expected jibes
    earlier with (1 + exp(-2 g))/2.

    Args:
        apart: how far an object that is always on the other side is from one that is always on
            this one, at regular times from the start to the end: shape (n + 1, 2).
        jibes: the expected number of jibes within these times.

    Returns:
        The mean and the standard deviation along each axis, given that there is a jibe.
    """
    parts = np.diff(apart, axis=0)
    before_end = np.arange(len(parts) - 0.5, 0, -1) * (jibes / len(parts))
    there = np.expm1(-2 * before_end) / (2 * np.expm1(-jibes))
    still = (1 + np.exp(-2 * np.abs(before_end[:, None] - before_end))) / 2
    mean = there @ parts
    squares = np.einsum("na,nm,ma->a", parts, still * np.minimum(there[:, None], there), parts)
    return mean, np.sqrt(np.maximum(squares - mean**2, 0.0))


def _hypotheses(
    kind: ObjectClass, wind: Pair, current: Pair, scale: Scale, count: int | None
) -> list[_Hypothesis]:
    """The hypotheses about objects that have not jibed; those on the right come first."""
    speed = checks.real("the speed of wind", math.hypot(*wind), 0, _FASTEST)
    if speed == 0.0:
        return [_Hypothesis(scale.vector(current), (0.0, 0.0), 1.0)]
    speeds = kind.speeds(speed)
    east, north = wind[0] / speed, wind[1] / speed
    found = []
    for cross, cross_sd in ((speeds.right, speeds.right_sd), (speeds.left, speeds.left_sd)):
        # Downwind is (east, north), and to the right of it is (north, -east).
        mean_east = current[0] + speeds.downwind * east + cross * north
        mean_north = current[1] + speeds.downwind * north - cross * east
        along, across = speeds.downwind_sd**2, cross_sd**2
        variances = along * east**2 + across * north**2, along * north**2 + across * east**2
        covariance = (along - across) * east * north
        for shift, deviation, weight in _spread(*variances, covariance, count):
            velocity = mean_east + shift[0], mean_north + shift[1]
            per_metre = scale.seconds_per_step / scale.metres_per_cell
            per_step = deviation[0] * per_metre, deviation[1] * per_metre
            found.append(_Hypothesis(scale.vector(velocity), per_step, weight / 2))
    return found


def _spread(
    east: float, north: float, both: float, count: int | None
) -> list[tuple[Pair, Pair, float]]:
    """A normal velocity as a mixture of `count` normal ones with independent components.

    The correlated part of the covariance is a single vector. The means lie along it with binomial
    weights, so that mean and covariance of the mixture are exact, and the components overlap.
    Returned is each one's shift, standard deviations, and weight.
    """
    sd = math.sqrt(east), math.sqrt(north)
    correlation = both / (sd[0] * sd[1]) if both else 0.0
    if count is None:
        count = 3 if abs(correlation) > _NEGLIGIBLE_CORRELATION else 1
    if count == 1 or not correlation:
        return [((0.0, 0.0), sd, 1.0)]
    along = math.sqrt(abs(correlation))
    alone = math.sqrt(max(1.0 - abs(correlation), 0.0))
    unit = along * sd[0], math.copysign(along, correlation) * sd[1]
    mixture = []
    for place in range(count):
        node = (2 * place - (count - 1)) / math.sqrt(count - 1)
        weight = math.comb(count - 1, place) / 2 ** (count - 1)
        shift = node * unit[0], node * unit[1]
        mixture.append((shift, (alone * sd[0], alone * sd[1]), weight))
    return mixture


def _truncated_normal(alpha: float) -> Pair:
    """The mean and the standard deviation of a standard normal number that is at least alpha."""
    # Limited, so that squares stay finite.
    alpha = max(alpha, -_UNTRUNCATED)
    tail = 0.5 * math.erfc(alpha / math.sqrt(2))
    if tail == 0.0:  # far in the tail, where the distribution is a step at alpha
        return alpha, 0.0
    ratio = math.exp(-0.5 * alpha**2) / math.sqrt(2 * math.pi) / tail  # the inverse Mills ratio
    return ratio, math.sqrt(max(1 + alpha * ratio - ratio**2, 0.0))
