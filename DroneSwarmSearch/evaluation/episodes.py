"""What happened in evaluated episodes, and the calibration of the matrix in them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from DroneSwarmSearch._internal.arrays import Floats, Ints
from DroneSwarmSearch.evaluation.statistics import ROUNDING

POS_EDGES = (0.0, 0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, math.inf)
"""The edges of the bins: narrow for small values, since most cells have a small probability."""


class Reliability(NamedTuple):
    """A reliability table: searches in bins of their forecast probability of success (POS).

    The forecast POS of a search is the probability that the matrix shows for the searched cell
    times the probability of detection; with several persons, times the sum of the missing
    persons' probabilities of detection: the expected number of persons found. That is exact if
    these probabilities, or the persons' forecasts, are equal.

    A posterior is calibrated: forecast and outcome agree in every bin, up to sampling error. A
    prior is too high for cells searched before and, as long as nobody is found, too low for the
    others. A. H. Murphy, A new vector partition of the probability score, Journal of Applied
    Meteorology 12, 1973.

    Of each bin of `POS_EDGES`: the number of searches, the sum of their forecasts, and the persons
    they found: float64, (bins,).
    """

    searches: Floats
    forecast: Floats
    found: Floats

    @property
    def expected_error(self) -> float:
        """The expected calibration error over all searches; 0 without any.

        M. Naeini, G. Cooper and M. Hauskrecht, Obtaining well calibrated probabilities using
        Bayesian binning, AAAI 2015, with the bins of `POS_EDGES`.
        """
        total = max(float(self.searches.sum()), 1.0)
        return float(np.abs(self.forecast - self.found).sum() / total)


@dataclass(frozen=True, eq=False)
class Episodes:
    """What happened in n episodes, in the order of their seeds.

    Attributes:
        found_at: the step in which each person was found, from 1, or 0 for never: int64,
            (n, persons).
        endings: the `Ending` of each episode: int64, (n,).
        steps: the number of steps: int64, (n,).
        returns: the sum of all drones' rewards: float64, (n,).
        searches: the number of searches: int64, (n,).
        cells_searched: the number of different cells searched: int64, (n,).
        forecasts: the `Reliability` of the forecasts of all searches: float64, (n, 3, bins); 0 in
            the coverage mission, where no search finds anybody.
        curves: the probability of success after each number of completed steps, from 0 to the
            time limit L: float64, (n, L + 1). In a rescue, it is the probability that every
            person is found, given the path that the drones fly if the last find is left out; in
            the coverage mission, the cumulative probability of success (POS). Its shape is
            (1, L + 1) if all episodes have the same curve.
    """

    found_at: Ints
    endings: Ints
    steps: Ints
    returns: Floats
    searches: Ints
    cells_searched: Ints
    forecasts: Floats
    curves: Floats

    def __len__(self) -> int:
        return len(self.endings)

    @classmethod
    def empty(cls, n: int, persons: int, limit: int) -> Episodes:
        """Episodes in which nothing has happened."""
        return cls(
            found_at=np.zeros((n, persons), np.int64),
            endings=np.zeros(n, np.int64),
            steps=np.zeros(n, np.int64),
            returns=np.zeros(n),
            searches=np.zeros(n, np.int64),
            cells_searched=np.zeros(n, np.int64),
            forecasts=np.zeros((n, len(Reliability._fields), len(POS_EDGES) - 1)),
            curves=np.zeros((n, limit + 1)),
        )

    @classmethod
    def joined(cls, parts: Sequence[Episodes]) -> Episodes:
        """Join several portions, in their order."""
        columns = zip(*(vars(part).values() for part in parts), strict=True)
        return cls(*map(np.concatenate, columns))

    def with_common_curve(self) -> Episodes:
        """Episodes with one curve, of a deterministic policy; raises ValueError if they differ."""
        _check_deterministic(np.ptp(self.curves, axis=0))
        return replace(self, curves=self.curves[:1])

    def check_alike(self, other: Episodes) -> None:
        """Raise a ValueError unless a policy had the same curves in other episodes."""
        _check_deterministic(np.abs(self.curves - other.curves))


def _check_deterministic(differences: Floats) -> None:
    """Raise a ValueError if curves differ by more than rounding."""
    if differences.max() > ROUNDING:
        raise ValueError(
            "deterministic must be False for a policy that acts differently after the same "
            "observations"
        )
