"""The interface of a drift model: where a person may be, and how the person moves.

A *state* is what a person's next move depends on, such as a hypothesis and a cell. *Mass*, the
probability of each state, and *value*, what is expected of a person in it, are float64 arrays
of shape (..., *state_shape), with any leading axes. Environments, beliefs, policies and planning
handle states only through the methods below, so that a new model needs nothing outside this folder.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Hashable, Sequence
from typing import Any

import numpy as np

from DroneSwarmSearch._internal.arrays import Floats, Ints, Singles

__all__ = ["DriftModel"]


class DriftModel(ABC):
    """How one person may drift over a grid.

    Attributes:
        grid_size: cells along each side of the grid, N.
        state_shape: the shape of mass.
        key: equal for models with equal forecasts.
        weights: the probability of each hypothesis about the person at step 0: float64, (M,).
    """

    grid_size: int
    state_shape: tuple[int, ...]
    key: Hashable
    weights: Floats

    def is_same(self, other: DriftModel) -> bool:
        """Whether another model has the same forecast at every step."""
        return self.key == other.key

    # The forecast.

    @abstractmethod
    def joint(self, step: int) -> Floats:
        """The probability of each state at a step, without searches; a new array."""

    def exact(self, step: int) -> Floats:
        """The matrix at a step in double precision: float64, shape (N, N), indexed [y, x]."""
        return self.map(self.joint(step)).copy()

    def at(self, step: int) -> Singles:
        """The matrix at a step: float32, shape (N, N), indexed [y, x], sums to 1; a new array."""
        return self.exact(step).astype(np.float32)

    # States and cells.

    @abstractmethod
    def map(self, mass: Floats) -> Floats:
        """The mass in each cell, shape (..., N, N); may be a view."""

    @abstractmethod
    def lift(self, values: Floats) -> Floats:
        """Values of cells, shape (..., N, N), in a form that broadcasts with mass."""

    @abstractmethod
    def states(self, cell: int) -> Any:
        """The index of a cell's states in flat mass, ``mass.reshape(-1)``."""

    @abstractmethod
    def cells(self, states: Any) -> Any:
        """The cells, y * N + x, of states given by their places in flat mass."""

    @abstractmethod
    def hypotheses(self, mass: Floats) -> tuple[float, ...]:
        """The probability of each hypothesis about the person, given the mass."""

    # The steps of a distribution.

    @abstractmethod
    def forward(self, mass: Floats, step: int) -> Floats:
        """The mass one step later, given that before it."""

    @abstractmethod
    def backward(self, value: Floats, step: int) -> Floats:
        """The expected value before a step, given that after it."""

    def drift(self, mass: Floats, step: int) -> Floats:
        """`forward` of a single belief, in arithmetic that does not depend on the batch."""
        return self.forward(mass, step)

    # The steps of a person.

    @abstractmethod
    def start(self, draws: Any) -> Any:
        """The state at step 0 of one person or of several, one for each uniform draw in [0, 1)."""

    @abstractmethod
    def walk(
        self, state: int, step: int, draws_x: Sequence[float], draws_y: Sequence[float]
    ) -> list[int]:
        """Walk one person for several steps.

        Args:
            state: the person's state.
            step: completed steps.
            draws_x: a uniform draw from [0, 1) for each step.
            draws_y: another one for each step.

        Returns:
            The state after each step.
        """

    @abstractmethod
    def moved(self, states: Ints, step: int, draws_x: Floats, draws_y: Floats) -> Ints:
        """`walk` for many persons and one step.

        Args:
            states: the persons' states, shape (n,).
            step: completed steps.
            draws_x: a uniform draw from [0, 1) for each person.
            draws_y: another one for each person.
        """

    @abstractmethod
    def branches(self, states: Ints, probabilities: Floats, step: int) -> tuple[Ints, Ints, Floats]:
        """All ways in which persons may move on in a step.

        Args:
            states: the persons' states, shape (n,).
            probabilities: how likely each of them is.
            step: completed steps.

        Returns:
            For each way, the place of the person in `states`, the state one step later, and
            how likely this is.
        """
