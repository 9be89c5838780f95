"""The results of a leaderboard: summaries and comparisons of policies on several searches."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

from DroneSwarmSearch.evaluation.results import Evaluation, compare
from DroneSwarmSearch.evaluation.statistics import Estimate, mean_of
from DroneSwarmSearch.evaluation.suite import NamedSearch
from DroneSwarmSearch.planning.bound import SuccessBound

__all__ = [
    "Leaderboard",
    "PairwiseComparison",
    "PolicySummary",
    "example_search",
    "ranked_by_theory",
]

THEORY: tuple[tuple[str, ...], ...] = (
    ("planner",),
    ("ppo", "greedy-posterior"),
    ("greedy-matrix", "parallel-sweep", "creeping-line", "expanding-square", "sector-search"),
    ("random",),
)
"""The order that search theory predicts, best first; policies of one group are not ranked.

A plan with the person's forecast has the form of an optimal policy. A greedy search with the
posterior is its heuristic, which a trained network may improve on. Effort that ignores earlier
searches is worth less, and effort that ignores the person's position is worth least (Stone,
Theory of Optimal Search, 1975; Brown, Operations Research 28:1275, 1980)."""

EXAMPLE = "classic"
"""The search of the plots that show only one, if it was evaluated."""


def ranked_by_theory(names: Sequence[str]) -> list[str]:
    """Sort policies by `THEORY`; those that it does not name come last."""
    ranked = [name for group in THEORY for name in group if name in names]
    return [*ranked, *(name for name in names if name not in ranked)]


def example_search(searches: Sequence[NamedSearch]) -> NamedSearch:
    """Return the search for plots that show only one."""
    return next((each for each in searches if each.name == EXAMPLE), searches[0])


@dataclass(frozen=True)
class PolicySummary:
    """A policy's results over all searches, each with equal weight.

    Attributes:
        policy: its name.
        success: the mean share of successes.
        time: the mean of the restricted mean times, each divided by the time limit.
        share_of_bound: the mean share of the bound; None without bounds.
    """

    policy: str
    success: Estimate
    time: Estimate
    share_of_bound: Estimate | None


@dataclass(frozen=True)
class PairwiseComparison:
    """Two policies in the same episodes, the one that theory ranks higher first.

    Attributes:
        first: the first policy's name.
        second: the second policy's name.
        success: the mean difference in the share of successes, first minus second.
        time: the mean difference in time divided by the limit, first minus second.
    """

    first: str
    second: str
    success: Estimate
    time: Estimate

    @property
    def verdict(self) -> str:
        """The conclusion that the intervals allow."""
        words = []
        if self.success.low > 0.0 or self.success.high < 0.0:
            words.append("more successful" if self.success.low > 0.0 else "less successful")
        if self.time.low > 0.0 or self.time.high < 0.0:
            words.append("slower" if self.time.low > 0.0 else "faster")
        return ", ".join(words) or "not clearly different"


@dataclass(frozen=True, eq=False)
class Leaderboard:
    """Policies evaluated on searches, all in the same episodes.

    Attributes:
        evaluations: of every policy on every search, search by search.
        added: the names of the policies that are not from this package.
        posterior: an evaluation of a policy that saw the posterior, to compare its calibration
            with that of the prior; None if there is none.
    """

    evaluations: tuple[Evaluation, ...]
    added: tuple[str, ...] = ()
    posterior: Evaluation | None = None

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

    def bound_of(self, search: str) -> SuccessBound | None:
        """A search's bound, if it was computed."""
        return self.by_name[self.policies[0], search].bound

    @property
    def has_bounds(self) -> bool:
        """Whether the bounds were computed."""
        return self.evaluations[0].bound is not None

    @cached_property
    def summaries(self) -> tuple[PolicySummary, ...]:
        """The summary of every policy."""
        return tuple(self._summary(policy) for policy in self.policies)

    @cached_property
    def comparisons(self) -> tuple[PairwiseComparison, ...]:
        """Every policy against those that theory ranks next.

        Added policies are compared with the first policy of the theory's order.
        """
        groups = [[name for name in group if name in self.policies] for group in THEORY]
        groups = [group for group in groups if group]
        pairs = [(name, groups[0][0]) for name in self.added if groups]
        for higher, lower in pairwise(groups):
            pairs += [(first, second) for first in higher for second in lower]
        return tuple(self._comparison(*pair) for pair in pairs)

    @property
    def above_bound(self) -> tuple[Evaluation, ...]:
        """Evaluations whose interval lies above the bound; there should be none."""
        return tuple(
            each
            for each in self.evaluations
            if each.bound is not None and each.success.low > each.bound.by_limit
        )

    def _summary(self, policy: str) -> PolicySummary:
        evaluations = self.of_policy(policy)
        shares = [each.share_of_bound for each in evaluations if each.share_of_bound is not None]
        return PolicySummary(
            policy,
            mean_of(each.success for each in evaluations),
            mean_of(each.time.scaled(1.0 / each.limit) for each in evaluations),
            mean_of(shares) if len(shares) == len(evaluations) else None,
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
