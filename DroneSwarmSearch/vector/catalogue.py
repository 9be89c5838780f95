"""The searches that the episodes of a batch draw from, and the forecasts of their persons."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.arrays import Floats, Ints
from DroneSwarmSearch.drift.model import forecasts_of
from DroneSwarmSearch.scenario import Scenario, checked_persons

__all__ = ["Catalogue", "scenarios_of"]


class Catalogue:
    """Searches that differ in their persons only, and the forecasts of these persons.

    Equal persons share a forecast.

    Args:
        scenarios: the searches; all with the same number of persons.
        hypotheses: the least number of hypotheses about each person, see `Forecasts`.
        complete: make the table of matrices for all steps at once.

    Attributes:
        scenarios: see above.
        forecasts: the different forecasts, see `Forecasts`.
        numbers: the number of each person's forecast in each search: int64, (persons, searches).
        detections: each person's probability of detection: float64, (persons, searches).
        complete: see above.
    """

    def __init__(
        self, scenarios: Sequence[Scenario], hypotheses: int = 1, complete: bool = False
    ) -> None:
        self.scenarios = tuple(scenarios)
        self.complete = complete
        limit = scenarios[0].timestep_limit
        self.forecasts, numbers = forecasts_of(
            [model for scenario in scenarios for model in scenario.forecasts()],
            last=limit,
            hypotheses=hypotheses,
            keeps_matrices=complete or not scenarios[0].bayesian_update,
        )
        self.numbers: Ints = numbers.reshape(len(scenarios), -1).T.copy()
        self.detections: Floats = np.array([scenario.detections for scenario in scenarios]).T.copy()
        if complete:
            checks.fits(
                f"the table of matrices for {self.forecasts.count} different forecasts",
                self.forecasts.step_bytes * (limit + 1),
                grid_size=scenarios[0].grid_size,
                timestep_limit=limit,
            )
        self.forecasts.reach(limit if complete else 0)

    def __len__(self) -> int:
        return len(self.scenarios)


def scenarios_of(
    scenario: Scenario, situations: object, persons: int | None = None
) -> list[Scenario]:
    """The searches of some situations.

    Args:
        scenario: what they share.
        situations: a sequence, each a `Person` or a sequence of them, all of the same number.
        persons: this number, if it is known.

    Raises:
        TypeError: they are not persons.
        ValueError: there is no situation, a start does not fit on the grid, or situations have
            different numbers of persons.
    """
    what = "a sequence of situations, each a sequence of Person"
    given = checks.items("situations", situations, what)
    if not given:
        raise ValueError(f"situations must hold at least one situation, got {situations!r}")
    made = []
    for place, each in enumerate(given):
        own = checked_persons(f"situations[{place}]", each, scenario.grid_size)
        persons = persons or len(own)
        if len(own) != persons:
            raise ValueError(
                f"situations must all hold the same number of persons, {persons}, got "
                f"{len(own)} in situations[{place}]"
            )
        made.append(scenario.replace(persons=own))
    return made
