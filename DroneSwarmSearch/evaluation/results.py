"""Results of evaluations: estimates, comparisons of two policies, and their files."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import DroneSwarmSearch
from DroneSwarmSearch._internal.files import write_text
from DroneSwarmSearch.evaluation import statistics
from DroneSwarmSearch.evaluation.episodes import POS_EDGES, Coverage, Episodes, Reliability
from DroneSwarmSearch.evaluation.statistics import Band, Estimate, ExactValue
from DroneSwarmSearch.evaluation.suite import SUITE_VERSION, NamedSearch, versions
from DroneSwarmSearch.evaluation.view import View
from DroneSwarmSearch.planning.bound import SuccessBound
from DroneSwarmSearch.rules import Ending

__all__ = [
    "Comparison",
    "Evaluation",
    "bound_data",
    "checked_bound",
    "compare",
    "csv_text",
    "save_csv",
    "save_episodes",
    "save_json",
]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def checked_bound(bound: object, search: NamedSearch) -> SuccessBound | None:
    """Return a search's bound, or None.

    Raises:
        TypeError: it is not a bound.
        ValueError: it belongs to another search.
    """
    if bound is None:
        return None
    if not isinstance(bound, SuccessBound):
        raise TypeError(
            f"bound must be what planning.success_bound returns, or None, got {bound!r:.100}"
        )
    steps = search.scenario.timestep_limit
    if bound.by_time.shape != (steps + 1,):
        raise ValueError(
            f"bound must be that of {search.name}, with a by_time of shape ({steps + 1},), "
            f"got {bound.by_time.shape}"
        )
    return bound


def bound_data(bound: SuccessBound) -> dict[str, Any]:
    """A bound as plain JSON data."""
    return {**asdict(bound), "by_time": bound.by_time.tolist()}


@dataclass(frozen=True, eq=False)
class Evaluation:
    """The episodes of a policy on a search, and the estimates that follow from them.

    An episode is a success if every person is found by the time limit. Nobody is found in the
    coverage mission; success is then the probability of success (POS) of the searches made, the
    mean over persons.

    Attributes:
        policy: the policy's name.
        search: the search, with `bayesian_update` as it was evaluated.
        seed: of the first episode; episode i has the seed `seed + i`.
        view: what the policy saw.
        episodes: what happened.
        is_exact: whether success, its curve and the time have no sampling error.
        bound: the upper bound for this search, or None.
    """

    policy: str
    search: NamedSearch
    seed: int
    view: View
    episodes: Episodes
    is_exact: bool
    bound: SuccessBound | None = None

    def __repr__(self) -> str:
        value, low, high = self.success.scaled(100.0)
        measure = "success" if self.coverage is None else "POS"
        interval = "exact" if self.is_exact else f"{low:.1f} to {high:.1f}"
        return (
            f"<Evaluation of {self.policy} on {self.search.name}: {len(self.episodes):,} episodes, "
            f"{value:.1f}% {measure} ({interval})>"
        )

    def with_bound(self, bound: SuccessBound | None) -> Evaluation:
        """Return the evaluation with the search's bound.

        Raises:
            TypeError: it is not a bound.
            ValueError: it belongs to another search.
        """
        return replace(self, bound=checked_bound(bound, self.search))

    @property
    def limit(self) -> int:
        """The time limit L."""
        return self.search.scenario.timestep_limit

    @property
    def curves(self) -> Floats:
        """The probability of success of each episode after each step: float64, (n, L + 1).

        If it is exact, there is one row, for all episodes. See `Episodes.curves`.
        """
        assert self.episodes.curves is not None
        return self.episodes.curves

    @property
    def exact(self) -> Floats | None:
        """The exact probability of success after each step, (L + 1,); None if it is sampled."""
        return self.curves[0] if self.is_exact else None

    @property
    def method(self) -> str:
        """How success, its curve and the time were computed.

        "exact": without sampling error. "conditional": as means over sampled paths of the
        probability of success given the path (conditional Monte Carlo).
        """
        return "exact" if self.is_exact else "conditional"

    @property
    def coverage(self) -> Coverage | None:
        """What the searches of a coverage mission covered; None for another mission."""
        return self.episodes.coverage

    @cached_property
    def found_by(self) -> Ints:
        """The step in which the last person was found, 0 for a failure: int64, (n,)."""
        found_at = self.episodes.found_at
        everybody = (found_at > 0).all(axis=1)
        return np.where(everybody, found_at.max(axis=1), 0)

    @cached_property
    def times(self) -> Floats:
        """The expected time to find given the path of each episode: float64, shape (n,).

        It is the area above the curve; in the coverage mission the mean over persons. Failures
        count with the time limit.

        Their mean is the restricted mean time to find, the area above the success curve. It is
        defined even where many episodes fail: P. Royston and M. Parmar, Restricted mean
        survival time: an alternative to the hazard ratio, BMC Medical Research Methodology
        13:152, 2013.
        """
        times: Floats = (1.0 - self.curves[:, :-1]).sum(axis=1)
        return times

    @cached_property
    def success_by_time(self) -> Band:
        """The success within t steps, t = 0..L, with its interval: (L + 1,).

        It is exact, or the mean of `curves` with Hall's interval.
        """
        if self.is_exact:
            return Band(self.curves[0], self.curves[0], self.curves[0])
        return statistics.bounded_means(self.curves)

    @property
    def success(self) -> Estimate:
        """The success by the time limit, exact or with its interval."""
        if self.is_exact:
            return ExactValue.of(float(self.curves[0, -1]))
        return self.success_by_time.at(-1)

    @cached_property
    def time(self) -> Estimate:
        """The restricted mean time to find, in steps, exact or with Hall's interval."""
        if self.is_exact:
            return ExactValue.of(math.fsum((1.0 - self.curves[0, :-1]).tolist()))
        return statistics.bounded_mean(self.times, most=self.limit)

    @cached_property
    def sampled_success(self) -> Estimate | None:
        """The share of episodes that succeeded, with Wilson's interval, whatever success is.

        The exact success is the forecast, and this share is what was found; its interval holds
        the forecast in about 95% of evaluations. None in the coverage mission.
        """
        if self.coverage is not None:
            return None
        return statistics.wilson(np.count_nonzero(self.found_by), len(self.episodes)).at(())

    @cached_property
    def mean_return(self) -> Estimate:
        """The mean return of the team, with its bootstrap interval.

        It is exact in the coverage mission of a deterministic policy, whose episodes are all equal.
        """
        return self._mean(self.episodes.returns)

    @cached_property
    def coverage_rate(self) -> Estimate | None:
        """The mean share of the grid's cells that were searched; None without coverage."""
        if self.coverage is None:
            return None
        return self._mean_per_cell(self.coverage.cells_searched)

    @cached_property
    def repetition_rate(self) -> Estimate | None:
        """The mean number of repeated searches, divided by the number of cells of the grid.

        A search is repeated if its cell was searched before in the episode, by any drone. The
        rate may exceed 1. None without coverage.
        """
        if self.coverage is None:
            return None
        return self._mean_per_cell(self.coverage.searches - self.coverage.cells_searched)

    def _mean_per_cell(self, counts: Ints) -> Estimate:
        return self._mean(counts / self.search.scenario.grid_size**2)

    def _mean(self, values: Floats) -> Estimate:
        """The mean over the episodes; exact if all episodes are equal."""
        if self.is_exact and self.coverage is not None:
            return ExactValue.of(float(values[0]))
        return statistics.bootstrap_mean(values)

    @property
    def share_of_bound(self) -> Estimate | None:
        """The success divided by the bound; None without a bound above 0."""
        if self.bound is None or not self.bound.by_limit > 0.0:
            return None
        return self.success.scaled(1.0 / self.bound.by_limit)

    @property
    def reliability(self) -> Reliability:
        """The calibration of the matrix that the policy saw; empty in the coverage mission."""
        return self.episodes.reliability

    @property
    def endings(self) -> dict[Ending, int]:
        """The number of episodes with each ending."""
        counts = np.bincount(self.episodes.endings, minlength=len(Ending) + 1).tolist()
        return {ending: counts[ending] for ending in Ending}

    @property
    def data(self) -> dict[str, Any]:
        """Everything except the single episodes, as plain JSON data."""
        by_time = self.success_by_time
        return {
            **versions(),
            "policy": self.policy,
            "search": self.search.name,
            "parameters": self.search.data,
            "view": self.view.form,
            "observation": self.view.observation,
            "action_mask": self.view.action_mask,
            "right_of_way": self.view.right_of_way,
            "episodes": len(self.episodes),
            "seed": self.seed,
            "confidence": statistics.CONFIDENCE,
            "method": self.method,
            "success": self.success.data,
            "sampled_success": self.sampled_success and self.sampled_success.data,
            "restricted_mean_time": self.time.data,
            "mean_return": self.mean_return.data,
            **{name: rate.data for name, rate in self._rates.items()},
            "share_of_bound": self.share_of_bound and self.share_of_bound.data,
            "endings": {ending.name.lower(): count for ending, count in self.endings.items()},
            "success_by_time": {name: curve.tolist() for name, curve in by_time._asdict().items()},
            "bound": self.bound and bound_data(self.bound),
            "calibration": self._calibration if self.coverage is None else None,
        }

    @property
    def _rates(self) -> dict[str, Estimate]:
        """The rates of the coverage mission by name; empty for another mission."""
        rates = {"coverage_rate": self.coverage_rate, "repetition_rate": self.repetition_rate}
        return {name: rate for name, rate in rates.items() if rate is not None}

    @property
    def _calibration(self) -> dict[str, Any]:
        reliability = self.reliability
        return {
            "from": list(POS_EDGES[:-1]),
            "searches": reliability.searches.tolist(),
            "mean_forecast": _without_nan(reliability.mean_forecast),
            "share_found": _without_nan(reliability.share_found),
            "expected_error": reliability.expected_error,
        }

    @property
    def summary(self) -> dict[str, Any]:
        """The main estimates as one row of a table."""
        row: dict[str, Any] = {
            "package": DroneSwarmSearch.__version__,
            "suite": SUITE_VERSION,
            "policy": self.policy,
            "search": self.search.name,
            "bayesian_update": self.search.scenario.bayesian_update,
            "episodes": len(self.episodes),
            "seed": self.seed,
            "timestep_limit": self.limit,
            "method": self.method,
        }
        for name, estimate in (
            ("success", self.success),
            ("restricted_mean_time", self.time),
            ("mean_return", self.mean_return),
            ("share_of_bound", self.share_of_bound),
            ("sampled_success", self.sampled_success),
            *self._rates.items(),
        ):
            value, low, high = estimate or ("", "", "")
            row |= {name: value, f"{name}_low": low, f"{name}_high": high}
        bound = self.bound
        row["bound"] = "" if bound is None else bound.by_limit
        row["bound_gap"] = "" if bound is None else bound.gap
        row["bound_confidence"] = "" if bound is None else bound.confidence
        row |= {ending.name.lower(): count for ending, count in self.endings.items()}
        row["calibration_error"] = self.reliability.expected_error if self.coverage is None else ""
        return row


