"""Leaderboards: evaluate policies on several searches, and summarise them."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from statistics import fmean

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch.evaluation.bounds import bounds_of
from DroneSwarmSearch.evaluation.policy_spec import PolicySpec
from DroneSwarmSearch.evaluation.results import Evaluation, save_csv
from DroneSwarmSearch.evaluation.run import (
    Case,
    Sampling,
    evaluate_cases,
    manifest,
    run_folder,
)
from DroneSwarmSearch.evaluation.run_folder import RunFolder
from DroneSwarmSearch.evaluation.statistics import (
    ROUNDING,
    Estimate,
    ExactValue,
    difference,
    mean_of,
)
from DroneSwarmSearch.evaluation.suite import SUITE, NamedSearch, as_named
from DroneSwarmSearch.evaluation.tables import percent
from DroneSwarmSearch.evaluation.view import View
from DroneSwarmSearch.planning.bound import SuccessBound
from DroneSwarmSearch.policies import POLICIES

__all__ = ["Leaderboard", "PolicySummary", "leaderboard", "prepared"]


@dataclass(frozen=True)
class PolicySummary:
    """A policy's results over all searches, each with equal weight.

    Attributes:
        policy: its name.
        success: the mean success.
        gap: the mean distance from the success to the bound; None without bounds.
        time: the mean of the restricted mean times, each divided by the time limit.
    """

    policy: str
    success: Estimate
    gap: Estimate | None
    time: Estimate


@dataclass(frozen=True, eq=False)
class Leaderboard:
    """Policies evaluated on searches; what is sampled, in the same episodes.

    Attributes:
        evaluations: of every policy on every search, search by search.
    """

    evaluations: tuple[Evaluation, ...]

    @cached_property
    def searches(self) -> tuple[NamedSearch, ...]:
        """The searches, in the order of the suite."""
        return tuple({each.search.name: each.search for each in self.evaluations}.values())

    @cached_property
    def by_name(self) -> Mapping[tuple[str, str], Evaluation]:
        """The evaluations by the names of policy and search."""
        return {(each.policy, each.search.name): each for each in self.evaluations}

    @cached_property
    def bounds(self) -> Mapping[str, SuccessBound]:
        """The bounds by the names of the searches; empty if they were not computed."""
        return {each.search.name: each.bound for each in self.evaluations if each.bound is not None}

    @cached_property
    def mean_bound(self) -> float | None:
        """The mean bound on success; None without bounds."""
        return fmean(each.by_limit for each in self.bounds.values()) if self.bounds else None

    @cached_property
    def summaries(self) -> tuple[PolicySummary, ...]:
        """The summary of every policy, the most successful first."""
        policies = dict.fromkeys(each.policy for each in self.evaluations)
        return tuple(sorted(map(self._summary, policies), key=lambda each: -each.success.value))

    def _summary(self, policy: str) -> PolicySummary:
        evaluations = [each for each in self.evaluations if each.policy == policy]
        success = mean_of(each.success for each in evaluations)
        bound = self.mean_bound
        return PolicySummary(
            policy,
            success,
            None if bound is None else difference(ExactValue.of(bound), success),
            mean_of(each.time.scaled(1.0 / each.limit) for each in evaluations),
        )

    @property
    def summary_table(self) -> list[list[str]]:
        """A heading, a row for each policy, and one for the bound."""
        bounded = self.mean_bound is not None
        rows = [["policy", "success, %", *["gap, points"] * bounded, "time, % of limit"]]
        for each in self.summaries:
            gap = [] if each.gap is None else [percent(each.gap)]
            rows.append([each.policy, percent(each.success), *gap, percent(each.time)])
        if self.mean_bound is not None:
            rows.append(["bound", f"{100 * self.mean_bound:.1f}", "", ""])
        return rows

    @property
    def search_table(self) -> list[list[str]]:
        """A heading, and the success of each policy in a row for each search; * marks the best."""
        names = [each.policy for each in self.summaries]
        rows = [["search", *["bound"] * bool(self.bounds), *names]]
        for search in self.searches:
            row = [search.name]
            if self.bounds:
                row.append(f"{100 * self.bounds[search.name].by_limit:.1f}")
            values = [self.by_name[name, search.name].success.value for name in names]
            best = max(values) - ROUNDING
            rows.append(row + [f"{100 * each:.1f}{'*' * (each > best)}" for each in values])
        return rows

    def write(self, folder: Path) -> list[Path]:
        """Write leaderboard.csv, and plots if Matplotlib is installed; returns the files.

        Raises:
            StorageError: a file cannot be written.
        """
        table = folder / "leaderboard.csv"
        save_csv(table, self.evaluations)
        try:
            from DroneSwarmSearch.evaluation import plot_style, plots
        except ImportError as error:
            print(error, file=sys.stderr)
            return [table]
        draw = {"time": plots.success_over_time, "success": plots.success_by_search}
        drawn = [
            plot_style.save(partial(each, self.evaluations), folder / name)
            for name, each in draw.items()
        ]
        return [table, *(path for paths in drawn for path in paths)]


def leaderboard(
    policies: Sequence[str] | None = None,
    searches: Sequence[object] | None = None,
    *,
    added: Sequence[object] = (),
    view: View | str = "swarm",
    deterministic: bool | None = None,
    episodes: int = 2000,
    seed: int = 0,
    workers: int = 1,
    ray: str | None = None,
    out: str | Path | None = None,
    bounds: bool = True,
    progress: bool = True,
) -> Leaderboard:
    """Evaluate policies on searches; what is sampled, in the same episodes.

    Args:
        policies: names of policies of this package; None for all.
        searches: names of searches of the suite, or `NamedSearch` objects; None for the
            whole suite.
        added: further policies, in any form that `evaluate` takes.
        view: what the added policies see, see `evaluate`. If they see the posterior, their
            returns depend on another matrix; success and time stay comparable.
        deterministic: whether the added policies are, see `evaluate`.
        episodes: of every policy on every search.
        seed: of the first episode.
        workers: the number of processes; more than 1 needs joblib.
        ray: run on Ray instead: "local", "auto" or the address of a cluster.
        out: a folder for a manifest and every finished result, which the same call then reads.
        bounds: whether to compute the upper bound of every search.
        progress: show a progress bar.

    Raises:
        TypeError: an argument is of the wrong type.
        ValueError: an argument is out of range, a name is unknown or used twice, or `out` holds
            the results of another run.
        ImportError: joblib or Ray is needed and not installed.
        StorageError: the folder cannot be written.
    """
    run = prepared(
        policies,
        searches,
        added=added,
        view=View.of(view),
        deterministic=deterministic,
        sampling=Sampling(episodes, seed),
        out=out,
        bounds=bounds,
    )
    return run(workers=workers, ray=ray, progress=progress)


def prepared(
    policies: Sequence[str] | None,
    searches: Sequence[object] | None,
    *,
    added: Sequence[object],
    view: View,
    deterministic: bool | None,
    sampling: Sampling,
    out: str | Path | None,
    bounds: bool,
) -> Callable[..., Leaderboard]:
    """Check the arguments of `leaderboard`; returns a function that does the work."""
    for name, values in (("policies", policies), ("searches", searches), ("added", added)):
        if values is not None and (isinstance(values, str) or not isinstance(values, Iterable)):
            raise TypeError(f"{name} must be a list, got {values!r:.100}")
    package = [PolicySpec.of(name) for name in (POLICIES if policies is None else policies)]
    own = [PolicySpec.of(each) for each in added]
    named = [as_named(each) for each in (SUITE if searches is None else searches)]
    _check_unique("policies", [each.name for each in (*own, *package)])
    _check_unique("searches", [each.name for each in named])
    cases = []
    for each in named:
        cases += [Case.of(spec, each, view, deterministic) for spec in own]
        cases += [Case.of(spec, each, View()) for spec in package]
    bounded = named if checks.boolean("bounds", bounds) else []
    return partial(_run, cases, bounded, sampling, run_folder(out, manifest(cases, sampling)))


def _run(
    cases: Sequence[Case],
    bounded: Sequence[NamedSearch],
    sampling: Sampling,
    folder: RunFolder | None,
    *,
    workers: int,
    ray: str | None,
    progress: bool,
) -> Leaderboard:
    bounds = bounds_of(bounded, folder, workers=workers, ray=ray, progress=progress)
    evaluations = evaluate_cases(
        cases, sampling, folder, "leaderboard", workers=workers, ray=ray, progress=progress
    )
    return Leaderboard(tuple(each.with_bound(bounds.get(each.search.name)) for each in evaluations))


def _check_unique(what: str, names: Sequence[str]) -> None:
    if not names:
        raise ValueError(f"{what} must be at least one, got none")
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise ValueError(f"{what} must all be different, got more than once: {', '.join(twice)}")
