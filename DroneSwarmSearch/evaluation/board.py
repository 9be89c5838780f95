"""Leaderboards: evaluate policies on several searches, summarise and compare them.

All workers share one list of jobs, the longest first. Finished work is stored, so that an
interrupted run resumes.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from statistics import fmean
from typing import Any

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.progress import Progress
from DroneSwarmSearch.evaluation.bounds import BoundTask
from DroneSwarmSearch.evaluation.policy_spec import PolicySpec
from DroneSwarmSearch.evaluation.results import Evaluation, compare
from DroneSwarmSearch.evaluation.rollout import checked_masks, checked_view
from DroneSwarmSearch.evaluation.run import EvaluationTask, run_tasks
from DroneSwarmSearch.evaluation.statistics import (
    ROUNDING,
    Estimate,
    ExactValue,
    difference,
    mean_of,
)
from DroneSwarmSearch.evaluation.store import Store, as_store
from DroneSwarmSearch.evaluation.suite import SUITE, NamedSearch, as_named
from DroneSwarmSearch.planning.bound import SuccessBound
from DroneSwarmSearch.policies import POLICIES

__all__ = [
    "Contest",
    "Leaderboard",
    "PairwiseComparison",
    "PolicySummary",
    "in_expected_order",
    "leaderboard",
]

EXPECTED_ORDER: tuple[tuple[str, ...], ...] = (
    ("planner",),
    ("greedy-forecast",),
    ("greedy-posterior",),
    ("greedy-matrix", "parallel-sweep", "creeping-line", "expanding-square", "sector-search"),
    ("random",),
)
"""The expected order, best first; policies of one group are not ranked.

