"""A small sea with persons who drift together, and their beliefs by enumeration: for tests."""

from itertools import product
from typing import Any

import numpy as np

from DroneSwarmSearch import Action, Drift, Person, Scenario
from DroneSwarmSearch.drift.probability_matrix import ProbabilityMatrix

SEARCH = int(Action.SEARCH)
IDLE = int(Action.IDLE)

VECTORS = [(0.5, 0.0), (0.0, 0.5), (-0.4, 0.2)]
WEIGHTS = [0.5, 0.3, 0.2]


def person(start: tuple[int, int], slow: float = 1.0, detection: float = 0.7) -> Person:
    """A person with three hypotheses, each the consequence of the same sea."""
    drifts = [
        Drift(start, vector=(slow * x, slow * y), diffusion=0.05, weight=weight)
        for (x, y), weight in zip(VECTORS, WEIGHTS, strict=True)
    ]
    return Person(drifts, probability_of_detection=detection)


def wreck(persons: int = 2, size: int = 4, **changes: Any) -> Scenario:
    kinds = [person((1, 1)), person((2, 1), slow=0.6, detection=0.9), person((1, 2), slow=0.3)]
    values = {"n_drones": 2, "timestep_limit": 30, "bayesian_update": True, **changes}
    return Scenario(size, persons=kinds[:persons], shared_drift=True, **values)


class Enumeration:
    """The joint distribution of the hypothesis and of all persons' cells, by brute force."""

    def __init__(self, scenario: Scenario) -> None:
        size = scenario.grid_size
        persons = scenario.persons_to_find
        self.detections = scenario.detections
        self.models = [
            [ProbabilityMatrix(size, drift) for drift in each.drift.drifts] for each in persons
        ]
        self.missing = list(range(len(persons)))
        self.cells = size**2
        self.joint = np.zeros((len(WEIGHTS), *[self.cells] * len(persons)))
        for hypothesis, weight in enumerate(WEIGHTS):
            starts = [models[hypothesis].joint(0).reshape(-1) for models in self.models]
            product_of_starts = starts[0]
            for start in starts[1:]:
                product_of_starts = np.multiply.outer(product_of_starts, start)
            self.joint[hypothesis] = weight * product_of_starts

    def search(self, searched: list[int], found: dict[int, int]) -> None:
        for who in range(len(self.models)):
            if who not in self.missing:
                continue
            likelihood = np.ones(self.cells)
            likelihood[searched] = 1.0 - self.detections[who]
            if who in found:
                likelihood = np.zeros(self.cells)
                likelihood[found[who]] = self.detections[who]
            shape = [1] * self.joint.ndim
            shape[1 + who] = self.cells
            self.joint *= likelihood.reshape(shape)
        self.joint /= self.joint.sum()
        self.missing = [who for who in self.missing if who not in found]

    def drift(self, step: int) -> None:
        for hypothesis in range(len(WEIGHTS)):
            for who, models in enumerate(self.models):
                model = models[hypothesis]
                one_hot = np.eye(self.cells).reshape(self.cells, 1, *[model.grid_size] * 2)
                moves = np.array([model.forward(each, step).reshape(-1) for each in one_hot])
                moved = np.tensordot(self.joint[hypothesis], moves, axes=(who, 0))
                self.joint[hypothesis] = np.moveaxis(moved, -1, who)

    @property
    def hypotheses(self) -> np.ndarray:
        return self.joint.reshape(len(WEIGHTS), -1).sum(axis=1)

    @property
    def matrix(self) -> np.ndarray:
        maps = []
        for who in self.missing:
            others = tuple(axis for axis in range(self.joint.ndim) if axis != 1 + who)
            maps.append(self.joint.sum(axis=others))
        return np.mean(maps, axis=0)


def moves_apart(rng: np.random.Generator, positions: np.ndarray, size: int) -> np.ndarray:
    """Mostly searches, and moves by which drones, each in a band of columns, never meet."""
    rows, n, _ = positions.shape
    actions = rng.choice([0, 1, 2, 3, SEARCH, SEARCH, SEARCH], size=(rows, n))
    width = size // n
    for row, drone in product(range(rows), range(n)):
        x, y = positions[row, drone]
        action = int(actions[row, drone])
        x += (action == 1) - (action == 0)
        y += (action == 3) - (action == 2)
        if not (width * drone <= x < width * (drone + 1) and 0 <= y < size):
            actions[row, drone] = SEARCH
    return actions
