"""Numbers and short phrases for people, shared by text, pictures and plots."""

from __future__ import annotations

from DroneSwarmSearch.core.frame import Frame

NOTHING = 1e-12


def drift(frame: Frame) -> tuple[str, list[tuple[str, str]]]:
    """The mean drift: its unit, and each component's name and value; with a scale, at sea."""
    unit = "cells/step"
    names = "xy"
    values = frame.vector
    if frame.scale is not None:
        unit = "m/s"
        names = "EN"
        values = frame.scale.velocity(values)
    return unit, [(name, signed(value)) for name, value in zip(names, values, strict=True)]


def percent(probability: float) -> str:
    """A probability as a percentage with three significant digits, such as "4.17%"."""
    return f"{100 * probability:.3g}%"


def signed(value: float) -> str:
    """A number with its sign: two decimals, three significant digits from 1000, two below 0.1."""
    if abs(value) < NOTHING:  # rounding, in the mean of vectors
        value = 0.0
    if abs(value) >= 1000.0:
        return f"{value:+.3g}"
    text = f"{value:+.2f}"
    # The drift of a person at sea is often some thousandths of a cell per step.
    return text if abs(value) >= 0.095 or float(text) == value else f"{value:+#.2g}"


def tick_stride(room: float, pitch: float) -> int:
    """The smallest of 1, 2, 5, 10, 20, 50, ... units, of length `pitch`, that have the room."""
    power = 1
    while True:
        for stride in (power, 2 * power, 5 * power):
            if stride * pitch >= room:
                return stride
        power *= 10
