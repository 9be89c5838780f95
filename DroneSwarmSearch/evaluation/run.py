"""Evaluate policies on searches, in portions of episodes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from DroneSwarmSearch import __version__
from DroneSwarmSearch._internal import checks
from DroneSwarmSearch.bound.success import SuccessBound, success_bound
from DroneSwarmSearch.core.named_search import NamedSearch
from DroneSwarmSearch.evaluation.episodes import Episodes
from DroneSwarmSearch.evaluation.parallel import Workers
from DroneSwarmSearch.evaluation.policy_spec import PolicySpec
from DroneSwarmSearch.evaluation.results import Evaluation
from DroneSwarmSearch.evaluation.rollout import roll_out
from DroneSwarmSearch.evaluation.run_folder import RunFolder
from DroneSwarmSearch.evaluation.stage import copied, prepared, view_of
from DroneSwarmSearch.evaluation.suite import SUITE_VERSION, as_named
from DroneSwarmSearch.layouts.view import View
from DroneSwarmSearch.policies import SwarmPolicy

# Episodes played together by a fresh copy of the policy: results are the same for any workers.
PORTION = 500

VERSIONS = {"package": __version__, "suite": SUITE_VERSION}  # results of others may differ


def evaluate(
    policy: object,
    search: object,
    *,
    view: View | str | None = None,
    episodes: int = 2000,
    seed: int = 0,
    deterministic: bool | None = None,
    workers: int = 1,
    ray: str | None = None,
    out: str | Path | None = None,
    name: str | None = None,
    progress: bool = True,
) -> Evaluation:
    """Evaluate a policy on a search.

    Success and time are exact if the policy is deterministic and there is one person. In the
    coverage mission, all measures of a deterministic policy are exact. Otherwise, success and time
    are means over sampled paths of the probability of success given the path (conditional Monte
    Carlo). Returns and endings come from the episodes that were played.

    All policies use common random numbers. A portion of 500 episodes is played by a deep copy of
    the policy. Two optional methods of the policy are called: `prepare(drones)` with the drones'
    start cells, once and before it is copied, and `reset(seed=...)` with the seeds of a portion.

    Args:
        policy: the name of a policy of this package; "file.py:Class" or "file.py:Class:argument";
            or a callable from observations to actions. A class is instantiated with the search's
            `Scenario`, and with the argument, a string.
        search: the name of a search of the suite, a `NamedSearch`, or a `Scenario`.
        view: what the policy sees and returns: a `View`, or its form. If you give no form, options
            that you leave out come from the policy's attribute `view`, a `View` or its form. A
            policy without that attribute steers whole swarms.
        episodes: the number of episodes, at least 1.
        seed: of the first episode, at least 0; episode i has the seed `seed + i`.
        deterministic: whether the actions depend on nothing but what the policy has observed
            since the episode began. None: they do for subclasses of `SwarmPolicy`, which must
            be deterministic, and for the package's policies except "random".
        workers: the number of processes; more than 1 needs joblib.
        ray: run on Ray instead: "local", "auto" or the address of a cluster.
        out: a folder for the finished result, which the same call then reads. It may hold results
            of other calls; each file states what its result depends on. The results of policies in
            memory are written, but not read.
        name: the policy's name in results.
        progress: show a progress bar on a terminal, if tqdm is installed.

    Raises:
        TypeError: an argument, or what the policy returns, is of the wrong type.
        ValueError: one is out of range; or a policy that is to be deterministic acts differently
            after the same observations; or a result in `out` is damaged.
        ImportError: joblib or Ray is needed and not installed.
        StorageError: the folder cannot be written.
    """
    case = Case.of(policy, search, view, deterministic, name)
    results = evaluate_cases([case], episodes, seed, out, Workers(workers, ray, progress))
    return results[0]


@dataclass(frozen=True, eq=False)
class Case:
    """A policy and a search as it is evaluated; `is_exact`: all episodes have the same curve."""

    spec: PolicySpec
    search: NamedSearch
    view: View
    is_exact: bool

    @classmethod
    def of(
        cls,
        policy: object,
        search: object,
        view: View | str | None = None,
        deterministic: bool | None = None,
        name: str | None = None,
    ) -> Case:
        """Make a case from arguments of `evaluate`."""
        spec = PolicySpec.of(policy, name)
        named = as_named(search)
        seen = view_of(spec, named, view)
        named = named.with_posterior(seen.bayesian_update)
        # `SwarmPolicy` requires that actions follow from observations.
        is_deterministic = issubclass(spec.kind, SwarmPolicy)
        if deterministic is not None:
            is_deterministic = checks.boolean("deterministic", deterministic)
        one_path = named.scenario.mission == "coverage" or len(named.scenario.persons_to_find) == 1
        return cls(spec, named, seen, is_deterministic and one_path)

    @property
    def label(self) -> str:
        """The name of the result."""
        return f"{self.spec.name}.{self.search.name}"

    def facts(self, episodes: int, seed: int) -> dict[str, Any]:
        """Everything that the result of some episodes depends on."""
        return {
            **VERSIONS,
            "policy": self.spec.name,
            "source": dict(self.spec.source or {"policy": "in memory"}),
            "search": self.search.name,
            "parameters": self.search.fingerprint,
            "view": asdict(self.view),
            "is_exact": self.is_exact,
            "episodes": episodes,
            "seed": seed,
        }

    def empty(self, episodes: int) -> Episodes:
        """Episodes in which nothing has happened, of the shapes of the result."""
        scenario = self.search.scenario
        persons = len(scenario.persons_to_find)
        empty = Episodes.empty(episodes, persons, scenario.timestep_limit)
        return empty.with_common_curve() if self.is_exact else empty


def check_names(what: str, several: Sequence[PolicySpec] | Sequence[NamedSearch]) -> None:
    """Raise a ValueError unless there is at least one, and all names differ."""
    names = [item.name for item in several]
    if len({*names}) < max(len(names), 1):
        got = ", ".join(names) or "none"
        raise ValueError(f"{what} must be at least one, all with different names, got {got}")


def evaluate_cases(
    cases: Sequence[Case],
    episodes: int,
    seed: int,
    out: str | Path | None,
    workers: Workers,
    bounded: Sequence[NamedSearch] = (),
) -> list[Evaluation]:
    """Evaluate cases together, with the bounds of some searches."""
    end = checks.integer("seed", seed, 0) + checks.integer("episodes", episodes, 1)
    portions = [range(first, min(first + PORTION, end)) for first in range(seed, end, PORTION)]
    folder = RunFolder(out)
    bounds = bounds_of(bounded, folder, workers)
    facts = {case: case.facts(episodes, seed) for case in cases}
    done: dict[Case, Episodes] = {}
    for case in cases:
        if case.spec.source is not None:
            known = folder.load(case.label, facts[case], case.empty(episodes))
            if known is not None:
                done[case] = known
    left = [case for case in cases if case not in done]
    for group in _groups(left, workers):
        for case, result in _evaluated(group, portions, workers):
            done[case] = result
            folder.save(case.label, facts[case], result)
    return [
        Evaluation(
            policy=case.spec.name,
            search=case.search,
            seed=seed,
            view=case.view,
            episodes=done[case],
            is_exact=case.is_exact,
            bound=bounds.get(case.search.name),
        )
        for case in cases
    ]


def _groups(cases: Sequence[Case], workers: Workers) -> list[list[Case]]:
    """Divide cases, so that an interruption loses little of the work of preparing policies.

    The first group has all policies that need no preparation. The others may plan for minutes, so
    each further group has one for each worker; on Ray, one group has them all.
    """
    quick = [case for case in cases if not hasattr(case.spec.kind, "prepare")]
    slow = [case for case in cases if hasattr(case.spec.kind, "prepare")]
    size = workers.workers if workers.ray is None else max(len(slow), 1)
    return [quick, *(slow[first : first + size] for first in range(0, len(slow), size))]


def _evaluated(
    cases: Sequence[Case], portions: Sequence[range], workers: Workers
) -> Iterator[tuple[Case, Episodes]]:
    """Evaluate some cases, and yield each with its episodes as soon as they are complete."""
    # Policies are prepared first, each once.
    preparations = [partial(prepared, case.spec, case.search) for case in cases]
    policies = list(workers.finished(preparations, "policies"))
    calls = [
        partial(_rolled_out, policy, case, seeds)
        for case, policy in zip(cases, policies, strict=True)
        for seeds in portions
    ]
    parts: list[Episodes] = []
    for job, part in enumerate(workers.finished(calls, "evaluation")):
        parts.append(part)
        if len(parts) == len(portions):
            case = cases[job // len(portions)]
            whole = Episodes.joined(parts)
            yield case, whole.with_common_curve() if case.is_exact else whole
            parts = []


def bounds_of(
    searches: Sequence[NamedSearch], folder: RunFolder, workers: Workers
) -> dict[str, SuccessBound]:
    """The bounds of searches, by name; `bayesian_update` makes no difference to them."""
    bounds: dict[str, SuccessBound] = {}
    for search in searches:
        limit = search.scenario.timestep_limit
        like = SuccessBound(np.zeros(limit + 1), relaxed=0.0, gap=0.0, confidence=0.0)
        known = folder.load(f"{search.name}.bound", _bound_facts(search), like)
        if known is not None:
            bounds[search.name] = known
    left = [search for search in searches if search.name not in bounds]
    calls = [partial(success_bound, search.scenario, search.drones) for search in left]
    for search, bound in zip(left, workers.finished(calls, "bounds"), strict=True):
        bounds[search.name] = bound
        folder.save(f"{search.name}.bound", _bound_facts(search), bound)
    return bounds


def _bound_facts(search: NamedSearch) -> dict[str, Any]:
    """Everything that the bound of a search depends on."""
    return {**VERSIONS, "search": search.with_posterior(bayesian_update=False).fingerprint}


def _rolled_out(policy: Callable[..., Any], case: Case, seeds: Sequence[int]) -> Episodes:
    if not case.is_exact or case.search.scenario.mission == "coverage":
        return roll_out(copied(policy), case.search, seeds, case.view)
    player = copied(policy)
    # One after the other and with two seeds, so that random actions differ.
    followed = [roll_out(player, case.search, [seeds[0] + more], case.view) for more in range(2)]
    curves = Episodes.joined(followed).with_common_curve().curves
    played = roll_out(copied(policy), case.search, seeds, case.view, wants_curves=False)
    return replace(played, curves=curves)
