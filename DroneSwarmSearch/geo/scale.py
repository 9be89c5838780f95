"""Metres and seconds into cells and steps, and back."""

from __future__ import annotations

import math
from dataclasses import dataclass

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.arrays import Pair

__all__ = ["Scale"]


@dataclass(frozen=True)
class Scale:
    """The size of a cell and the duration of a step.

    At sea, vectors are (east, north). On the grid they are (x, y): x grows to the east, and y
    grows to the south, because north is up::

        scale = Scale.for_drone(speed=10, swath=130)
        scale.vector((0.1, 0.2))  # m/s east and north: (0.01, -0.02) cells per step
        scale.whole_steps(3600)  # an hour: 277 steps

    Attributes:
        metres_per_cell: side of a cell in metres; above 0.
        seconds_per_step: duration of a step in seconds; above 0.

    Raises:
        TypeError: a value is not a number.
        ValueError: a value is out of its limits.
    """

    metres_per_cell: float
    seconds_per_step: float

    def __post_init__(self) -> None:
        for name in ("metres_per_cell", "seconds_per_step"):
            object.__setattr__(self, name, checks.positive(name, getattr(self, name)))

    @classmethod
    def for_drone(cls, speed: float, swath: float) -> Scale:
        """The scale at which a drone sees one cell at a time and crosses it in one step.

        Args:
            speed: of the drone, in m/s; above 0.
            swath: width of the strip that the drone sees, in metres; above 0.
        """
        width = checks.positive("swath", swath)
        return cls(width, width / checks.positive("speed", speed))

    def vector(self, velocity: Pair) -> Pair:
        """A velocity in m/s, (east, north), as cells per step, (x, y)."""
        east, north = checks.pair("velocity", velocity)
        factor = self.seconds_per_step / self.metres_per_cell
        return east * factor, -north * factor

    def velocity(self, vector: Pair) -> Pair:
        """The inverse of `vector`."""
        x, y = checks.pair("vector", vector)
        factor = self.metres_per_cell / self.seconds_per_step
        return x * factor, -y * factor

    def offset(self, displacement: Pair) -> Pair:
        """A displacement in metres, (east, north), as cells, (x, y)."""
        east, north = checks.pair("displacement", displacement)
        return east / self.metres_per_cell, -north / self.metres_per_cell

    def cells(self, metres: float) -> float:
        """A distance in cells."""
        return checks.real("metres", metres) / self.metres_per_cell

    def whole_steps(self, seconds: float) -> int:
        """A duration in steps, rounded (a half upward)."""
        return math.floor(checks.real("seconds", seconds) / self.seconds_per_step + 0.5)

    def seconds(self, steps: float) -> float:
        """A duration in seconds."""
        return checks.real("steps", steps) * self.seconds_per_step

    def diffusion(self, diffusivity: float) -> float:
        """A diffusivity K in m²/s as the growth of the variance, 2 K, in cells² per step."""
        number = checks.real("diffusivity", diffusivity, 0)
        return 2.0 * number * self.seconds_per_step / self.metres_per_cell**2
