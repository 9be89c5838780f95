"""The drift model of a person for whom earlier searches have looked without success."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from DroneSwarmSearch._internal.arrays import Floats, Ints
from DroneSwarmSearch.drift.belief import Belief
from DroneSwarmSearch.drift.model import DriftModel

if TYPE_CHECKING:
    from DroneSwarmSearch.drift.persons import Person


class Resumed(DriftModel):
    """Another model from the step after `Person.searched` on, beginning with the posterior."""

    def __init__(self, model: DriftModel, person: Person) -> None:
        self.grid_size, self.kept_cells, self.key = model.grid_size, model.kept_cells, person.key
        belief = Belief(model, person.probability_of_detection, model.joint(0))
        for step, cells in enumerate(person.searched):
            if cells:
                belief = belief.after_search([y * self.grid_size + x for x, y in cells])
            belief = belief.after_drift(step)
        self._model, self._before = model, len(person.searched)
        self._start, self._latest = belief.mass, (0, belief.mass)
        self.weights = np.array(model.hypotheses(belief.mass))

    @property
    def state_shape(self) -> tuple[int, int, int]:
        return self._model.state_shape

    def joint(self, step: int) -> Floats:
        if step < self._latest[0]:
            self._latest = 0, self._start
        for before in range(self._latest[0], step):
            self._latest = before + 1, self.drift(self._latest[1], before)
        return self._latest[1].copy()

    def forward(self, mass: Floats, step: int) -> Floats:
        return self._model.forward(mass, step + self._before)

    def backward(self, value: Floats, step: int) -> Floats:
        return self._model.backward(value, step + self._before)

    def drift(self, mass: Floats, step: int) -> Floats:
        return self._model.drift(mass, step + self._before)

    def matrices(self, step: int) -> tuple[Floats, Floats] | None:
        return self._model.matrices(step + self._before)

    def moved(self, states: Ints, step: int, draws_x: Floats, draws_y: Floats) -> Ints:
        return self._model.moved(states, step + self._before, draws_x, draws_y)

    def branches(self, states: Ints, probabilities: Floats, step: int) -> tuple[Ints, Ints, Floats]:
        return self._model.branches(states, probabilities, step + self._before)
