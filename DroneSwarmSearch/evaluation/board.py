"""Leaderboards: evaluate policies on several searches, and summarise them."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from statistics import fmean

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch.evaluation.policy_spec import PolicySpec
from DroneSwarmSearch.evaluation.results import Evaluation, save_csv
from DroneSwarmSearch.evaluation.run import Case, evaluate_cases
from DroneSwarmSearch.evaluation.statistics import (
    ROUNDING,
    Estimate,
    ExactValue,
    difference,
    mean_of,
)
from DroneSwarmSearch.evaluation.suite import SUITE, as_named
from DroneSwarmSearch.evaluation.tables import percent
from DroneSwarmSearch.evaluation.view import View
from DroneSwarmSearch.policies import POLICIES

__all__ = ["Leaderboard", "PolicySummary", "leaderboard"]


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
    def bounds(self) -> Mapping[str, float]:
        """The bounds by the names of the searches; empty if they were not computed."""
        return {
            each.search.name: each.bound.by_limit
            for each in self.evaluations
            if each.bound is not None
        }

    @cached_property
    def summaries(self) -> tuple[PolicySummary, ...]:
        """The summary of every policy, the most successful first."""
        policies = dict.fromkeys(each.policy for each in self.evaluations)
        return tuple(sorted(map(self._summary, policies), key=lambda each: -each.success.value))

    def _summary(self, policy: str) -> PolicySummary:
        evaluations = [each for each in self.evaluations if each.policy == policy]
        success, gap = mean_of(each.success for each in evaluations), None
        if self.bounds:
            gap = difference(ExactValue.of(fmean(self.bounds.values())), success)
        time = mean_of(each.time.scaled(1.0 / each.limit) for each in evaluations)
        return PolicySummary(policy, success, gap, time)

    @property
    def summary_table(self) -> list[list[str]]:
        """A heading, a row for each policy, and one for the bound."""
        bound = [f"{100 * fmean(self.bounds.values()):.1f}"] if self.bounds else []
        rows = [["policy", "success, %", *["gap, points" for _ in bound], "time, % of limit"]]
        for each in self.summaries:
            gap = [] if each.gap is None else [percent(each.gap)]
            rows.append([each.policy, percent(each.success), *gap, percent(each.time)])
        return rows + [["bound", mean, "", ""] for mean in bound]

    @property
    def search_table(self) -> list[list[str]]:
        """A heading, and the success of each policy in a row for each search; * marks the best."""
        names = [each.policy for each in self.summaries]
        rows = [["search", *["bound"] * bool(self.bounds), *names]]
        by_search: dict[str, dict[str, float]] = {}
        for each in self.evaluations:
            by_search.setdefault(each.search.name, {})[each.policy] = each.success.value
        for search, values in by_search.items():
            bound = [f"{100 * self.bounds[search]:.1f}"] if self.bounds else []
            best = max(values.values()) - ROUNDING
            shown = [f"{100 * values[name]:.1f}{'*' * (values[name] > best)}" for name in names]
            rows.append([search, *bound, *shown])
        return rows

    def write(self, folder: Path) -> list[Path]:
        """Write leaderboard.csv, and plots if Matplotlib is installed; returns the files.

        Raises:
            StorageError: a file cannot be written.
        """
        table = folder / "leaderboard.csv"
        save_csv(table, self.evaluations)
        try:
            from DroneSwarmSearch.evaluation import plots
        except ImportError as error:
            print(error, file=sys.stderr)
            return [table]
        draw = {"time": plots.success_over_time, "success": plots.success_by_search}
        drawn = [
            plots.save(partial(each, self.evaluations), folder / name)
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
        workers: see `evaluate`.
        ray: see `evaluate`.
        out: see `evaluate`.
        bounds: whether to compute the upper bound of every search.
        progress: show a progress bar.

    Raises:
        ValueError: a name is unknown or used twice.
        Exception: see `evaluate`.
    """
    shown = View.of(view)
    package = [PolicySpec.of(name) for name in (POLICIES if policies is None else policies)]
    own = [PolicySpec.of(each) for each in added]
    named = [as_named(each) for each in (SUITE if searches is None else searches)]
    for what, several in (("policies", [*own, *package]), ("searches", named)):
        if len({each.name for each in several}) < max(len(several), 1):
            names = ", ".join(each.name for each in several) or "none"
            raise ValueError(f"{what} must be at least one, all different, got {names}")
    cases = []
    for each in named:
        cases += [Case.of(spec, each, shown, deterministic) for spec in own]
        cases += [Case.of(spec, each, View()) for spec in package]
    evaluations = evaluate_cases(
        *(cases, episodes, seed),
        out=out,
        workers=workers,
        ray=ray,
        progress=progress,
        bounded=named if checks.boolean("bounds", bounds) else [],
    )
    return Leaderboard(tuple(evaluations))
