"""Times as people type them: with a date and a zone, or of the clock."""

from __future__ import annotations

import re
from datetime import datetime, timedelta, timezone

YEARS = 1970, 2100  # all times are within these
CLOCK = re.compile(r"(\d\d?):?(\d\d)Z?", re.IGNORECASE)
DAY = timedelta(days=1)


def in_utc(name: str, value: object) -> datetime:
    """A time in UTC, from a datetime or a text with a zone.

    Raises:
        TypeError: it is neither.
        ValueError: it has no zone, or is no time of the years from 1970 to 2100.
    """
    what = f'{name} must be a time with a zone, such as "2026-03-01T05:30Z"'
    if isinstance(value, str):
        try:
            value = datetime.fromisoformat(value.strip().replace("Z", "+00:00"))
        except ValueError:
            raise ValueError(f"{what}, got {value!r:.100}") from None
    if not isinstance(value, datetime):
        raise TypeError(f"{what}, got {value!r:.100}")
    if value.tzinfo is None:
        raise ValueError(f"{what}, got {value.isoformat()} without one")
    first, last = YEARS
    if not first <= value.year <= last:
        raise ValueError(f"{name} must be from {first} to {last}, got {value.isoformat()}")
    return value.astimezone(timezone.utc)


def is_clock(text: str) -> bool:
    """Whether a text is a time without a date, such as "08:00Z"."""
    return CLOCK.fullmatch(text.strip()) is not None


def near(name: str, value: object, reference: datetime) -> datetime:
    """A time in UTC; one of the clock is the one nearest to `reference`, or the later of two.

    Raises:
        TypeError, ValueError: as `in_utc`; or the clock has no such time.
    """
    clock = CLOCK.fullmatch(value.strip()) if isinstance(value, str) else None
    if clock is None:
        return in_utc(name, value)
    hour, minute = map(int, clock.groups())
    if hour > 23 or minute > 59:
        raise ValueError(f"{name} must be a time from 00:00Z to 23:59Z, got {value!r}")
    today = reference.replace(hour=hour, minute=minute, second=0, microsecond=0)
    days = [today + DAY, today, today - DAY]
    return min(days, key=lambda day: abs(day - reference))
