"""What happened in evaluated episodes, and the calibration of the matrix in them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch._internal.arrays import Floats, Ints
from DroneSwarmSearch.evaluation.statistics import ROUNDING

__all__ = ["POS_EDGES", "Episodes", "Reliability"]

POS_EDGES = (0.0, 0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, math.inf)
"""The edges of the bins. Probabilities of single cells are small, so nearly all searches would
lie in the first of several bins of equal width."""


class Reliability(NamedTuple):
    """A reliability table: searches in bins of their forecast probability of success (POS).

    The forecast POS of a search is the probability that the matrix shows for the searched
    cell times the probability of detection. With several persons, the matrix is the mean
    over those missing; the forecast is then the expected number of persons found, the
    probability shown times the sum of the missing persons' probabilities of detection. It is
    exact if these probabilities, or the persons' forecasts, are equal.

    A posterior is calibrated: forecast and outcome agree in every bin, up to sampling error.
    A prior, which only follows the drift, is too high for cells searched before and, as long
    as nobody is found, too low for the others.

    A. H. Murphy, A new vector partition of the probability score, Journal of Applied
    Meteorology 12, 1973.

    Attributes:
        searches: the number of searches in each bin of `POS_EDGES`: int64, (bins,).
        forecast: the sum of their forecasts: float64, (bins,).
        found: the persons they found: int64, (bins,).
    """

    searches: Ints
    forecast: Floats
    found: Ints

    @classmethod
    def empty(cls) -> Reliability:
        """A table without searches."""
        bins = len(POS_EDGES) - 1
        return cls(np.zeros(bins, np.int64), np.zeros(bins), np.zeros(bins, np.int64))

    def add(self, forecasts: Floats, found: Ints) -> None:
        """Add searches, in place.

        Args:
            forecasts: the forecast of each search: float64, (n,).
            found: the persons each search found: int64, (n,).
        """
        bins = np.searchsorted(POS_EDGES, forecasts, side="right") - 1
        count = len(self.searches)
        self.searches[:] += np.bincount(bins, minlength=count)
        self.forecast[:] += np.bincount(bins, forecasts, minlength=count)
        self.found[:] += np.bincount(bins, found, minlength=count).astype(np.int64)

    @property
    def expected_error(self) -> float:
        """The expected calibration error over all searches; 0 without any.

        M. Naeini, G. Cooper and M. Hauskrecht, Obtaining well calibrated probabilities using
        Bayesian binning, AAAI 2015, with the bins of `POS_EDGES`.
        """
        total = max(int(self.searches.sum()), 1)
        return float(np.abs(self.forecast - self.found).sum() / total)


@dataclass(frozen=True, eq=False)
class Episodes:
    """What happened in some episodes, in the order of their seeds.

    Attributes:
        found_at: the step in which each person was found, from 1, or 0 for never: int64,
            (n, persons).
        endings: the `Ending` of each episode: int64, (n,).
        steps: the number of steps: int64, (n,).
        returns: the sum of all drones' rewards: float64, (n,).
        searches: the number of searches: int64, (n,).
        cells_searched: the number of different cells searched: int64, (n,).
        reliability: of the forecasts of all searches made; empty in the coverage mission,
            where no search finds anybody.
        curves: the probability of success after each number of completed steps, from 0 to the
            time limit L: float64, (n, L + 1). In a rescue, it is the probability that every
            person is found, given the path that the drones fly if the last find is left out; in
            the coverage mission, the cumulative probability of success (POS). If all episodes
            have the same curve, its shape may be (1, L + 1). It may also hold no curve.
    """

    found_at: Ints
    endings: Ints
    steps: Ints
    returns: Floats
    searches: Ints
    cells_searched: Ints
    reliability: Reliability
    curves: Floats

    def __len__(self) -> int:
        return len(self.endings)

    @classmethod
    def joined(cls, parts: Sequence[Episodes]) -> Episodes:
        """Join several portions, in their order."""
        reliability = Reliability.empty()
        for part in parts:  # in this order, so that rounding is reproducible
            for whole, more in zip(reliability, part.reliability, strict=True):
                np.add(whole, more, out=whole)
        arrays = {name: np.concatenate([vars(part)[name] for part in parts]) for name in _ARRAYS}
        return cls(**arrays, reliability=reliability)

    def with_common_curve(self) -> Episodes:
        """The episodes of a deterministic policy, all of which have the same curve.

        Raises:
            ValueError: the curves differ.
        """
        if np.abs(self.curves - self.curves[0]).max() > ROUNDING:
            raise ValueError(
                "deterministic must be False for a policy that acts differently after the same "
                "observations"
            )
        return replace(self, curves=self.curves[:1])

    @property
    def arrays(self) -> dict[str, NDArray[Any]]:
        """Everything as arrays, for a file."""
        table = self.reliability._asdict()
        return {
            **{name: vars(self)[name] for name in _ARRAYS},
            **{f"reliability_{name}": array for name, array in table.items()},
        }

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[Any]]) -> Episodes:
        """Make episodes from their `arrays`."""
        table = {name: arrays[f"reliability_{name}"] for name in Reliability._fields}
        return cls(**{name: arrays[name] for name in _ARRAYS}, reliability=Reliability(**table))


_ARRAYS = (
    *("found_at", "endings", "steps", "returns"),
    *("searches", "cells_searched", "curves"),
)
