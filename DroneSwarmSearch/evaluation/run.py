"""Evaluate policies on searches, in portions of episodes.

The size of a portion is fixed, and each portion is played by a fresh copy of the policy. The
results are therefore identical for any number of workers and after any interruption.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import DroneSwarmSearch
from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.progress import Progress
from DroneSwarmSearch.evaluation.episodes import Episodes
from DroneSwarmSearch.evaluation.parallel import finished
from DroneSwarmSearch.evaluation.policy_spec import PolicySpec
from DroneSwarmSearch.evaluation.results import Evaluation, checked_bound
from DroneSwarmSearch.evaluation.rollout import play
from DroneSwarmSearch.evaluation.run_folder import RunFolder
from DroneSwarmSearch.evaluation.suite import SUITE_VERSION, NamedSearch, as_named
from DroneSwarmSearch.evaluation.view import View
from DroneSwarmSearch.planning.bound import SuccessBound

__all__ = [
    "PORTION",
    "Case",
    "Sampling",
    "evaluate",
    "evaluate_cases",
    "manifest",
    "run_folder",
    "searches_manifest",
]

PORTION = 500
"""Episodes that are played together."""

_NUMBER_BYTES = 8


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
    bound: SuccessBound | None = None,
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
        bound: the upper bound for the search, from `planning.success_bound`.
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
    checked_bound(bound, case.search)
    sampling = Sampling(episodes, seed)
    folder = run_folder(out, manifest([case], sampling))
    what = f"{case.spec.name} on {case.search.name}"
    (evaluation,) = evaluate_cases(
        [case], sampling, folder, what, workers=workers, ray=ray, progress=progress
    )
    return evaluation.with_bound(bound)


@dataclass(frozen=True)
class Sampling:
    """How many episodes are played, and the seed of the first."""

    episodes: int
    seed: int

    def __post_init__(self) -> None:
        checks.integer("episodes", self.episodes, 1)
        checks.integer("seed", self.seed, 0)

    @property
    def portions(self) -> list[range]:
        """The seeds of each portion."""
        end = self.seed + self.episodes
        return [range(each, min(each + PORTION, end)) for each in range(self.seed, end, PORTION)]


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
        named = as_named(search)
        if view.bayesian_update is not None:
            named = named.with_posterior(view.bayesian_update)
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


def manifest(cases: Iterable[Case], sampling: Sampling) -> dict[str, Any]:
    """Everything that the results of some cases depend on."""
    every = list(cases)
    return {
        **searches_manifest(case.search for case in every),
        "episodes": sampling.episodes,
        "seed": sampling.seed,
        "policies": {
            case.spec.name: {
                **(case.spec.source or {"policy": "in memory"}),
                "view": asdict(case.view),
            }
            for case in every
        },
    }


def run_folder(out: str | Path | None, manifest: Mapping[str, Any]) -> RunFolder | None:
    """The folder of a run, if one is given."""
    return None if out is None else RunFolder(out, manifest)


def searches_manifest(searches: Iterable[NamedSearch]) -> dict[str, Any]:
    """Everything that the bounds of some searches depend on."""
    return {
        "package": DroneSwarmSearch.__version__,
        "suite": SUITE_VERSION,
        "searches": {each.name: each.with_posterior(False).fingerprint for each in searches},
    }


def evaluate_cases(
    cases: Sequence[Case],
    sampling: Sampling,
    folder: RunFolder | None,
    what: str,
    *,
    workers: int,
    ray: str | None,
    progress: bool = True,
) -> list[Evaluation]:
    """Evaluate several cases together, which keeps all workers busy.

    Args:
        cases: the policies and searches.
        sampling: the episodes.
        folder: where finished results are written and looked up.
        what: the work, for the progress bar.
        workers: see `evaluate`.
        ray: see `evaluate`.
        progress: see `evaluate`.
    """
    for case in cases:
        _check_memory(case, sampling.episodes)
    done: dict[Case, Episodes] = {}
    for case in cases:
        if folder is not None and case.spec.source is not None:
            arrays = folder.load(case.label)
            if arrays is not None:
                done[case] = Episodes.from_arrays(arrays)
    left, portions = [case for case in cases if case not in done], sampling.portions
    # Policies are prepared first, each once.
    policies: Mapping[int, Callable[..., Any]] = dict(
        finished([partial(_prepared, each) for each in left], workers=workers, ray=ray)
    )
    jobs = [(place, portion) for place in range(len(left)) for portion in range(len(portions))]
    calls = [partial(_play, policies[i], left[i], portions[portion]) for i, portion in jobs]
    played: list[dict[int, Episodes]] = [{} for _ in left]
    with Progress(what, len(jobs), progress) as bar:
        for count, (job, part) in enumerate(finished(calls, workers=workers, ray=ray), 1):
            bar(count)
            place, portion = jobs[job]
            played[place][portion] = part
            if len(played[place]) < len(portions):
                continue
            case, parts = left[place], played[place]
            whole = Episodes.joined([parts[each] for each in range(len(portions))])
            done[case] = whole.with_common_curve() if case.is_exact else whole
            if folder is not None:
                folder.save(case.label, done[case].arrays)
    return [
        Evaluation(case.spec.name, case.search, sampling.seed, case.view, done[case], case.is_exact)
        for case in cases
    ]


def _check_memory(case: Case, episodes: int) -> None:
    numbers = 4 if case.is_exact else 4 + case.search.scenario.timestep_limit
    checks.fits("their results", _NUMBER_BYTES * numbers * episodes, episodes=episodes)


def _prepared(case: Case) -> Callable[..., Any]:
    """Make a policy for a search, and call its `prepare`."""
    policy = case.spec.make(case.search.scenario)
    prepare = getattr(policy, "prepare", None)
    if prepare is not None:
        prepare(case.search.drones)
    return policy


def _play(policy: Callable[..., Any], case: Case, seeds: range) -> Episodes:
    """Play a portion of episodes with a copy of the policy."""
    if not case.is_exact or case.search.scenario.mission == "coverage":
        return play(_copied(policy), case.search, seeds, case.view)
    player = _copied(policy)
    # One after the other and with two seeds, so that random actions differ.
    followed = [play(player, case.search, [seeds.start + each], case.view) for each in range(2)]
    curves = Episodes.joined(followed).with_common_curve().curves
    played = play(_copied(policy), case.search, seeds, case.view, wants_curves=False)
    return replace(played, curves=curves)


def _copied(policy: Callable[..., Any]) -> Callable[..., Any]:
    """A copy; the policy itself if it cannot be copied."""
    try:
        return copy.deepcopy(policy)
    except TypeError:  # it holds a lock or a file, for example
        return policy