With one person, the only news before the end is "not found", so an optimal policy is an open-loop
plan, which the planner approximates. The rest is an expectation: effort that ignores what is known
is worth less. No theorem ranks these policies, since drones must fly between cells."""


def in_expected_order(names: Sequence[str]) -> list[str]:
    """Sort policies by `EXPECTED_ORDER`; those that it does not name follow its first group."""
    first, *others = ([name for name in group if name in names] for group in EXPECTED_ORDER)
    ranked = [name for group in others for name in group]
    unranked = [name for name in names if name not in (*first, *ranked)]
    return [*first, *unranked, *ranked]


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


@dataclass(frozen=True)
class PairwiseComparison:
    """Two policies on all searches, the one that is expected to be better first.

    Attributes:
        first: the first policy's name.
        second: the second policy's name.
        success: the mean difference in success, first minus second.
        time: the mean difference in time divided by the limit, first minus second.
    """

    first: str
    second: str
    success: Estimate
    time: Estimate

    @property
    def verdict(self) -> str:
        """The conclusion that the intervals allow; of exact differences, that of their signs."""
        words = []
        for estimate, better, worse in (
            (self.success, "more successful", "less successful"),
            (self.time, "slower", "faster"),
        ):
            if estimate.low > ROUNDING or estimate.high < -ROUNDING:
                words.append(better if estimate.low > ROUNDING else worse)
        is_exact = self.success.is_exact and self.time.is_exact
        return ", ".join(words) or ("equal" if is_exact else "not clearly different")


@dataclass(frozen=True, eq=False)
class Leaderboard:
    """Policies evaluated on searches; what is sampled, in the same episodes.

    Attributes:
        evaluations: of every policy on every search, search by search.
        added: the names of the policies that are not from this package.
    """

    evaluations: tuple[Evaluation, ...]
    added: tuple[str, ...] = ()

    @cached_property
    def policies(self) -> tuple[str, ...]:
        """The policies' names, in the order of the rows."""
        return tuple(dict.fromkeys(each.policy for each in self.evaluations))

    @cached_property
    def searches(self) -> tuple[NamedSearch, ...]:
        """The searches, in the order of the suite."""
        return tuple({each.search.name: each.search for each in self.evaluations}.values())

    @cached_property
    def by_name(self) -> Mapping[tuple[str, str], Evaluation]:
        """The evaluations by the names of policy and search."""
        return {(each.policy, each.search.name): each for each in self.evaluations}

    def of_policy(self, policy: str) -> tuple[Evaluation, ...]:
        """A policy's evaluations, in the order of the searches."""
        return tuple(self.by_name[policy, search.name] for search in self.searches)

    @cached_property
    def bounds(self) -> Mapping[str, SuccessBound]:
        """The bounds by the names of the searches; empty if they were not computed."""
        return {each.search.name: each.bound for each in self.evaluations if each.bound is not None}

    @cached_property
    def mean_bound(self) -> float | None:
        """The mean bound on success; None unless every search has one."""
        if len(self.bounds) < len(self.searches):
            return None
        return fmean(each.by_limit for each in self.bounds.values())

    @cached_property
    def summaries(self) -> tuple[PolicySummary, ...]:
        """The summary of every policy."""
        return tuple(self._summary(policy) for policy in self.policies)

    @cached_property
    def comparisons(self) -> tuple[PairwiseComparison, ...]:
        """Every policy against those that are expected next.

        Policies outside the expected order, such as trained ones, are compared with the first
        policy of each of the first two groups.
        """
        groups = [[name for name in group if name in self.policies] for group in EXPECTED_ORDER]
        groups = [group for group in groups if group]
        others = [name for name in self.policies if not any(name in group for group in groups)]
        pairs = [(name, group[0]) for name in others for group in groups[:2]]
        for higher, lower in pairwise(groups):
            pairs += [(first, second) for first in higher for second in lower]
        return tuple(self._comparison(*pair) for pair in pairs)

    @cached_property
    def calibration(self) -> tuple[int, int]:
        """How many 95% intervals of sampled success contain the exact success, and their number."""
        holds = [
            each.sampled_success.low - ROUNDING
            <= each.success.value
            <= each.sampled_success.high + ROUNDING
            for each in self.evaluations
            if each.is_exact and each.sampled_success is not None
        ]
        return sum(holds), len(holds)

    def best_known(self, search: str) -> Evaluation:
        """The evaluation with the largest success on a search."""
        return max(
            (self.by_name[policy, search] for policy in self.policies),
            key=lambda each: each.success.value,
        )

    @property
    def above_bound(self) -> tuple[Evaluation, ...]:
        """Evaluations whose interval lies above the bound; there should be none."""
        return tuple(
            each
            for each in self.evaluations
            if each.bound is not None and each.success.low > each.bound.by_limit + ROUNDING
        )

    def compute_intervals(self) -> None:
        """Compute all intervals, which are cached, with a progress bar."""
        tasks: list[tuple[object, str, int]] = [
            (each, name, 1) for each in self.evaluations for name in ("time", "mean_return")
        ]
        tasks.append((self, "comparisons", 2 * len(self.policies) * len(self.searches)))
        done = 0
        with Progress("intervals", sum(weight for *_, weight in tasks)) as bar:
            for owner, name, weight in tasks:
                getattr(owner, name)
                done += weight
                bar(done)

    def _summary(self, policy: str) -> PolicySummary:
        evaluations = self.of_policy(policy)
        success = mean_of(each.success for each in evaluations)
        bound = self.mean_bound
        return PolicySummary(
            policy,
            success,
            None if bound is None else difference(ExactValue.of(bound), success),
            mean_of(each.time.scaled(1.0 / each.limit) for each in evaluations),
        )

    def _comparison(self, first: str, second: str) -> PairwiseComparison:
        pairs = zip(self.of_policy(first), self.of_policy(second), strict=True)
        compared = [compare(one, other) for one, other in pairs]
        times = [
            each.time.scaled(1.0 / search.scenario.timestep_limit)
            for each, search in zip(compared, self.searches, strict=True)
        ]
        return PairwiseComparison(
            first, second, mean_of(each.success for each in compared), mean_of(times)
        )


