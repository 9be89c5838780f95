"""Figures as people read them, shared by the text and the picture."""

from __future__ import annotations

from DroneSwarmSearch.rendering.frame import Frame
from DroneSwarmSearch.rules import Ending

__all__ = ["outcome_in_brief", "percent", "signed", "tick_stride"]

_FIXED_BELOW = 1000.0
_STRIDE_MANTISSAS = (1, 2, 5)


def outcome_in_brief(frame: Frame) -> str:
    """How an episode ended, in few words; empty while it goes on."""
    if frame.ending is None:
        return ""
    if frame.ending in (Ending.FOUND, Ending.TIME_LIMIT):
        found = "found" if frame.ending is Ending.FOUND else "not found"
        return f"{found} in {frame.step} step{'' if frame.step == 1 else 's'}"
    return f"{frame.ending.description} in step {frame.step}"


def percent(probability: float) -> str:
    """A probability as a percentage of three significant digits, such as "4.17%"."""
    return f"{100 * probability:.3g}%"


def signed(value: float) -> str:
    """A number with its sign: two decimals, or three significant digits if it is large."""
    return f"{value:+.2f}" if abs(value) < _FIXED_BELOW else f"{value:+.3g}"


def tick_stride(room_needed: float, pitch: float) -> int:
    """How many cells apart axis labels stand: the least of 1, 2, 5, 10, 20, 50, ...

    Args:
        room_needed: length along the axis that a label takes, with its spacing.
        pitch: length of a cell along the axis, in the same unit.
    """
    power = 1
    while True:
        for mantissa in _STRIDE_MANTISSAS:
            if mantissa * power * pitch >= room_needed:
                return mantissa * power
        power *= 10
