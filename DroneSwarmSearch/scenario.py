"""The parameters of a search: their meaning, units, defaults and limits in one place."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from DroneSwarmSearch import checks
from DroneSwarmSearch.probability_matrix import ProbabilityMatrix
from DroneSwarmSearch.rules import RewardScheme

__all__ = ["Cell", "Scenario"]

_MOST_STEPS = 2**53
"""Up to here every number of steps is a float, too."""

_DRONE_BYTES = 900
"""About what the environment keeps of a drone in an episode, observations included."""

Cell = tuple[int, int]
"""(x, y): column and row; y grows downward."""


@dataclass(frozen=True)
class Scenario:
    """A search, checked. Make one with `Scenario.checked`.

    Attributes:
        grid_size: cells along each side of the square grid; at least 2.
        n_drones: drones; from 1 to grid_size².
        vector: drift of the persons in cells per step, (x, y); finite. What exceeds one
            cell per step drifts one cell per step.
        persons: each person's cell at step 0; at least one.
        disperse_constant: how quickly the persons may stray; finite, at least 0
            (`probability_matrix.dispersion_rate`).
        timestep_limit: steps in an episode; from 1 to 2**53.
        detection: each person's chance to be found by a search of the right cell; from 0
            to 1. A single number holds for however many persons there are.
        bayesian_update: whether the matrix is the posterior given the searches made, or
            the drift alone.
        reward_scheme: the figures of the reward table.
    """

    grid_size: int
    n_drones: int
    vector: tuple[float, float]
    persons: tuple[Cell, ...]
    disperse_constant: float
    timestep_limit: int
    detection: float | tuple[float, ...]
    bayesian_update: bool
    reward_scheme: RewardScheme

    @classmethod
    def checked(
        cls,
        *,
        grid_size: object,
        n_drones: object,
        vector: object,
        person_initial_position: object,
        disperse_constant: object,
        timestep_limit: object,
        probability_of_detection: object,
        bayesian_update: object,
        reward_scheme: object,
    ) -> Scenario:
        """Check the arguments of `DroneSwarmSearch`, under the names they have there.

        Raises:
            TypeError: an argument is of the wrong type.
            ValueError: an argument is out of its limits.
        """
        side = checks.integer("grid_size", grid_size, 2)
        drones = checks.integer("n_drones", n_drones, 1, side**2)
        updates = checks.boolean("bayesian_update", bayesian_update)
        persons = _persons(person_initial_position, side)
        # The matrices before and after a step; of each person what is believed, in double.
        cell_bytes = 8 + 16 * len(persons) * updates
        checks.fits("what is known of the cells", cell_bytes * side**2, grid_size=side)
        checks.fits("the drones", _DRONE_BYTES * drones, n_drones=drones)
        if not isinstance(reward_scheme, RewardScheme):
            raise TypeError(f"reward_scheme must be a RewardScheme, got {reward_scheme!r}")
        return cls(
            grid_size=side,
            n_drones=drones,
            vector=checks.pair("vector", vector),
            persons=persons,
            disperse_constant=checks.real("disperse_constant", disperse_constant, 0),
            timestep_limit=checks.integer("timestep_limit", timestep_limit, 1, _MOST_STEPS),
            detection=_detection(probability_of_detection, len(persons)),
            bayesian_update=updates,
            reward_scheme=reward_scheme,
        )

    def with_vector(self, vector: object) -> Scenario:
        """The same search with another drift."""
        return replace(self, vector=checks.pair("vector", vector))

    def with_persons(self, person_initial_position: object) -> Scenario:
        """The same search with other start cells, and perhaps another number of persons."""
        persons = _persons(person_initial_position, self.grid_size)
        if isinstance(self.detection, tuple) and len(self.detection) != len(persons):
            raise ValueError(
                f"person_initial_position must hold {len(self.detection)} cells, one for each "
                f"probability_of_detection, got {person_initial_position!r}"
            )
        return replace(self, persons=persons)

    def laws(self) -> tuple[ProbabilityMatrix, ...]:
        """Every person's law."""
        return tuple(
            ProbabilityMatrix(self.grid_size, cell, self.vector, self.disperse_constant)
            for cell in self.persons
        )

    def drone_cells(self, drones_positions: object) -> list[int]:
        """The drones' cells by number, y * N + x.

        Args:
            drones_positions: a cell (x, y) for each drone.

        Raises:
            TypeError: they are no cells.
            ValueError: they are not as many as the drones, off the grid, or two are alike.
        """
        name, n, size = "drones_positions", self.n_drones, self.grid_size
        entries = checks.items(name, drones_positions, f"{n} cells (x, y), one for each drone")
        if len(entries) != n:
            raise ValueError(
                f"{name} must hold {n} cells (x, y), one for each drone, "
                f"got {len(entries)}: {drones_positions!r}"
            )
        first_at: dict[Cell, int] = {}
        for drone, entry in enumerate(entries):
            cell = checks.cell(f"{name}[{drone}]", entry, size)
            if cell in first_at:
                raise ValueError(
                    f"{name} must hold different cells, got {cell} for both "
                    f"drone{first_at[cell]} and drone{drone}"
                )
            first_at[cell] = drone
        return [y * size + x for x, y in first_at]

    @property
    def detections(self) -> tuple[float, ...]:
        """Every person's probability of detection."""
        if isinstance(self.detection, tuple):
            return self.detection
        return (self.detection,) * len(self.persons)


def _persons(value: object, grid_size: int) -> tuple[Cell, ...]:
    name = "person_initial_position"
    entries = checks.items(name, value, "a cell (x, y) or several of them")
    if not entries:
        raise ValueError(f"{name} must hold at least one cell (x, y), got {value!r}")
    if all(isinstance(entry, (list, tuple, np.ndarray)) for entry in entries):
        return tuple(
            checks.cell(f"{name}[{index}]", entry, grid_size) for index, entry in enumerate(entries)
        )
    return (checks.cell(name, value, grid_size),)


def _detection(value: object, n_persons: int) -> float | tuple[float, ...]:
    name = "probability_of_detection"
    if checks.is_number(value):
        return checks.real(name, value, 0, 1)
    entries = checks.items(name, value, "a number from 0 to 1, or one for each person")
    if len(entries) != n_persons:
        raise ValueError(
            f"{name} must be one number, or {n_persons}, one for each person, got {value!r}"
        )
    return tuple(
        checks.real(f"{name}[{index}]", entry, 0, 1) for index, entry in enumerate(entries)
    )
