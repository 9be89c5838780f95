"""One moment of a search as plain data: drawing it cannot change an episode."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch._internal.text import plural
from DroneSwarmSearch.core.rules import Ending
from DroneSwarmSearch.geo.scale import Scale

__all__ = ["Frame"]

HISTORY_STEPS = 30  # searches of this many steps are shown; older ones have faded
TRAIL_STEPS = 12  # the moves in a drone's trail


@dataclass(frozen=True, eq=False)
class Frame:
    """One moment of a search.

    Attributes:
        matrix: probability of each cell, float32, shape (grid_size, grid_size),
            indexed [y, x]; sums to 1.
        drones: (x, y) of every drone, in the order of their names.
        searching: for every drone, whether it searched in the last step.
        persons: (x, y) of every person: the current cell of a missing person, the cell of
            the find for a found one. Empty in the coverage mission, which has none.
        found_by: for every person, the number of the drone that found them; None while
            they are missing.
        step: completed steps.
        timestep_limit: the most steps the episode can have.
        vector: mean drift in cells per step, (x, y), y growing downward.
        ending: how the episode ended; None before its end.
        hypotheses: for every person, the probability of each hypothesis.
        shared_drift: whether these are about all persons together, and equal.
        probability_of_success: of all searches so far; None if it is not known.
        prior: what `matrix` would be without the searches, where that differs.
        trails: for every drone, its last cells (x, y), oldest first, the current one last;
            empty if they are not known.
        searched: the last searches as (x, y, steps since then), oldest first.
        total_return: the sum of all drones' rewards in this episode; None if not known.
        policy: a name to show; empty for none.
        hide_persons: missing persons are not drawn.
        flown: the number of the drone that is flown by hand; None for none.
        scale: of a search at sea, which is shown in kilometres, minutes and m/s.
        land: (x, y) of the cells on land.
        viewer: the number of the drone whose map this is; None for that of all drones together.
        links: the pairs of drones in radio range; None if all drones always hear each other.
        by_drone: the same moment with each drone's map; empty if they are not known, or alike.
    """

    matrix: NDArray[np.float32]
    drones: tuple[tuple[int, int], ...]
    searching: tuple[bool, ...]
    persons: tuple[tuple[int, int], ...]
    found_by: tuple[int | None, ...]
    step: int
    timestep_limit: int
    vector: tuple[float, float]
    ending: Ending | None
    hypotheses: tuple[tuple[float, ...], ...] = ()
    probability_of_success: float | None = None
    prior: NDArray[np.float32] | None = None
    trails: tuple[tuple[tuple[int, int], ...], ...] = ()
    searched: tuple[tuple[int, int, int], ...] = ()
    total_return: float | None = None
    policy: str = ""
    hide_persons: bool = False
    flown: int | None = None
    scale: Scale | None = None
    land: tuple[tuple[int, int], ...] = ()
    shared_drift: bool = False
    viewer: int | None = None
    links: tuple[tuple[int, int], ...] | None = None
    by_drone: tuple[Frame, ...] = ()

    def seen_by(self, drone: int | None) -> Frame:
        """With the map of one drone, if it is known; with None, the frame itself."""
        if drone is None or drone >= len(self.by_drone):
            return self
        own = self.by_drone[drone]
        return replace(
            self, matrix=own.matrix, prior=own.prior, hypotheses=own.hypotheses, viewer=drone
        )

    @property
    def grid_size(self) -> int:
        """Cells along each side of the square grid."""
        return int(self.matrix.shape[0])

    @property
    def found(self) -> tuple[bool, ...]:
        """For every person, whether they have been found."""
        return tuple(drone is not None for drone in self.found_by)

    @property
    def uncertain_persons(self) -> tuple[int, ...]:
        """The numbers of the persons about whom there are several hypotheses.

        Only the first one if persons drift together, since the others' are the same.
        """
        uncertain = tuple(n for n, weights in enumerate(self.hypotheses) if len(weights) > 1)
        return uncertain[:1] if self.shared_drift else uncertain

    @property
    def progress(self) -> tuple[str, str, str]:
        """The unit of time, "step" or with a scale "minute", and how many so far and at most."""
        if self.scale is None:
            return "step", str(self.step), str(self.timestep_limit)
        so_far, limit = (self.scale.seconds(n) / 60 for n in (self.step, self.timestep_limit))
        digits = 0 if limit >= 10 else 1
        return "minute", f"{so_far:.{digits}f}", f"{limit:.{digits}f}"

    @property
    def outcome(self) -> str:
        """The text of the final banner; empty before the end of the episode."""
        if self.ending is None:
            return ""
        took = plural(self.step, "step")
        if self.scale is not None:
            took = f"{self.progress[1]} min"
        if self.ending is Ending.COVERED:
            return f"The area was covered in {took}"
        if self.ending is Ending.FOUND:
            if len(self.persons) > 1:
                return f"All persons were found in {took}"
            return f"The person was found in {took}"
        if not self.persons and self.probability_of_success is not None:
            return f"Probability of success {self.probability_of_success:.1%}"
        if len(self.persons) > 1:
            return "Not all persons were found"
        return "The person was not found"