@dataclass(frozen=True)
class Comparison:
    """Two policies on one search: differences, first minus second.

    If both evaluations are exact, so are the differences; if one is, the interval is that of the
    other. If neither is, they are taken in the same episodes.

    Attributes:
        policies: their names.
        search: the search's name.
        success: the difference in success; of two samples, with Hall's interval for the paired
            differences. Above 0, the first policy is better.
        time: the difference in the restricted mean time to find, in steps, likewise. Below 0, the
            first policy is faster.
    """

    policies: tuple[str, str]
    search: str
    success: Estimate
    time: Estimate


def compare(first: Evaluation, second: Evaluation) -> Comparison:
    """Compare two policies on one search.

    Two samples use common random numbers, so the intervals of the differences are narrower than
    those of independent samples. One policy may have seen the prior and the other the posterior.

    Raises:
        ValueError: the evaluations are of different searches; or one of them is not exact, and
            they are of different episodes.
    """
    one, other = (each.search.with_posterior(False) for each in (first, second))
    if one.fingerprint != other.fingerprint:
        raise ValueError(
            "second must be of the same search as first, with the same parameters, got "
            f"{second.search.name!r} and {first.search.name!r}"
        )
    names = (first.policy, second.policy), first.search.name
    mine, theirs = ((each.seed, len(each.episodes)) for each in (first, second))
    if mine != theirs and not (first.is_exact and second.is_exact):
        raise ValueError(
            f"second must be of the same episodes as first, {mine[1]} from seed {mine[0]}, "
            f"got {theirs[1]} from seed {theirs[0]}"
        )
    if first.is_exact or second.is_exact:
        return Comparison(
            *names,
            statistics.difference(first.success, second.success),
            statistics.difference(first.time, second.time),
        )
    times = first.times - second.times
    gained = first.curves[:, -1] - second.curves[:, -1]
    return Comparison(
        *names,
        statistics.bounded_mean(gained, -1.0, 1.0),
        statistics.bounded_mean(times, -first.limit, first.limit),
    )


