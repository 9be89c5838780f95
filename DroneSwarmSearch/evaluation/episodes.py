"""What happened in evaluated episodes, and the calibration of the matrix in them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch.evaluation.statistics import ROUNDING

__all__ = ["POS_EDGES", "Coverage", "Episodes", "Reliability"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


POS_EDGES = (0.0, 0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, math.inf)
"""The edges of the bins. Probabilities of single cells are small, so nearly all searches would
lie in the first of several bins of equal width."""


@dataclass(frozen=True, eq=False)
class Reliability:
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
    Meteorology 12, 1973; M. DeGroot and S. Fienberg, The comparison and evaluation of
    forecasters, The Statistician 32, 1983.

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

    @classmethod
    def total(cls, parts: Sequence[Reliability]) -> Reliability:
        """The sum of several tables, in their order, so that rounding is reproducible."""
        whole = cls.empty()
        for part in parts:
            whole.searches[:] += part.searches
            whole.forecast[:] += part.forecast
            whole.found[:] += part.found
        return whole

    def count(self, forecasts: Floats, found: Ints) -> None:
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
    def mean_forecast(self) -> Floats:
        """The mean forecast in each bin; NaN without searches."""
        return _ratio(self.forecast, self.searches)

    @property
    def share_found(self) -> Floats:
        """Persons found per search in each bin; NaN without searches."""
        return _ratio(self.found, self.searches)

    @property
    def expected_error(self) -> float:
        """The expected calibration error over all searches; 0 without any.

        M. Naeini, G. Cooper and M. Hauskrecht, Obtaining well calibrated probabilities using
        Bayesian binning, AAAI 2015, with the bins of `POS_EDGES`.
        """
        total = int(self.searches.sum())
        if not total:
            return 0.0
        return float(np.abs(self.forecast - self.found).sum() / total)


def _ratio(above: NDArray[np.number], below: Ints) -> Floats:
    out = np.full(len(below), np.nan)
    np.divide(above, below, out=out, where=below > 0)
    return out


@dataclass(frozen=True, eq=False)
class Coverage:
    """What the searches of some coverage missions covered, in the order of their seeds.

    Attributes:
        searches: the number of searches: int64, (n,).
        cells_searched: the number of different cells searched: int64, (n,).
    """

    searches: Ints
    cells_searched: Ints


@dataclass(frozen=True, eq=False)
class Episodes:
    """What happened in some episodes, in the order of their seeds.

    Attributes:
        found_at: the step in which each person was found, from 1, or 0 for never: int64,
            (n, persons).
        endings: the `Ending` of each episode: int64, (n,).
        steps: the number of steps: int64, (n,).
        returns: the sum of all drones' rewards: float64, (n,).
        reliability: of the forecasts of all searches made; empty in the coverage mission,
            where no search finds anybody.
        curves: the probability of success after each number of completed steps, from 0 to the
            time limit L: float64, (n, L + 1). In a rescue, it is the probability that every
            person is found, given the path that the drones fly if the last find is left out; in
            the coverage mission, the cumulative probability of success (POS). If all episodes
            have the same curve, its shape may be (1, L + 1). None if it was not followed.
        coverage: what the searches covered, in the coverage mission; otherwise None.
    """

    found_at: Ints
    endings: Ints
    steps: Ints
    returns: Floats
    reliability: Reliability
    curves: Floats | None = None
    coverage: Coverage | None = None

    def __len__(self) -> int:
        return len(self.endings)

    @classmethod
    def joined(cls, parts: Sequence[Episodes]) -> Episodes:
        """Join several portions, in their order."""
        curves = [part.curves for part in parts if part.curves is not None]
        coverages = [part.coverage for part in parts if part.coverage is not None]
        coverage = None
        if coverages:
            coverage = Coverage(
                np.concatenate([each.searches for each in coverages]),
                np.concatenate([each.cells_searched for each in coverages]),
            )
        return cls(
            np.concatenate([part.found_at for part in parts]),
            np.concatenate([part.endings for part in parts]),
            np.concatenate([part.steps for part in parts]),
            np.concatenate([part.returns for part in parts]),
            Reliability.total([part.reliability for part in parts]),
            np.concatenate(curves) if curves else None,
            coverage,
        )

    def with_common_curve(self) -> Episodes:
        """The episodes of a deterministic policy, all of which have the same curve.

        Raises:
            ValueError: the curves differ.
        """
        curves = self.curves
        assert curves is not None
        if np.abs(curves - curves[0]).max() > ROUNDING:
            raise ValueError(
                "deterministic must be False for a policy that acts differently after the same "
                "observations"
            )
        return replace(self, curves=curves[:1])

    @property
    def arrays(self) -> dict[str, NDArray[Any]]:
        """Everything as arrays, for a file."""
        arrays: dict[str, NDArray[Any] | None] = {
            **{name: getattr(self, name) for name in _ARRAYS},
            **{f"reliability_{name}": getattr(self.reliability, name) for name in _RELIABILITY},
        }
        if self.coverage is not None:
            arrays |= {f"coverage_{name}": getattr(self.coverage, name) for name in _COVERAGE}
        return {name: array for name, array in arrays.items() if array is not None}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[Any]]) -> Episodes:
        """Make episodes from their `arrays`."""
        reliability = Reliability(*(arrays[f"reliability_{name}"] for name in _RELIABILITY))
        coverage = None
        if "coverage_searches" in arrays:
            coverage = Coverage(*(arrays[f"coverage_{name}"] for name in _COVERAGE))
        known = {name: arrays[name] for name in _ARRAYS if name in arrays}
        return cls(**known, reliability=reliability, coverage=coverage)


_ARRAYS = ("found_at", "endings", "steps", "returns", "curves")
_RELIABILITY = ("searches", "forecast", "found")
_COVERAGE = ("searches", "cells_searched")