def leaderboard(
    policies: Sequence[str] | None = None,
    searches: Sequence[object] | None = None,
    *,
    added: Sequence[object] = (),
    view: str = "swarm",
    observation: str = "dict",
    action_mask: bool = False,
    right_of_way: bool = False,
    deterministic: bool | None = None,
    posterior: bool = False,
    episodes: int = 2000,
    seed: int = 0,
    workers: int = 1,
    ray: str | None = None,
    store: Store | str | Path | None = None,
    bounds: bool = True,
    progress: bool = True,
) -> Leaderboard:
    """Evaluate policies on searches; what is sampled, in the same episodes.

    Args:
        policies: names of policies of this package; None for all.
        searches: names of searches of the suite, or `NamedSearch` objects; None for the
            whole suite.
        added: further policies, in any form that `evaluate` takes.
        view: what the added policies see, see `evaluate`.
        observation: the layout of their observations, see `evaluate`.
        action_mask: whether they get masks of valid actions, see `evaluate`.
        right_of_way: whether these masks prevent all collisions.
        deterministic: whether the added policies are, see `evaluate`.
        posterior: whether the added policies see the posterior instead of the prior. Their
            returns then depend on another matrix; success and time stay comparable.
        episodes: of every policy on every search.
        seed: of the first episode.
        workers: the number of processes; more than 1 needs joblib.
        ray: run on Ray instead: "local", "auto" or the address of a cluster.
        store: a folder, in which finished work is stored and looked up.
        bounds: whether to compute the upper bound of every search.
        progress: show a progress bar.

    Raises:
        TypeError: an argument is of the wrong type.
        ValueError: an argument is out of range, or a name is unknown or used twice.
        ImportError: joblib or Ray is needed and not installed.
        StorageError: the store cannot be written; finished work is kept.
        WorkerCrashed: a worker process died; finished work is kept.
    """
    contest = Contest(
        policies,
        searches,
        added,
        view=view,
        observation=observation,
        action_mask=action_mask,
        right_of_way=right_of_way,
        deterministic=deterministic,
        posterior=posterior,
        episodes=episodes,
        seed=seed,
        store=as_store(store),
        bounds=bounds,
    )
    return contest.run(workers=workers, ray=ray, progress=progress)


class Contest:
    """The tasks of a leaderboard. The arguments are those of `leaderboard`."""

    def __init__(
        self,
        policies: Sequence[str] | None,
        searches: Sequence[object] | None,
        added: Sequence[object],
        *,
        view: str,
        observation: str,
        action_mask: bool,
        right_of_way: bool,
        deterministic: bool | None,
        posterior: bool,
        bounds: bool,
        store: Store | None,
        **episodes: int,
    ) -> None:
        for name, values in (("policies", policies), ("searches", searches), ("added", added)):
            if values is not None and (isinstance(values, str) or not isinstance(values, Iterable)):
                raise TypeError(f"{name} must be a list, got {values!r:.100}")
        view, observation = checked_view(view, observation)
        checked_masks(action_mask, right_of_way)
        updated = checks.boolean("posterior", posterior) or None
        bounds = checks.boolean("bounds", bounds)
        names = in_expected_order([*POLICIES]) if policies is None else policies
        of_package = [PolicySpec.of(name) for name in names]
        of_user = [PolicySpec.of(each) for each in added]
        named = [as_named(each) for each in (SUITE if searches is None else searches)]
        _check_unique("policies", [each.name for each in (*of_user, *of_package)])
        _check_unique("searches", [each.name for each in named])
        shared: dict[str, Any] = {"store": store, **episodes}
        own: dict[str, Any] = {
            "view": view,
            "observation": observation,
            "action_mask": action_mask,
            "right_of_way": right_of_way,
            "deterministic": deterministic,
            "bayesian_update": updated,
        }
        self._added = tuple(each.name for each in of_user)
        self._tasks = [
            EvaluationTask(each, search, **shared, **(own if each in of_user else {}))
            for search in named
            for each in (*of_user, *of_package)
        ]
        self._bounds = {each.name: BoundTask(each, store) for each in named if bounds}

    def run(self, *, workers: int, ray: str | None, progress: bool) -> Leaderboard:
        """Do the work that is left."""
        tasks: list[EvaluationTask | BoundTask] = [*self._bounds.values(), *self._tasks]
        tasks.sort(key=_expected_duration, reverse=True)
        run_tasks(tasks, "leaderboard", workers=workers, ray=ray, progress=progress)
        bounds = {name: each.bound for name, each in self._bounds.items()}
        return Leaderboard(
            tuple(
                each.evaluation().with_bound(bounds.get(each.search.name)) for each in self._tasks
            ),
            self._added,
        )


def _check_unique(what: str, names: Sequence[str]) -> None:
    if not names:
        raise ValueError(f"{what} must be at least one, got none")
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise ValueError(f"{what} must all be different, got more than once: {', '.join(twice)}")


def _expected_duration(task: EvaluationTask | BoundTask) -> tuple[bool, bool, int, int]:
    """A sort key for how long a task may take.

    Bounds and plans take longest. Next come searches with several persons: their episodes
    diverge when a person is found, so the batch can share less work between them.
    """
    scenario = task.search.scenario
    return (
        isinstance(task, BoundTask),
        isinstance(task, EvaluationTask) and task.spec.name == "planner",
        len(scenario.situation),
        scenario.grid_size**2 * scenario.timestep_limit * (scenario.n_drones + 1),
    )
