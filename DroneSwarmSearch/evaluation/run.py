"""Evaluate policies on searches, in portions of episodes.

The size of a portion is fixed, and each portion is played by a fresh copy of the policy. The
results are therefore identical for any number of workers and after any interruption.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import DroneSwarmSearch
from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.progress import Progress
from DroneSwarmSearch.evaluation.episodes import Episodes
from DroneSwarmSearch.evaluation.parallel import finished
from DroneSwarmSearch.evaluation.policy_spec import PolicySpec
from DroneSwarmSearch.evaluation.results import Evaluation
from DroneSwarmSearch.evaluation.rollout import play
from DroneSwarmSearch.evaluation.run_folder import RunFolder
from DroneSwarmSearch.evaluation.suite import SUITE_VERSION, NamedSearch, as_named
from DroneSwarmSearch.evaluation.view import View
from DroneSwarmSearch.planning.bound import SuccessBound, success_bound

__all__ = ["PORTION", "Case", "bounds_of", "evaluate", "evaluate_cases", "searches_manifest"]

PORTION = 500
"""Episodes that are played together."""


def evaluate(
    policy: object,
    search: object,
    *,
    view: View | str = "swarm",
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

    Success and time are exact if the policy is deterministic and there is one person; in the
    coverage mission, everything is if the policy is deterministic. Otherwise, they are means over
    sampled paths of the probability of success given the path (conditional Monte Carlo). Returns
    and endings are those of the episodes.

    Episode i has the seed `seed + i`, so all policies use common random numbers. The policy
    plays in portions of 500 episodes, each with a deep copy of the policy as you passed it. Two
    optional methods of the policy are called: `prepare(drones)` with the drones' start cells,
    once and before it is copied, and `reset(seed=..., rows=None)` with the seeds of each portion.

    Args:
        policy: the name of a policy of this package; "weights.npz"; "module:attribute" or
            "file.py:attribute"; or a callable from observations to actions. A class is
            instantiated with the search's `Scenario`.
        search: the name of a search of the suite, a `NamedSearch`, or a `Scenario`.
        view: what the policy sees and returns: a `View`, or its form.
        episodes: the number of episodes, at least 1.
        seed: of the first episode, at least 0.
        deterministic: whether the actions depend on nothing but what the policy has observed
            since the episode began. None: they do for subclasses of `SwarmPolicy`, which must
            be deterministic, and for the package's policies except "random".
        workers: the number of processes; more than 1 needs joblib.
        ray: run on Ray instead: "local", "auto" or the address of a cluster.
        out: a folder for a manifest and the finished result, which the same call then reads. The
            results of policies in memory are written, but not read.
        name: the policy's name in results.
        progress: show a progress bar after two seconds.

    Returns:
        The episodes, with estimates and intervals.

    Raises:
        TypeError: an argument, or what the policy returns, is of the wrong type.
        ValueError: an argument, or what the policy returns, is out of range; or a policy that is
            to be deterministic acts differently after the same observations; or `out` holds the
            results of another run.
        ImportError: joblib or Ray is needed and not installed.
        StorageError: the folder cannot be written.
    """
    case = Case.of(policy, search, View.of(view), deterministic, name)
    how: dict[str, Any] = {"out": out, "workers": workers, "ray": ray, "progress": progress}
    (evaluation,) = evaluate_cases([case], episodes, seed, **how)
    return evaluation


@dataclass(frozen=True, eq=False)
class Case:
    """A policy to be evaluated on a search.

    Attributes:
        spec: the policy.
        search: the search, with `bayesian_update` as it is evaluated.
        view: what the policy sees.
        is_exact: whether all episodes have the same curve of success.
    """

    spec: PolicySpec
    search: NamedSearch
    view: View
    is_exact: bool

    @classmethod
    def of(
        cls,
        policy: object,
        search: object,
        view: View,
        deterministic: bool | None = None,
        name: str | None = None,
    ) -> Case:
        """Make a case from arguments of `evaluate`."""
        named = as_named(search).with_posterior(view.bayesian_update)
        spec = PolicySpec.of(policy, name)
        if spec.is_batch_policy:
            view.check_package_policy(spec.name)
        is_deterministic = spec.is_deterministic
        if deterministic is not None:
            is_deterministic = checks.boolean("deterministic", deterministic)
        scenario = named.scenario
        one_path = scenario.mission == "coverage" or len(scenario.situation) == 1
        return cls(spec, named, view, is_deterministic and one_path)

    @property
    def label(self) -> str:
        """The policy and the search."""
        return f"{self.spec.name}.{self.search.name}"


