"""What is known of how a person drifts."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Hashable
from typing import Any


class KnownDrift(ABC):
    """The plain data from which `models.drift_model` makes a `DriftModel`.

    Attributes:
        weights: the probability of each hypothesis; they sum to 1.
        vector: the mean drift in cells per step, (x, y).
        key: equal for equal forecasts.
        outline: what it consists of, in words; may be empty.
    """

    weights: tuple[float, ...] = (1.0,)
    vector: tuple[float, float]
    key: Hashable
    outline: str = ""

    @abstractmethod
    def check(self, grid_size: int, timestep_limit: int, name: str) -> None:
        """Raise a ValueError, with the person's name, if it does not fit a grid and a limit."""

    @abstractmethod
    def mass_beyond(self, grid_size: int, step: int) -> float:
        """The probability that the person would be beyond the grid after some steps."""

    @abstractmethod
    def to_dict(self) -> dict[str, Any]:
        """The items of the person's plain data for JSON."""
