"""Quantities, directions and positions as people type them: "25 kn", "1h30", "NW", "54-10.8N"."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.arrays import Pair

KNOT = 1852 / 3600
"""One knot in m/s."""

Units = Mapping[str, float]

SPEED: Units = {
    **dict.fromkeys(("kn", "kt", "kts", "knot", "knots"), KNOT),
    **{"m/s": 1.0, "mps": 1.0, "km/h": 1 / 3.6, "kmh": 1 / 3.6, "mph": 0.44704},
}
LENGTH: Units = {"m": 1.0, "km": 1000.0, "nm": 1852.0, "nmi": 1852.0, "ft": 0.3048}
ANGLE: Units = dict.fromkeys(("", "°", "deg", "degrees"), 1.0)
TIME: Units = {
    **dict.fromkeys(("h", "hr", "hrs", "hour", "hours"), 3600.0),
    **dict.fromkeys(("min", "mins", "minute", "minutes"), 60.0),
    **dict.fromkeys(("s", "sec", "secs", "second", "seconds"), 1.0),
}

PROBABLE = math.sqrt(2 * math.log(2))
"""The radius of the circle that holds half of a circular normal distribution, the *probable error*,
in standard deviations along an axis."""

WITHIN_95 = math.sqrt(-2 * math.log(0.05))
"""The radius of the circle that holds 95% of it."""

ERRORS = {
    "probable": {"across": PROBABLE, "along": 0.67449},
    "95%": {"across": WITHIN_95, "along": 1.95996},
}
"""What errors are called, and how many standard deviations they are: of positions in the plane,
and of a number, such as a distance."""

POINTS = [
    "N",
    "NNE",
    "NE",
    "ENE",
    "E",
    "ESE",
    "SE",
    "SSE",
    "S",
    "SSW",
    "SW",
    "WSW",
    "W",
    "WNW",
    "NW",
    "NNW",
]


def named(name: str, read: Callable[..., Any], *given: object) -> Any:
    """What a text means; an error begins with the name of the value."""
    try:
        return read(*given)
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from None


@dataclass(frozen=True)
class Quantity:
    """What a length, a duration or a speed of an incident may be.

    Attributes:
        units: in which people may give it.
        low: the least, in SI units.
        high: the most.
        shown: the limits in words.
        is_above_zero: whether it must be more than 0.
        error: "across" or "along" if it is an error, of positions or of a number: a text may end
            with "probable" or "95%", and is then made a standard deviation.
    """

    units: Units
    low: float
    high: float
    shown: str
    is_above_zero: bool = False
    error: str = ""

    def read(self, name: str, given: object) -> float:
        """A number in SI units, from a number in them or a text with a unit.

        Raises:
            TypeError: it is neither.
            ValueError: it is out of the limits, or the text is unclear.
        """
        number = given
        if isinstance(given, str):
            text, sds = _without_kind(given, self.error)
            read = angle if self.units is ANGLE else quantity
            number = named(name, read, text, self.units) / sds
        value = checks.real(name, number)
        is_valid = self.low <= value <= self.high
        if self.is_above_zero and value == 0.0:
            is_valid = False
        if not is_valid:
            raise ValueError(f"{name} must be {self.shown}, got {given!r:.100}")
        return value


def _without_kind(text: str, error: str) -> tuple[str, float]:
    """The text of an error without the name of its kind, and how many standard deviations it is."""
    words = text.strip()
    if not error:
        return words, 1.0
    for kind, sds in ERRORS.items():
        if words.lower().endswith(kind):
            return words[: -len(kind)].strip(), sds[error]
    return words, 1.0


def angle(text: str, units: Units) -> float:
    """A number of degrees; their sign may be left out."""
    match = re.fullmatch(r"(\d+\.?\d*|\.\d+)\s*(\S*)", text.strip().lower())
    if match is None or match[2] not in units:
        raise ValueError(f"a number of degrees is needed, got {text!r}")
    return float(match[1]) * units[match[2]]


def quantity(text: str, units: Units) -> float:
    """A number with one of some units, in SI units; several add up, such as 1h30 or 1h 30min."""
    given = re.sub(r"(h\s*\d+)$", r"\1min", text.strip().lower())
    parts = re.findall(r"(\d+\.?\d*|\.\d+)\s*([a-z/]+)\s*", given)
    if not parts or re.sub(r"\s", "", given) != "".join(map("".join, parts)):
        raise ValueError(f"a number and a unit ({', '.join(units)}) are needed, got {text!r}")
    for _, unit in parts:
        if unit not in units:
            raise ValueError(f"the unit must be {', '.join(units)}, got {unit!r} in {text!r}")
    return sum(float(number) * units[unit] for number, unit in parts)


def direction(text: str) -> float:
    """Degrees clockwise from north, from 0 to 360, or one of the sixteen points."""
    given = text.strip().upper()
    if given in POINTS:
        return POINTS.index(given) * 22.5
    if re.fullmatch(r"\d+\.?\d*[°T]?", given):
        degrees = float(given.rstrip("°T"))
        if degrees <= 360:
            return degrees
    raise ValueError(f"a direction is degrees from 0 to 360, or N, NNE to NNW, got {text!r}")


def position(text: str) -> Pair:
    """(latitude, longitude): decimal degrees, or degrees, minutes and seconds with N, S, E, W."""
    given = text.strip().upper()
    lettered = re.fullmatch(r"(.*?[NS]|[NS].*?)[\s,/]*([^NS]*[EW]|[EW][^NS]*)", given)
    both = lettered.groups() if lettered else given.replace(",", " ").split()
    if len(both) != 2:
        raise ValueError(f'a position is such as 54.18 7.85 or "54-10.8N 007-51.0E", got {text!r}')
    return degrees(both[0], "NS"), degrees(both[1], "EW")


def degrees(text: str, letters: str) -> float:
    """A latitude or longitude; south and west, the second of the letters, are negative."""
    given = re.sub(r"[°'\u2032\"\u2033]|(?<=\d)-", " ", text.upper())
    tokens = re.findall(r"[-+]?\d+\.?\d*|\S", given)
    digits = [token for token in tokens if token[-1:].isdigit() or token[:-1].isdigit()]
    letter = "".join(token for token in tokens if token not in digits)
    if not _is_position(letter, digits, letters):
        raise ValueError(
            f"degrees are such as 54.18, 54-10.8{letters[0]} or 54 10 48 {letters[0]}, with "
            f"minutes and seconds below 60 and the latitude first, got {text!r}"
        )
    size: float = sum(float(number) / 60**power for power, number in enumerate(digits))
    return -size if letter == letters[1] else size


def _is_position(letter: str, digits: list[str], letters: str) -> bool:
    """Whether degrees, minutes and seconds, with a letter or a sign, make sense together."""
    most = 3 if letter else 1
    if letter not in ("", *letters) or not 0 < len(digits) <= most:
        return False
    if letter and not digits[0][0].isdigit():
        return False
    is_whole = all("." not in number for number in digits[:-1])
    return is_whole and all(float(number) < 60 for number in digits[1:])


def radioed(position: Pair) -> str:
    """A (latitude, longitude) in degrees and decimal minutes."""
    return f"{minutes(60 * position[0], 'NS')} {minutes(60 * position[1], 'EW')}"


def minutes(value: float, letters: str) -> str:
    """A latitude or longitude in minutes as degrees and decimal minutes."""
    value = (value + 10800) % 21600 - 10800
    whole, tenths = divmod(round(10 * abs(value)), 600)
    digits = 3 if letters == "EW" else 2
    letter = letters[1] if value < 0 else letters[0]
    return f"{whole:0{digits}}°{tenths / 10:04.1f}'{letter}"


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