def evaluate_cases(
    cases: Sequence[Case],
    episodes: int,
    seed: int,
    *,
    out: str | Path | None,
    workers: int,
    ray: str | None,
    progress: bool = True,
    bounded: Sequence[NamedSearch] = (),
) -> list[Evaluation]:
    """Evaluate several cases together, which keeps all workers busy.

    Args:
        cases: the policies and searches.
        episodes: of each case.
        seed: of the first episode.
        out: see `evaluate`.
        workers: see `evaluate`.
        ray: see `evaluate`.
        progress: see `evaluate`.
        bounded: the searches whose bounds are computed.
    """
    end = checks.integer("seed", seed, 0) + checks.integer("episodes", episodes, 1)
    portions = [range(first, min(first + PORTION, end)) for first in range(seed, end, PORTION)]
    folder = None if out is None else RunFolder(out, _manifest(cases, episodes, seed))
    how: dict[str, Any] = {"workers": workers, "ray": ray}
    bounds = bounds_of(bounded, folder, progress=progress, **how)
    done: dict[Case, Episodes] = {}
    for case in cases:
        if folder is not None and case.spec.source is not None:
            arrays = folder.load(case.label)
            if arrays is not None:
                done[case] = Episodes.from_arrays(arrays)
    left = [case for case in cases if case not in done]
    # Policies are prepared first, each once.
    policies = dict(finished([partial(_prepared, case) for case in left], **how))
    jobs = [(case, policies[i], seeds) for i, case in enumerate(left) for seeds in portions]
    played: dict[Case, dict[int, Episodes]] = {case: {} for case in left}
    calls = [partial(_play, policy, case, seeds) for case, policy, seeds in jobs]
    with Progress(f"{len(cases)} evaluation{'s' * (len(cases) > 1)}", len(jobs), progress) as bar:
        for count, (job, part) in enumerate(finished(calls, **how), 1):
            bar(count)
            case, _, seeds = jobs[job]
            played[case][seeds.start] = part
            if len(played[case]) < len(portions):
                continue
            whole = Episodes.joined([played[case][each.start] for each in portions])
            done[case] = whole.with_common_curve() if case.is_exact else whole
            if folder is not None:
                folder.save(case.label, done[case].arrays)
    return [
        Evaluation(
            *(case.spec.name, case.search, seed, case.view, done[case], case.is_exact),
            bounds.get(case.search.name),
        )
        for case in cases
    ]


def bounds_of(
    searches: Iterable[NamedSearch],
    folder: RunFolder | None = None,
    *,
    workers: int,
    ray: str | None,
    progress: bool = True,
) -> dict[str, SuccessBound]:
    """The bounds of searches by name. They do not depend on `bayesian_update`.

    Args:
        searches: with different names.
        folder: where finished bounds are written and looked up.
        workers: see `evaluate`.
        ray: see `evaluate`.
        progress: see `evaluate`.
    """
    bounds: dict[str, SuccessBound] = {}
    left: list[NamedSearch] = []
    for each in searches:
        arrays = None if folder is None else folder.load(f"{each.name}.bound")
        if arrays is None:
            left.append(each)
        else:
            found: dict[str, Any] = {
                key: value if value.ndim else value.item() for key, value in arrays.items()
            }
            bounds[each.name] = SuccessBound(**found)
    calls = [partial(success_bound, each.scenario, each.drones) for each in left]
    with Progress(f"{len(left)} bound{'s' * (len(left) > 1)}", len(left), progress) as bar:
        for count, (job, bound) in enumerate(finished(calls, workers=workers, ray=ray), 1):
            bar(count)
            bounds[left[job].name] = bound
            if folder is not None:
                arrays = {key: np.asarray(value) for key, value in vars(bound).items()}
                folder.save(f"{left[job].name}.bound", arrays)
    return bounds


def searches_manifest(searches: Iterable[NamedSearch]) -> dict[str, Any]:
    """Everything that the bounds of some searches depend on."""
    return {
        "package": DroneSwarmSearch.__version__,
        "suite": SUITE_VERSION,
        "searches": {each.name: each.with_posterior(False).fingerprint for each in searches},
    }


def _manifest(cases: Sequence[Case], episodes: int, seed: int) -> dict[str, Any]:
    """Everything that the results of some cases depend on."""
    policies = {
        case.spec.name: {**(case.spec.source or {"policy": "in memory"}), "view": asdict(case.view)}
        for case in cases
    }
    searches = searches_manifest(case.search for case in cases)
    return {**searches, "episodes": episodes, "seed": seed, "policies": policies}


def _prepared(case: Case) -> Callable[..., Any]:
    """Make a policy for a search, and call its `prepare`."""
    policy = case.spec.make(case.search.scenario)
    prepare = getattr(policy, "prepare", None)
    if prepare is not None:
        prepare(case.search.drones)
    return policy


def _play(policy: Callable[..., Any], case: Case, seeds: Sequence[int]) -> Episodes:
    """Play a portion of episodes with a copy of the policy."""
    if not case.is_exact or case.search.scenario.mission == "coverage":
        return play(_copied(policy), case.search, seeds, case.view)
    player = _copied(policy)
    # One after the other and with two seeds, so that random actions differ.
    followed = [play(player, case.search, [seeds[0] + each], case.view) for each in range(2)]
    curves = Episodes.joined(followed).with_common_curve().curves
    played = play(_copied(policy), case.search, seeds, case.view, wants_curves=False)
    return replace(played, curves=curves)


def _copied(policy: Callable[..., Any]) -> Callable[..., Any]:
    """A copy; the policy itself if it cannot be copied."""
    try:
        return copy.deepcopy(policy)
    except TypeError:  # it holds a lock or a file, for example
        return policy
