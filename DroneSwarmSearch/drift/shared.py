"""Persons who drift together: one hypothesis about the sea holds for all persons of a search.

Let w_k be the weight of hypothesis k given the finds so far, and m_ik the probability that all
searches so far have missed person i, given k. The hypotheses' posterior weights are

    p_k = w_k * product of m_ik over the missing persons i, normalised.

A search step multiplies m_ik by the share of the person's mass in layer k that it leaves. If it
finds person i in cell c, it multiplies w_k by the probability, given k, that the person is in c and
has been missed before. The mass of each person, whose layers are the hypotheses, is scaled so that
layer k holds p_k: it is then the exact posterior of the person, given all searches and finds.

The arithmetic is the same for one search and for the rows of a batch, bit for bit: arrays have
trailing axes (...), none or one of rows.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from DroneSwarmSearch._internal.arrays import Flags, Floats, Ints
from DroneSwarmSearch.drift.belief import Belief, of_each_kind

INSIDE = 1e-12
"""How far a draw keeps from the limits of its hypothesis, as a share: no rounding crosses them."""


def draws_given(hypothesis: Floats, draws: Floats, weights: Floats) -> Floats:
    """Uniform draws of states at step 0, changed so that all persons have one hypothesis.

    States are ordered by hypothesis, so those of hypothesis k have the draws from the sum of all
    weights before it on.

    Args:
        hypothesis: a uniform draw, which chooses the hypothesis: (...).
        draws: of each person: (persons, ...).
        weights: of the hypotheses: (hypotheses, ...).
    """
    limits = np.concatenate([np.zeros((1, *weights.shape[1:])), weights.cumsum(axis=0)])
    last = len(weights) - 1 - (weights > 0.0)[::-1].argmax(axis=0)
    chosen = np.minimum((limits[1:] <= hypothesis).sum(axis=0), last)
    begin = np.take_along_axis(limits, chosen[None], 0)[0]
    weight = np.take_along_axis(weights, chosen[None], 0)[0]
    changed: Floats = begin + weight * (INSIDE + (1.0 - 2.0 * INSIDE) * draws)
    return changed


def layer_sums(mass: Floats) -> Floats:
    """The sum of each layer, in an order that does not depend on the batch: (M, ...).

    Args:
        mass: (M, R, N, ...).
    """
    sums: Floats = mass.sum(axis=1).cumsum(axis=1)[:, -1]
    return sums


@dataclass(frozen=True)
class SharedDrift:
    """What searches and finds say about the hypothesis of all persons.

    Attributes:
        finds: w_k, the weights given the finds; they sum to 1: float64, (hypotheses, ...).
        missed: m_ik: float64, (persons, hypotheses, ...).
        posterior: p_k: float64, (hypotheses, ...).
    """

    finds: Floats
    missed: Floats
    posterior: Floats

    @classmethod
    def begun(cls, weights: Floats, persons: int) -> SharedDrift:
        """Before the first search; weights: (hypotheses, ...)."""
        return cls(weights.copy(), np.ones((persons, *weights.shape)), weights.copy())

    def take(self, rows: Ints) -> SharedDrift:
        """Some rows of a batch; new arrays."""
        return SharedDrift(*(values[..., rows] for values in self._arrays))

    def put(self, rows: Ints, other: SharedDrift) -> None:
        """Replace some rows of a batch, in place."""
        for values, new in zip(self._arrays, other._arrays, strict=True):
            values[..., rows] = new

    def resized(self, hypotheses: int) -> SharedDrift:
        """With so many hypotheses; those that are added have weight 0, those left out had."""
        count = len(self.finds)
        more = max(hypotheses - count, 0)

        def resize(values: Floats, axis: int, new: float) -> Floats:
            padding = [(0, 0)] * values.ndim
            padding[axis] = (0, more)
            padded = np.pad(values, padding, constant_values=new)
            return padded.take(np.arange(hypotheses), axis)

        return SharedDrift(
            finds=resize(self.finds, 0, 0.0),
            missed=resize(self.missed, 1, 1.0),
            posterior=resize(self.posterior, 0, 0.0),
        )

    @property
    def _arrays(self) -> tuple[Floats, Floats, Floats]:
        return self.finds, self.missed, self.posterior

    def after_search(
        self, sums: Floats, found: Flags, found_in: Floats, missing: Flags
    ) -> SharedDrift:
        """After the searches of a step.

        Args:
            sums: of the layers of each person's mass after the searches, which held the posterior
                weights before: (persons, hypotheses, ...).
            found: who has been found in this step: bool, (persons, ...).
            found_in: the mass before the searches, in each layer, of the cell where each of these
                was found: (persons, hypotheses, ...).
            missing: who has not been found: bool, (persons, ...).
        """
        before = self.posterior
        known = before > 0.0
        divisor = np.where(known, before, 1.0)
        left = np.where(known, np.minimum(sums / divisor, 1.0), 1.0)
        missed = self.missed * left
        finds = self.finds
        for is_found, seen, missed_before in zip(found, found_in, self.missed, strict=True):
            here = np.where(known, missed_before * (seen / divisor), 0.0)
            finds = finds * np.where(is_found, here, 1.0)
        finds = normalised(finds, self.finds)
        posterior = finds
        for person_missed, is_missing in zip(missed, missing, strict=True):
            posterior = posterior * np.where(is_missing, person_missed, 1.0)
        return SharedDrift(finds, missed, normalised(posterior, before))

    def failure(self, missing: Flags) -> Floats:
        """The probability that no search finds each person, given the finds: (persons, ...).

        It is 0 for those who have been found.
        """
        failure = (self.finds * self.missed).cumsum(axis=1)[:, -1]
        return np.where(missing, np.minimum(failure, 1.0), 0.0)

    def scale(self, sums: Floats) -> Floats:
        """The factors of the layers of each person's mass: (persons, hypotheses, ...)."""
        is_left = sums > 0.0
        return np.where(is_left, self.posterior / np.where(is_left, sums, 1.0), 0.0)

    def worths(self, missing: Flags) -> Floats:
        """What turns the mass in each layer into unconditional probability of a find.

        The probability that a search of a cell is the first to find a person is the sum over the
        layers of this times the mass times the probability of detection: (persons, hypotheses,
        ...), 0 for persons who have been found.
        """
        known = self.posterior > 0.0
        weights = self.finds * self.missed
        worths = np.where(known, weights / np.where(known, self.posterior, 1.0), 0.0)
        return worths * missing[:, None]


