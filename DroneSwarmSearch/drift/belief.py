"""Bayesian updates of the belief about a missing person: searches, drift, and the mean.

A belief, the mass of a person's states, begins as the forecast. A search of cell k with probability
of detection q that does not find the person multiplies the mass of every state in k by 1 - q. All
searches of a step are applied together, then the belief is normalised, and then it drifts (L. D.
Stone, Theory of Optimal Search, 1975). The product of the sums before each normalisation is the
probability that no search has found the person; one minus it is the probability of success (POS).

Beliefs begin with the first search, see `begun_beliefs`; until then, the forecast is the belief.

Batches, arrays with trailing batch axes after those of mass, agree bit for bit. `vector.beliefs`
has the array form.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch._internal.arrays import Flags, Floats, Singles
from DroneSwarmSearch.drift.model import DriftModel

FloatOrArray = TypeVar("FloatOrArray", float, Floats)
Result = TypeVar("Result")


class Belief(NamedTuple):
    """The belief about one person who has not been found; never changed in place."""

    model: DriftModel
    detection: float  # the probability that a search of the person's cell finds the person
    mass: Floats  # sums to 1
    failure: float = 1.0  # the probability that no search so far finds the person

    def after_search(self, cells: Collection[int]) -> Belief:
        """The belief after searches of cells, y * N + x, find nobody; each counts if one repeats.

        If they contradict the belief, its mass stays.
        """
        mass = self.searched(cells)
        total = normalise(mass).item()
        if total > 0.0:  # rounding must not lower the probability of success
            return Belief(self.model, self.detection, mass, self.failure * min(total, 1.0))
        return self._replace(failure=0.0)

    def searched(self, cells: Collection[int]) -> Floats:
        """The mass that searches of cells leave, not normalised; a new array."""
        mass = self.mass.copy()
        flat = mass.reshape(-1)
        missed = 1.0 - self.detection
        for cell in cells:
            flat[self.model.states(cell)] *= missed
        return mass

    def after_drift(self, step: int) -> Belief:
        """The belief one step later."""
        mass = self.model.drift(self.mass, step)
        return Belief(self.model, self.detection, mass, self.failure)

    def map(self) -> Floats:
        """The probability of each cell, for reading only: float64, shape (N, N)."""
        return self.model.map(self.mass)

    def added_success(self, cells: Sequence[int], alive: float = 1.0) -> Floats:
        """The probability of success that a search of each of some cells adds, times `alive`."""
        added: Floats = self.failure * (self.detection * alive) * self.map().reshape(-1)[cells]
        return added


def begun_beliefs(
    models: Sequence[DriftModel], detections: Sequence[float], step: int
) -> list[Belief]:
    """The beliefs about all persons at the first search, which are the forecasts of this step.

    A person's prior costs nothing to forecast, and a belief costs a drift a step, so beliefs do
    not begin earlier.
    """
    begun: dict[object, Belief] = {}  # persons who are alike share their belief
    beliefs = []
    for model, detection in zip(models, detections, strict=True):
        kind = model.key, detection
        if kind not in begun:
            begun[kind] = Belief(model, detection, model.joint(step))
        beliefs.append(begun[kind])
    return beliefs


def of_each_kind(function: Callable[[Belief], Result], beliefs: Sequence[Belief]) -> list[Result]:
    """A function of the model, detection and mass of each belief; called once for persons alike."""
    if len(beliefs) == 1:
        return [function(beliefs[0])]
    results: dict[tuple[int, float], Result] = {}
    for belief in beliefs:
        kind = id(belief.mass), belief.detection
        if kind not in results:
            results[kind] = function(belief)
    return [results[id(belief.mass), belief.detection] for belief in beliefs]


def drifted(beliefs: Sequence[Belief], step: int) -> list[Belief]:
    """All beliefs one step later."""
    after = of_each_kind(lambda belief: belief.after_drift(step), beliefs)
    pairs = zip(beliefs, after, strict=True)
    return [Belief(now.model, now.detection, then.mass, now.failure) for now, then in pairs]


def normalise(belief: Floats, which: Flags | bool = True) -> Floats:
    """Scale beliefs, (M, R, N, ...) and C-contiguous, in place so that they sum to 1.

    Those that are 0 everywhere stay, and so do all but `which`, (...). Returns the sums before.
    """
    # Sum over layers and rows first, then over columns one at a time: this order does not
    # depend on the batch. NumPy adds in this order along a first axis, but not along
    # contiguous memory.
    if belief.ndim <= 3:
        total: Floats = np.add.reduce(belief.reshape(-1, belief.shape[-1])).cumsum()[-1]
        if which and total > 0.0:
            belief *= 1.0 / total
        return total
    columns = belief.reshape(-1, *belief.shape[2:]).sum(axis=0)
    if columns.size > len(columns):
        total = columns.sum(axis=0)
    else:
        total = columns.reshape(-1).cumsum()[-1].reshape(columns.shape[1:])
    factor = 1.0 / np.where(which & (total > 0.0), total, 1.0)
    # Contiguous arrays multiply faster than broadcast ones.
    belief *= np.broadcast_to(factor, columns.shape).copy()
    return total


def mean_over_missing(beliefs: Sequence[FloatOrArray], missing: Collection[int]) -> FloatOrArray:
    """The mean belief about the missing persons, or about all persons if none is missing.

    Beliefs are arrays of one shape or numbers; a single person's is returned itself.
    """
    if len(beliefs) == 1:
        return beliefs[0]
    first, *others = (beliefs[person] for person in missing) if missing else beliefs
    if not others:
        return first
    total = first
    for belief in others:
        total = total + belief
    return total / (1 + len(others))


def shown_matrix(
    models: Sequence[DriftModel],
    beliefs: Sequence[Belief] | None,
    missing: Collection[int],
    step: int,
) -> Singles:
    """The matrix that drones see, for reading only: float32, (N, N).

    It is the mean over the missing persons of the beliefs, or of the forecasts if these are None.
    `vector.knowledge` has the array form.
    """
    if beliefs is not None:
        maps = of_each_kind(Belief.map, beliefs)
        return mean_over_missing(maps, missing).astype(np.float32)
    if len(models) == 1:  # saves a tenth of a step
        return models[0].matrix(step)
    first, *others = (models[person] for person in missing or range(len(models)))
    if all(other.key == first.key for other in others):
        return first.matrix(step)
    return mean_forecast(models, missing, step)


def mean_forecast(models: Sequence[DriftModel], missing: Collection[int], step: int) -> Singles:
    """The mean of the forecasts of the missing persons: float32, (N, N); a new array."""
    exact = [model.exact(step) for model in models]
    return mean_over_missing(exact, missing).astype(np.float32)


def means_over_missing(beliefs: Sequence[Floats] | Floats, counted: NDArray[np.bool_]) -> Floats:
    """`mean_over_missing` for batches of a shape (...); `counted` broadcasts to (persons, ...)."""
    if len(beliefs) == 1:
        single: Floats = beliefs[0]
        return single
    total = np.zeros(beliefs[0].shape)
    for belief, counts in zip(beliefs, counted, strict=True):
        np.add(total, belief, out=total, where=counts)
    mean: Floats = total / counted.sum(axis=0)
    return mean


def shown_persons(missing: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Which persons each matrix shows, (persons, n): the missing ones, or all if none is."""
    counted: NDArray[np.bool_] = missing | ~missing.any(axis=0)
    return counted