# Files.


def save_json(path: str | Path, evaluations: Evaluation | Iterable[Evaluation]) -> None:
    """Write one evaluation, or a list of several, as JSON (`Evaluation.data`).

    Raises:
        StorageError: the file cannot be written.
    """
    data: Any
    if isinstance(evaluations, Evaluation):
        data = evaluations.data
    else:
        data = [each.data for each in evaluations]
    write_text(Path(path), json.dumps(data, indent=1, allow_nan=False) + "\n")


def save_csv(path: str | Path, evaluations: Iterable[Evaluation]) -> None:
    """Write the main estimates as CSV, one row for each evaluation (`Evaluation.summary`).

    Raises:
        StorageError: the file cannot be written.
        ValueError: there is no evaluation.
    """
    write_text(Path(path), csv_text(evaluations))


def csv_text(evaluations: Iterable[Evaluation]) -> str:
    """Return the text that `save_csv` writes."""
    rows = [each.summary for each in evaluations]
    if not rows:
        raise ValueError("evaluations must be at least one, got none")
    names = list(dict.fromkeys(name for row in rows for name in row))
    return _csv(names, [[row.get(name, "") for name in names] for row in rows])


def save_episodes(path: str | Path, evaluation: Evaluation) -> None:
    """Write the single episodes as CSV.

    The columns are seed, success, ending, steps, return and finds; in the coverage mission seed,
    ending, steps, return, POS, searches and different cells searched.

    Raises:
        StorageError: the file cannot be written.
    """
    episodes, coverage = evaluation.episodes, evaluation.coverage
    columns: dict[str, Iterable[Any]] = {
        "seed": range(evaluation.seed, evaluation.seed + len(episodes)),
        "success": (evaluation.found_by > 0).astype(int).tolist(),
        "ending": [Ending(ending).name.lower() for ending in episodes.endings.tolist()],
        "steps": episodes.steps.tolist(),
        "return": episodes.returns.tolist(),
    }
    if coverage is None:
        columns["found_by"] = evaluation.found_by.tolist()
        for person, steps in enumerate(episodes.found_at.T.tolist()):
            columns[f"person{person}_found_at"] = steps
    else:
        del columns["success"]
        columns["probability_of_success"] = np.broadcast_to(
            evaluation.curves[:, -1], len(episodes)
        ).tolist()
        columns["searches"] = coverage.searches.tolist()
        columns["cells_searched"] = coverage.cells_searched.tolist()
    write_text(Path(path), _csv(list(columns), zip(*columns.values(), strict=True)))


def _csv(names: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(names)
    writer.writerows(rows)
    return out.getvalue()


def _without_nan(values: Floats) -> list[float | None]:
    """A list for JSON, which has no NaN."""
    return [None if math.isnan(value) else value for value in values.tolist()]