def normalised(weights: Floats, otherwise: Floats) -> Floats:
    """Weights, (hypotheses, ...), that sum to 1; others where they are all 0."""
    total = weights.cumsum(axis=0)[-1]
    is_possible = total > 0.0
    return np.where(is_possible, weights / np.where(is_possible, total, 1.0), otherwise)


# One search.


def after_shared_search(
    shared: SharedDrift,
    beliefs: Sequence[Belief],
    cells: Collection[int],
    found: Mapping[int, int],
    missing: Collection[int],
) -> tuple[SharedDrift, list[Belief]]:
    """The beliefs after the searches of a step, and after its finds.

    Args:
        shared: before the step.
        beliefs: about all persons, before the step.
        cells: that are searched.
        found: the persons who are found in this step, and in which cell.
        missing: the persons who are missing after it.
    """
    searched = of_each_kind(lambda belief: belief.searched(cells), beliefs)
    sums = np.array([layer_sums(mass) for mass in searched])
    found_in = np.zeros_like(sums)
    for person, cell in found.items():
        belief = beliefs[person]
        found_in[person] = belief.mass.reshape(-1)[belief.model.states(cell)]
    persons = range(len(beliefs))
    is_found = np.array([person in found for person in persons])
    is_missing = np.array([person in missing for person in persons])
    after = shared.after_search(sums, is_found, found_in, is_missing)
    factors = after.scale(sums)
    failures = after.failure(is_missing).tolist()
    masses: dict[int, Floats] = {}  # after the step, which persons who are alike go on to share
    for belief, mass, factor in zip(beliefs, searched, factors, strict=True):
        # If the searches contradict the belief, it stays.
        if id(mass) not in masses:
            masses[id(mass)] = mass * factor[:, None, None] if factor.any() else belief.mass
    changed = [
        belief._replace(mass=masses[id(mass)], failure=failure)
        for belief, mass, failure in zip(beliefs, searched, failures, strict=True)
    ]
    return after, changed


def shared_added_success(
    shared: SharedDrift,
    beliefs: Sequence[Belief],
    cells: Sequence[int],
    missing: Collection[int],
    alive: Sequence[float],
) -> list[Floats]:
    """`Belief.added_success` of each person, given the probability of being alive."""
    is_missing = np.array([person in missing for person in range(len(beliefs))])
    added = []
    for belief, worths, chance in zip(beliefs, shared.worths(is_missing), alive, strict=True):
        flat = belief.mass.reshape(-1)
        masses = np.array([flat[belief.model.states(cell)] for cell in cells]).T  # (hypotheses, n)
        share = (worths[:, None] * masses).cumsum(axis=0)[-1]
        added.append(belief.detection * chance * share)
    return added
