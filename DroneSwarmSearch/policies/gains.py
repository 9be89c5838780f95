"""What searches in the next steps gain: the persons they find, and what a find teaches."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from DroneSwarmSearch._internal.arrays import Floats
from DroneSwarmSearch.drift.model import DriftModel
from DroneSwarmSearch.paths.best_paths import DronePath, cells_looked_at
from DroneSwarmSearch.policies.belief_tracker import BeliefTracker

TEACHES = 10.0
"""What a find at the start, of an unlikely hypothesis, is worth for each other missing person."""


@dataclass
class _Kind:
    """Missing persons about whom the same is known.

    Attributes:
        model: how they drift.
        count: how many they are.
        worth: of a search that meets one of them, in each of the next steps: (steps,).
        mass: where one of them is: (M, R, N).
        detection: the probability that a search of a person's cell finds the person.
    """

    model: DriftModel
    count: int
    worth: Floats
    mass: Floats
    detection: float


class SearchGains:
    """What one more search of each cell gains now and in the next steps.

    A search gains the number of persons whom it is expected to find. If persons drift together
    (`Scenario.shared_drift`), the first find under hypothesis k also counts what it teaches:
    ``TEACHES`` x (1 - p_k) x the other missing persons x the share of the time that is left, where
    p_k is how likely k is already. Without that, the gains are `BeliefTracker.success_ahead` times
    the number of missing persons.

    Args:
        tracker: what is known; do not update it while the gains are in use.
        steps: how many steps to look at, this one included.
    """

    def __init__(self, tracker: BeliefTracker, steps: int) -> None:
        self._tracker = tracker
        self._scenario = tracker.scenario
        self._steps = steps
        self._kinds = self._kinds_of_persons()
        self._teaches = self._scenario.shared_drift and self._scenario.mission == "rescue"

    def beside(self, paths: Sequence[DronePath]) -> Floats:
        """The gains, given the paths of other drones: float64, (steps, N, N), a new array."""
        size = self._scenario.grid_size
        looked_at = [cells_looked_at(path.cells, self._scenario.search_in_flight) for path in paths]
        now = self._tracker.step
        kinds = self._kinds
        masses = [kind.mass for kind in kinds]
        likely = masses[0].sum(axis=(1, 2))  # each hypothesis, if they are shared
        gains = np.zeros((self._steps, size, size))
        for step in range(self._steps):
            searched = [
                int(cells[step])
                for cells, path in zip(looked_at, paths, strict=True)
                if path.searches[step]
            ]
            masses = [
                _missed(kind, mass, searched) for kind, mass in zip(kinds, masses, strict=True)
            ]
            lessons = self._lessons(now + step, masses, likely)
            for kind, mass, lesson in zip(kinds, masses, lessons, strict=True):
                weighed = mass * (1.0 + lesson)[:, None, None]
                gains[step] += kind.count * kind.worth[step] * kind.model.map(weighed)
            if step < self._steps - 1:
                masses = [
                    kind.model.forward(mass, now + step)
                    for kind, mass in zip(kinds, masses, strict=True)
                ]
        return gains

    def _kinds_of_persons(self) -> list[_Kind]:
        """The missing persons, those about whom the same is known together."""
        tracker = self._tracker
        kinds: dict[tuple[Any, ...], _Kind] = {}
        persons = self._scenario.persons_to_find
        for person in tracker.missing:
            detection = self._scenario.detections[person]
            model = tracker.forecasts[person]
            key = model.key, detection, persons[person].survival
            if key in kinds:
                kinds[key].count += 1
                continue
            ahead = range(tracker.step, tracker.step + self._steps)
            worth = np.array([tracker.worth(person, step) for step in ahead])
            kinds[key] = _Kind(model, 1, worth, tracker.weighed(person), detection)
        return [*kinds.values()]

    def _lessons(self, step: int, masses: Sequence[Floats], likely: Floats) -> list[Floats]:
        """What a find of each kind of person teaches under each hypothesis, in finds: (M,) each.

        Only the first find teaches, so this falls with the probability that there has been one.
        """
        kinds = self._kinds
        others = sum(kind.count for kind in kinds) - 1
        if not self._teaches or not others:
            return [np.zeros(len(mass)) for mass in masses]
        left = max(self._scenario.timestep_limit - step - 1, 0) / self._scenario.timestep_limit
        known = np.where(likely > 0.0, likely, 1.0)
        unfound = [np.minimum(mass.sum(axis=(1, 2)) / known, 1.0) for mass in masses]
        nobody = np.ones(len(likely))  # the probability that nobody has been found
        for kind, share in zip(kinds, unfound, strict=True):
            nobody *= share**kind.count
        value = TEACHES * (1.0 - likely) * others * left * nobody
        return [value / np.where(share > 0.0, share, 1.0) for share in unfound]


def _missed(kind: _Kind, mass: Floats, cells: Sequence[int]) -> Floats:
    """What searches of some cells leave of the mass."""
    if not cells:
        return mass
    left = mass.copy()
    flat = left.reshape(-1)
    for cell in cells:
        flat[kind.model.states(cell)] *= 1.0 - kind.detection
    return left
