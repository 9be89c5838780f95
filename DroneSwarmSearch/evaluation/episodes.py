"""What happened in evaluated episodes, and the calibration of the matrix in them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch.rules import Ending

__all__ = ["POS_EDGES", "Coverage", "Episodes", "Reliability", "is_curve"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


POS_EDGES = (0.0, 0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, math.inf)
"""The edges of the bins. Probabilities of single cells are small, so nearly all searches would
lie in the first of several bins of equal width."""


def is_curve(success: Floats) -> bool:
    """Whether probabilities of success after each step are possible: they never fall."""
    is_share = (success >= 0.0) & (success <= 1.0)
    return bool(is_share.all() and (np.diff(success) >= 0.0).all())


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
        probability_of_success: the cumulative probability of success (POS) after each number of
            completed steps, from 0 to the time limit L; after the end of an episode it stays
            as it is: float64, (n, L + 1).
        searches: the number of searches: int64, (n,).
        cells_searched: the number of different cells searched: int64, (n,).
    """

    probability_of_success: Floats
    searches: Ints
    cells_searched: Ints

    def common_curve(self) -> Floats:
        """The POS after each step of a deterministic policy, equal in all episodes: (L + 1,).

        Raises:
            ValueError: the episodes differ.
        """
        first: Floats = self.probability_of_success[0]
        if (self.probability_of_success != first).any():
            raise ValueError(
                "deterministic must be False for a policy that acts differently after the same "
                "observations"
            )
        return first

    @property
    def data(self) -> dict[str, Any]:
        """Plain data, which JSON keeps exactly."""
        return {
            "probability_of_success": self.probability_of_success.tolist(),
            "searches": self.searches.tolist(),
            "cells_searched": self.cells_searched.tolist(),
        }

    @classmethod
    def joined(cls, parts: Sequence[Coverage]) -> Coverage:
        """Join several portions, in their order."""
        return cls(
            np.concatenate([part.probability_of_success for part in parts]),
            np.concatenate([part.searches for part in parts]),
            np.concatenate([part.cells_searched for part in parts]),
        )

    @classmethod
    def from_data(cls, data: Any) -> Coverage:
        """Make coverage from its `data`.

        Raises:
            ValueError: the data are of another form, or inconsistent.
        """
        try:
            success = np.array(data["probability_of_success"], np.float64)
            searches, cells = np.array(data["searches"]), np.array(data["cells_searched"])
        except (KeyError, OverflowError, TypeError, ValueError) as error:
            raise ValueError(f"data must be that of coverage: {error!r}") from error
        if not (
            success.ndim == 2
            and searches.shape == cells.shape == (len(success),)
            and searches.dtype.kind == cells.dtype.kind == "i"
            and is_curve(success)
            and ((cells >= 0) & (cells <= searches)).all()
        ):
            raise ValueError("data must be that of coverage, but it is inconsistent")
        return cls(success, searches, cells)


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
        coverage: what the searches covered, in the coverage mission; otherwise None.
    """

    found_at: Ints
    endings: Ints
    steps: Ints
    returns: Floats
    reliability: Reliability
    coverage: Coverage | None = None

    def __len__(self) -> int:
        return len(self.endings)

    @classmethod
    def joined(cls, parts: Sequence[Episodes]) -> Episodes:
        """Join several portions, in their order."""
        coverages = [part.coverage for part in parts if part.coverage is not None]
        return cls(
            np.concatenate([part.found_at for part in parts]),
            np.concatenate([part.endings for part in parts]),
            np.concatenate([part.steps for part in parts]),
            np.concatenate([part.returns for part in parts]),
            Reliability.total([part.reliability for part in parts]),
            Coverage.joined(coverages) if coverages else None,
        )

    @property
    def data(self) -> dict[str, Any]:
        """Plain data, which JSON keeps exactly."""
        data = {
            "found_at": self.found_at.tolist(),
            "endings": self.endings.tolist(),
            "steps": self.steps.tolist(),
            "returns": self.returns.tolist(),
            "searches": self.reliability.searches.tolist(),
            "forecast": self.reliability.forecast.tolist(),
            "found": self.reliability.found.tolist(),
        }
        return data if self.coverage is None else {**data, "coverage": self.coverage.data}

    @classmethod
    def from_data(cls, data: Any) -> Episodes:
        """Make episodes from their `data`.

        Raises:
            ValueError: the data are of another form, or inconsistent.
        """
        try:
            found_at = np.array(data["found_at"])
            endings, steps = np.array(data["endings"]), np.array(data["steps"])
            returns = np.array(data["returns"], np.float64)
            searches, found = np.array(data["searches"]), np.array(data["found"])
            forecast = np.array(data["forecast"], np.float64)
            coverage = Coverage.from_data(data["coverage"]) if "coverage" in data else None
        except (KeyError, OverflowError, TypeError, ValueError) as error:
            raise ValueError(f"data must be that of episodes: {error!r}") from error
        n, bins = endings.size, (len(POS_EDGES) - 1,)
        counts, sums = (found_at, endings, steps, searches, found), (returns, forecast)
        if not (
            all(array.dtype.kind == "i" and (array >= 0).all() for array in counts)
            and all(np.isfinite(array).all() for array in sums)
            and found_at.ndim == 2
            and found_at.shape[0] == n > 0
            and endings.shape == steps.shape == returns.shape == (n,)
            and searches.shape == found.shape == forecast.shape == bins
            and endings.min() >= 1
            and endings.max() <= len(Ending)
            and (found_at <= steps[:, None]).all()
            and (coverage is None or coverage.searches.shape == (n,))
        ):
            raise ValueError("data must be that of episodes, but it is inconsistent")
        reliability = Reliability(searches, forecast, found)
        return cls(found_at, endings, steps, returns, reliability, coverage)
