"""Results of evaluations: estimates, comparisons of two policies, and their table as CSV."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

import DroneSwarmSearch
from DroneSwarmSearch._internal.arrays import Floats, Ints
from DroneSwarmSearch._internal.files import write_text
from DroneSwarmSearch.evaluation.episodes import Episodes, Reliability
from DroneSwarmSearch.evaluation.statistics import (
    Estimate,
    ExactValue,
    bounded_mean,
    difference,
)
from DroneSwarmSearch.evaluation.suite import SUITE_VERSION, NamedSearch
from DroneSwarmSearch.evaluation.view import View
from DroneSwarmSearch.planning.bound import SuccessBound
from DroneSwarmSearch.rules import Ending

__all__ = ["Comparison", "Evaluation", "compare", "csv_text", "save_csv"]


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
        is_exact: whether success, its curve and the time have no sampling error. Otherwise, they
            are means over sampled paths of the probability of success given the path
            (conditional Monte Carlo).
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
        interval = "exact" if self.is_exact else f"{low:.1f} to {high:.1f}"
        return (
            f"<Evaluation of {self.policy} on {self.search.name}: {len(self.episodes):,} episodes, "
            f"{value:.1f}% {'POS' if self.is_coverage else 'success'} ({interval})>"
        )

    @property
    def is_coverage(self) -> bool:
        """Whether the mission is coverage."""
        return self.search.scenario.mission == "coverage"

    @property
    def limit(self) -> int:
        """The time limit L."""
        return self.search.scenario.timestep_limit

    @property
    def curves(self) -> Floats:
        """The probability of success of each episode after each step: float64, (n, L + 1).

        If it is exact, there is one row, for all episodes. See `Episodes.curves`.
        """
        return self.episodes.curves

    @cached_property
    def success_by_time(self) -> Floats:
        """The success within t steps, t = 0..L: float64, (L + 1,); the mean of `curves`."""
        curve: Floats = self.curves.mean(axis=0)
        return curve

    @cached_property
    def success(self) -> Estimate:
        """The success by the time limit, exact or with Hall's interval."""
        if self.is_exact:
            return ExactValue.of(float(self.curves[0, -1]))
        return bounded_mean(self.curves[:, -1])

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
    def time(self) -> Estimate:
        """The restricted mean time to find, in steps, exact or with Hall's interval."""
        if self.is_exact:
            return ExactValue.of(math.fsum((1.0 - self.curves[0, :-1]).tolist()))
        return bounded_mean(self.times, most=self.limit)

    @property
    def mean_return(self) -> float:
        """The mean return of the team in the episodes."""
        return math.fsum(self.episodes.returns.tolist()) / len(self.episodes)

    @cached_property
    def coverage_rate(self) -> Estimate:
        """The mean share of the grid's cells that were searched."""
        return self._per_cell(self.episodes.cells_searched)

    @cached_property
    def repetition_rate(self) -> Estimate:
        """The mean number of repeated searches, divided by the number of cells of the grid.

        A search is repeated if its cell was searched before in the episode, by any drone. The
        rate may exceed 1.
        """
        return self._per_cell(self.episodes.searches - self.episodes.cells_searched)

    def _per_cell(self, counts: Ints) -> Estimate:
        """The mean of some counts, divided by the number of cells, with Hall's interval.

        It is exact in the coverage mission of a deterministic policy, whose episodes are all equal.
        """
        scenario = self.search.scenario
        cells = scenario.grid_size**2
        if self.is_exact and self.is_coverage:
            return ExactValue.of(float(counts[0]) / cells)
        return bounded_mean(counts / cells, most=scenario.n_drones * self.limit / cells)

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
    def summary(self) -> dict[str, Any]:
        """The estimates as one row of a table, with "" for what does not apply."""
        row: dict[str, Any] = {
            "package": DroneSwarmSearch.__version__,
            "suite": SUITE_VERSION,
            "policy": self.policy,
            "search": self.search.name,
            "mission": self.search.scenario.mission,
            "bayesian_update": self.search.scenario.bayesian_update,
            "episodes": len(self.episodes),
            "seed": self.seed,
            "timestep_limit": self.limit,
            "method": "exact" if self.is_exact else "conditional",
        }
        for name, estimate in (
            ("success", self.success),
            ("restricted_mean_time", self.time),
            ("share_of_bound", self.share_of_bound),
            ("coverage_rate", self.coverage_rate if self.is_coverage else None),
            ("repetition_rate", self.repetition_rate if self.is_coverage else None),
        ):
            value, low, high = estimate or ("", "", "")
            row |= {name: value, f"{name}_low": low, f"{name}_high": high}
        bound = self.bound
        row["bound"] = "" if bound is None else bound.by_limit
        row["bound_gap"] = "" if bound is None else bound.gap
        row["bound_confidence"] = "" if bound is None else bound.confidence
        row["mean_return"] = self.mean_return
        row |= {ending.name.lower(): count for ending, count in self.endings.items()}
        row["calibration_error"] = "" if self.is_coverage else self.reliability.expected_error
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
    if one.data != other.data:
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
            *names, difference(first.success, second.success), difference(first.time, second.time)
        )
    gained = first.curves[:, -1] - second.curves[:, -1]
    times, limit = first.times - second.times, first.limit
    return Comparison(*names, bounded_mean(gained, -1.0), bounded_mean(times, -limit, limit))


def save_csv(path: str | Path, evaluations: Iterable[Evaluation]) -> None:
    """Write the estimates as CSV, one row for each evaluation (`Evaluation.summary`).

    Raises:
        StorageError: the file cannot be written.
    """
    write_text(Path(path), csv_text(evaluations))


def csv_text(evaluations: Iterable[Evaluation]) -> str:
    """Return the text that `save_csv` writes."""
    rows, out = [each.summary for each in evaluations], io.StringIO()
    writer = csv.DictWriter(out, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return out.getvalue()
