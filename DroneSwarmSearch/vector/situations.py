"""The catalogue of a batch: situations, each a list of persons. Every episode draws one.

A batch whose rows share `persons` has a catalogue with a single situation.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.arrays import Floats, Ints
from DroneSwarmSearch.drift.person import Starts
from DroneSwarmSearch.drift.persons import Person
from DroneSwarmSearch.drift.probability_matrix import ProbabilityMatrix
from DroneSwarmSearch.scenario import checked_persons
from DroneSwarmSearch.vector.forecasts import Mixtures

__all__ = ["Persons", "Situations", "checked_situations"]

Persons = tuple[Person, ...]
"""A situation."""


class Situations:
    """A catalogue of situations as arrays.

    Equal forecasts of persons are stored once and share a number.

    Args:
        grid_size: cells along each side, N.
        persons: the persons of each situation; the same number in each.

    Attributes:
        persons: see above.
        numbers: the number of each person's forecast in each situation: int64,
            (persons, situations).
        mixtures: the forecasts, by number.
        detections: each person's probability of detection: a number, or float64,
            (situations,), where situations differ.
        starts: draws the persons' hypotheses and cells at step 0.
    """

    def __init__(self, grid_size: int, persons: Sequence[Persons]) -> None:
        self.persons = tuple(persons)
        forecasts: dict[object, tuple[int, Person]] = {}
        numbers = []
        for person in (person for situation in persons for person in situation):
            numbers.append(forecasts.setdefault(person.key, (len(forecasts), person))[0])
        self.numbers: Ints = np.array(numbers).reshape(len(persons), -1).T.copy()
        different = [person for _, person in forecasts.values()]
        self.mixtures = Mixtures.of_persons(different)
        self.detections = [_detections(same_place) for same_place in zip(*persons, strict=True)]
        self.starts = Starts([ProbabilityMatrix(grid_size, person) for person in different])

    def __len__(self) -> int:
        return len(self.persons)


def _detections(persons: Sequence[Person]) -> float | Floats:
    """The probabilities of detection of one person in each situation."""
    first, *others = chances = [person.probability_of_detection for person in persons]
    return first if all(chance == first for chance in others) else np.array(chances)


def checked_situations(value: object, grid_size: int) -> list[Persons]:
    """Validate a catalogue of situations: a sequence, each as `checked_persons` takes it.

    Raises:
        TypeError: they are not persons.
        ValueError: there is no situation, a start does not fit on the grid, or situations have
            different numbers of persons.
    """
    name = "situations"
    given = checks.items(name, value, "a sequence of situations, each a sequence of Person")
    if not given:
        raise ValueError(f"{name} must hold at least one situation, got {value!r}")
    situations = [
        checked_persons(f"{name}[{place}]", each, grid_size) for place, each in enumerate(given)
    ]
    for place, each in enumerate(situations):
        if len(each) != len(situations[0]):
            raise ValueError(
                f"{name} must all hold the same number of persons, got {len(situations[0])} in "
                f"{name}[0] and {len(each)} in {name}[{place}]"
            )
    return situations
