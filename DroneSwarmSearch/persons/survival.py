"""The probability that a person in cold water is still alive: `survival` of `Person`.

`hayward` estimates the median survival time, and `curve` turns any median into probabilities::

    curve(hayward(10), scale=scale, steps=200, in_water=1800)  # after half an hour at 10 °C

These are rough figures for adults who float in a life jacket and cool down. They leave out the cold
shock of the first minutes, drowning, waves, injuries and insulating suits. Sources differ by
factors. At 5, 10 and 15 °C, half survive 1, 2 and 6 hours according to Golden (clothed men in life
jackets; Transport Canada, Survival in Cold Waters, TP 13822, 2003), and 3.6, 5.7 and 9.0 hours in
the UK National Immersion Incident Survey (without life jackets; Environmental Ergonomics XII, 2007,
page 342); `hayward` returns 2.2, 2.9 and 4.6 hours.
"""

from __future__ import annotations

import math

import numpy as np

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.arrays import Floats
from DroneSwarmSearch._internal.erf import erf
from DroneSwarmSearch.geo.scale import Scale

__all__ = ["curve", "hayward"]


def hayward(temperature: float) -> float:
    """The survival time, in seconds, of an average adult at rest in light clothing and life jacket.

    15 + 7.2 / (0.0785 - 0.0034 T) minutes in water of T °C, the time in which the core of the body
    cools to 30 °C at rates measured in the sea: J. S. Hayward, J. D. Eckerson and M. L. Collis,
    Thermal balance and survival time prediction of man in cold water, Canadian Journal of
    Physiology and Pharmacology 53:21, 1975.

    `temperature` is from -2 to 20; in warmer water, the cold is not what limits survival.

    Raises:
        TypeError: the temperature is not a number.
        ValueError: it is out of its limits.
    """
    return 60.0 * (15.0 + 7.2 / (0.0785 - 0.0034 * checks.real("temperature", temperature, -2, 20)))


def curve(
    median: float, *, scale: Scale, steps: int, in_water: float = 0.0, sigma: float = 0.5
) -> Floats:
    """The probability of being alive after 0 to `steps` completed steps: float64, (steps + 1,).

    The survival time is lognormal, because build, fat, clothing and behaviour each change it by a
    factor. The default `sigma` is a choice, not a fit: 95% of the persons survive for 0.38 to 2.7
    times the median, which covers both other sources. If a person is known to be alive when the
    search begins, divide the curve by its first value.

    Args:
        median: the time that half of such persons survive, in seconds; above 0.
        scale: gives the duration of a step.
        steps: usually the time limit.
        in_water: seconds in the water before the search begins.
        sigma: standard deviation of the logarithm of the survival time; above 0.

    Raises:
        TypeError: an argument is of the wrong type.
        ValueError: an argument is out of its limits.
    """
    if not isinstance(scale, Scale):
        raise TypeError(f"scale must be a Scale, got {scale!r}")
    seconds = np.arange(checks.integer("steps", steps, 0) + 1) * scale.seconds_per_step
    seconds += checks.real("in_water", in_water, 0)
    with np.errstate(divide="ignore"):  # at 0 seconds
        logarithms = np.log(seconds / checks.positive("median", median))
    alive = 0.5 - 0.5 * erf(logarithms / (math.sqrt(2) * checks.positive("sigma", sigma)))
    return np.minimum.accumulate(alive)  # rounding must not raise it
