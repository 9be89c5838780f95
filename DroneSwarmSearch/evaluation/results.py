"""Results of evaluations: estimates, comparisons of two policies, and their table as CSV."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from DroneSwarmSearch import __version__
from DroneSwarmSearch._internal.arrays import Floats, Ints
from DroneSwarmSearch._internal.files import csv_cell, write_text
from DroneSwarmSearch.bound.success import SuccessBound
from DroneSwarmSearch.core.named_search import NamedSearch
from DroneSwarmSearch.core.rules import Ending
from DroneSwarmSearch.evaluation.episodes import Episodes, Reliability
from DroneSwarmSearch.evaluation.statistics import (
    Estimate,
    bounded_mean,
    difference,
    stratified_mean,
)
from DroneSwarmSearch.evaluation.suite import SUITE_VERSION
from DroneSwarmSearch.layouts.view import View


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
        strata: the number of different searches, which are given and which the episodes take in
            turn; figures are means over them.
    """

    policy: str
    search: NamedSearch
    seed: int
    view: View
    episodes: Episodes
    is_exact: bool
    bound: SuccessBound | None = None
    strata: int = 1

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
        """The probability of success of each episode after each step, see `Episodes.curves`."""
        return self.episodes.curves

    @property
    def success_by_time(self) -> Floats:
        """The success within t steps, t = 0..L: float64, (L + 1,); the mean of `curves`."""
        mean: Floats = self.curves.mean(axis=0)
        return mean

    @property
    def success(self) -> Estimate:
        """The success by the time limit, exact or with Hall's interval."""
        return self._mean(self.curves[:, -1])

    @property
    def success_alive(self) -> Estimate | None:
        """The probability of finding the person alive by the limit; None without `survival`.

        The sum of the success curve's increments, each times the persons' mean probability of being
        alive in that step. With several persons, it is the expected share that is alive when the
        last one is found, 0 if not all are; in a coverage mission, the mean over persons if they
        have the same curve of survival, else an approximation.
        """
        persons = self.search.scenario.persons_to_find
        steps = range(self.limit)
        if all(person.survival is None for person in persons):
            return None
        alive = np.mean([[*map(person.alive, steps)] for person in persons], axis=0)
        success = (np.diff(self.curves, axis=1) * alive).sum(axis=1)
        return self._mean(success)

    @property
    def times(self) -> Floats:
        """The expected time to find given each episode's path, the area above the curve: (n,).

        In the coverage mission, it is the mean over persons. Failures count with the time limit.
        """
        times: Floats = (1.0 - self.curves[:, :-1]).sum(axis=1)
        return times

    @property
    def time(self) -> Estimate:
        """The restricted mean time to find, the mean of `times`, exact or with Hall's interval.

        It is defined even where many episodes fail: P. Royston and M. Parmar, Restricted mean
        survival time, BMC Medical Research Methodology 13:152, 2013.
        """
        if self.is_exact:
            return Estimate.exact(math.fsum((1.0 - self.success_by_time[:-1]).tolist()))
        return self._mean(self.times, most=self.limit)

    @property
    def mean_return(self) -> float:
        """The mean return of the team in the episodes."""
        return math.fsum(self.episodes.returns.tolist()) / len(self.episodes)

    @property
    def coverage_rate(self) -> Estimate:
        """The mean share of the grid's cells that were searched."""
        return self._per_cell(self.episodes.cells_searched)

    @property
    def repetition_rate(self) -> Estimate:
        """The mean number of repeated searches, of any drone, per cell; it may exceed 1."""
        return self._per_cell(self.episodes.searches - self.episodes.cells_searched)

    def _per_cell(self, counts: Ints) -> Estimate:
        scenario = self.search.scenario
        cells = scenario.grid_size**2
        if self.is_exact and self.is_coverage:  # all episodes of a search are equal
            return Estimate.exact(float(counts[: self.strata].mean()) / cells)
        return self._mean_of_draws(counts / cells, most=scenario.n_drones * self.limit / cells)

    def _mean(self, values: Floats, most: float = 1.0) -> Estimate:
        """The mean of a figure that has no sampling error if the evaluation is exact."""
        if self.is_exact:
            return Estimate.exact(float(values.mean()))
        return self._mean_of_draws(values, most)

    def _mean_of_draws(self, values: Floats, most: float) -> Estimate:
        """The mean of a figure that depends on the draws of the episodes."""
        if len(values) >= 2 * self.strata > 2:
            return stratified_mean(values, self.strata)
        return bounded_mean(values, most=most)

    @property
    def share_of_bound(self) -> Estimate | None:
        """The success divided by the bound; None without a bound above 0."""
        if self.bound is None or not self.bound.by_limit > 0.0:
            return None
        return self.success.scaled(1.0 / self.bound.by_limit)

    @property
    def reliability(self) -> Reliability:
        """The calibration of the matrix that the policy saw; empty in the coverage mission."""
        return Reliability(*self.episodes.forecasts.sum(axis=0))

    @property
    def endings(self) -> dict[Ending, int]:
        """The number of episodes with each ending."""
        counts = np.bincount(self.episodes.endings, minlength=len(Ending) + 1).tolist()
        return {ending: counts[ending] for ending in Ending}

    @property
    def summary(self) -> dict[str, Any]:
        """The estimates as one row of a table, with "" for what does not apply."""
        row: dict[str, Any] = {
            "package": __version__,
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
        bound: tuple[float | str, ...] = ("", "", "")
        if self.bound is not None:
            bound = self.bound.by_limit, self.bound.gap, self.bound.confidence
        row |= zip(("bound", "bound_gap", "bound_confidence"), bound, strict=True)
        row["mean_return"] = self.mean_return
        row |= {ending.name.lower(): count for ending, count in self.endings.items()}
        row["calibration_error"] = "" if self.is_coverage else self.reliability.expected_error
        if (alive := self.success_alive) is not None:
            names = ("success_alive", "success_alive_low", "success_alive_high")
            row |= zip(names, alive, strict=True)
        return row


@dataclass(frozen=True)
class Comparison:
    """Two policies on one search: differences, first minus second, see `compare`.

    Attributes:
        policies: their names.
        search: the search's name.
        success: the difference in success. Above 0, the first policy is better.
        time: the difference in the restricted mean time to find, in steps. Below 0, the first
            policy is faster.
    """

    policies: tuple[str, str]
    search: str
    success: Estimate
    time: Estimate


def compare(first: Evaluation, second: Evaluation) -> Comparison:
    """Compare two policies on one search; one may have seen the prior and the other the posterior.

    Differences of exact values are exact. If one value is exact, the other gives the interval. Two
    samples use common random numbers, so Hall's interval for their paired differences is narrow.
    Over several given searches, the errors of both add up.

    Raises:
        ValueError: they are of different searches; or both are samples of one search, of different
            episodes.
    """
    one, other = (result.search.with_posterior(bayesian_update=False) for result in (first, second))
    if one.data != other.data:
        raise ValueError(
            "second must be of the same search as first, with the same parameters, got "
            f"{second.search.name!r} and {first.search.name!r}"
        )
    mine, theirs = ((result.seed, len(result.episodes)) for result in (first, second))
    are_independent = first.is_exact or second.is_exact or first.strata > 1
    if mine != theirs and not are_independent:
        raise ValueError(
            f"second must be of the same episodes as first, {mine[1]} from seed {mine[0]}, "
            f"got {theirs[1]} from seed {theirs[0]}"
        )
    if are_independent:
        success = difference(first.success, second.success)
        time = difference(first.time, second.time)
    else:
        limit = first.limit
        success = bounded_mean(first.curves[:, -1] - second.curves[:, -1], -1.0)
        time = bounded_mean(first.times - second.times, -limit, limit)
    return Comparison((first.policy, second.policy), first.search.name, success, time)


def known_bounds(evaluations: Iterable[Evaluation]) -> dict[str, float]:
    """The bounds by the time limit that were computed, by the names of the searches."""
    bounds = {result.search.name: result.bound for result in evaluations}
    return {name: bound.by_limit for name, bound in bounds.items() if bound is not None}


def save_csv(path: str | Path, evaluations: Iterable[Evaluation]) -> None:
    """Write the estimates as CSV, one row for each evaluation (`Evaluation.summary`).

    Raises:
        StorageError: the file cannot be written.
    """
    write_text(Path(path), csv_text(evaluations))


def csv_text(evaluations: Iterable[Evaluation]) -> str:
    """Return the text that `save_csv` writes."""
    rows = [result.summary for result in evaluations]
    out = io.StringIO()
    columns = dict.fromkeys(name for row in rows for name in row)
    writer = csv.DictWriter(out, list(columns), lineterminator="\n")
    writer.writeheader()
    for row in rows:
        writer.writerow({name: csv_cell(value) for name, value in row.items()})
    return out.getvalue()
