"""The searches that the episodes of a batch draw from."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from DroneSwarmSearch._internal.arrays import Floats, Ints
from DroneSwarmSearch.core.scenario import Scenario
from DroneSwarmSearch.drift.model import forecasts_of


class Catalogue:
    """The searches that episodes draw from, which differ in their persons only.

    Args:
        scenarios: the searches, all with the same number of persons.
        old: searches that episodes under way have, but new ones do not draw.
        cells: the drones' start cells in each search, (searches, n_drones), if they are its own.

    Attributes:
        choices: the number of searches that new episodes draw from.
        forecasts: the different forecasts of their persons.
        forecast_of: the index of each person's forecast in each search: int64, (persons, searches).
        detections: each person's probability of detection: float64, (persons, searches).
        kinds: the kind of each person, numbered from 0; persons of one kind have equal forecasts
            and detections in every search, and so equal beliefs: int64, (persons,).
        shared_weights: of the hypotheses by which all persons of a search drift, padded with 0:
            float64, (hypotheses, searches); None if each person drifts alone.
        alive: the probability that each person is alive after some completed steps, the last of
            which stands for all later ones: float64, (searches, persons, steps).
    """

    def __init__(
        self,
        scenarios: Sequence[Scenario],
        old: Sequence[Scenario] = (),
        cells: Ints | None = None,
    ) -> None:
        self.scenarios = (*scenarios, *old)
        self.choices = len(scenarios)
        self.cells = cells
        self.forecasts, indices = forecasts_of(
            [model for scenario in self.scenarios for model in scenario.forecasts()],
            last=scenarios[0].timestep_limit,
            keeps_matrices=not scenarios[0].bayesian_update,
        )
        self.forecast_of: Ints = indices.reshape(len(self.scenarios), -1).T.copy()
        detections = np.array([scenario.detections for scenario in self.scenarios])
        self.detections: Floats = detections.T.copy()
        alike = np.concatenate([self.forecast_of, self.detections], axis=1)
        self.kinds = _numbered(alike)
        situations = [scenario.persons_to_find for scenario in self.scenarios]
        steps = range(max(len(one.survival or [1]) for persons in situations for one in persons))
        alive = [[[*map(person.alive, steps)] for person in persons] for persons in situations]
        self.alive: Floats = np.array(alive)
        self.shared_weights = _shared_weights(self.scenarios, self.forecasts.shape[0])
        self.forecasts.reach(0)


def _numbered(values: Floats) -> Ints:
    """The number of each row among the different ones, in the order of their first."""
    numbers: dict[bytes, int] = {}
    return np.array([numbers.setdefault(row.tobytes(), len(numbers)) for row in values])


def _shared_weights(scenarios: Sequence[Scenario], layers: int) -> Floats | None:
    if not scenarios[0].shared_drift:
        return None
    weights = np.zeros((layers, len(scenarios)))
    for number, scenario in enumerate(scenarios):
        own = scenario.persons_to_find[0].drift.weights
        weights[: len(own), number] = own
    return weights
