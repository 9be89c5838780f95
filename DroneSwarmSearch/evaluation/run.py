"""Evaluate a policy on a search, in portions of episodes that can be stored.

The size of a portion is fixed, and each portion is played by a fresh copy of the policy. The
results are therefore identical for any number of workers and after any interruption. A policy
that cannot be pickled plays all portions itself, in this process.
"""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import cloudpickle
import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.progress import Progress
from DroneSwarmSearch.evaluation import workers as work
from DroneSwarmSearch.evaluation.bounds import BoundTask
from DroneSwarmSearch.evaluation.conditional import as_text, conditional_success, from_text
from DroneSwarmSearch.evaluation.episodes import Episodes, is_curve
from DroneSwarmSearch.evaluation.exact import can_be_exact, exact_success
from DroneSwarmSearch.evaluation.identity import NotIdentifiedError, fingerprint_of_copies
from DroneSwarmSearch.evaluation.policy_spec import PolicySpec
from DroneSwarmSearch.evaluation.results import Evaluation, checked_bound
from DroneSwarmSearch.evaluation.rollout import (
    checked_masks,
    checked_view,
    play,
    prepare_policy,
)
from DroneSwarmSearch.evaluation.store import Store, as_store
from DroneSwarmSearch.evaluation.suite import NamedSearch, as_named
from DroneSwarmSearch.evaluation.workers import Job, Report
from DroneSwarmSearch.planning.bound import SuccessBound

__all__ = ["PORTION", "EvaluationTask", "evaluate", "run_tasks"]

PORTION = 500
"""Episodes that are played and stored together."""

_NUMBER_BYTES = 8

Floats = NDArray[np.float64]

Made = bytes | Callable[..., Any]
"""A pickled policy, or the policy itself if it cannot be pickled."""


def evaluate(
    policy: object,
    search: object,
    *,
    episodes: int = 2000,
    seed: int = 0,
    bayesian_update: bool | None = None,
    view: str = "swarm",
    observation: str = "dict",
    action_mask: bool = False,
    right_of_way: bool = False,
    deterministic: bool | None = None,
    workers: int = 1,
    ray: str | None = None,
    store: Store | str | Path | None = None,
    name: str | None = None,
    bound: SuccessBound | None = None,
    progress: bool = True,
) -> Evaluation:
    """Evaluate a policy on a search.

    Success and time are exact if the policy is deterministic and there is one person, or two and
    at most 500 steps; in the coverage mission, everything is if the policy is deterministic.
    Otherwise, they are means over sampled paths of the probability of success given the path
    (conditional Monte Carlo). Returns and endings are those of the episodes.

    Episode i has the seed `seed + i`, so all policies use common random numbers. The policy
    plays in portions of 500 episodes, each with a copy of the policy as you passed it. Two
    optional methods of the policy are called: `prepare(drones)` with the drones' start cells,
    once and before it is copied, and `reset(seed=..., rows=None)` with the seeds of each
    portion. If `prepare` has a parameter `report`, it is a function to call with the share of
    its work that is done.

    Args:
        policy: the name of a policy of this package; "weights.npz"; "module:attribute" or
            "file.py:attribute"; or a callable from observations to actions. A class is
            instantiated with the search's `Scenario`.
        search: the name of a search of the suite, a `NamedSearch`, or a `Scenario`.
        episodes: the number of episodes, at least 1.
        seed: of the first episode, at least 0.
        bayesian_update: whether the policy sees the posterior, or the prior that only follows
            the drift; None: as in the search.
        view: what the policy sees and returns. "swarm": the observations of `SwarmVectorEnv`
            for the E episodes that have not ended, in the dict layout with their indices as
            "row"; actions of shape (E, n_drones). "drone": the observations of
            `DroneVectorEnv`; actions of shape (E * n_drones,). "parallel": the observations
            of `DroneSwarmSearch`, one episode at a time; a dict of actions.
        observation: the layout for "swarm" and "drone": "dict", "flat", "planes", "top-cells"
            or "crops".
        action_mask: whether the policy gets masks of valid actions: {"observation": as above,
            "action_mask": int8}, shape (E, n_drones, 6) for "swarm", (E * n_drones, 6) for
            "drone"; for "parallel", each drone's mask has the shape (6,). See
            `wrappers.action_masks`.
        right_of_way: whether these masks prevent all collisions.
        deterministic: whether the actions depend on nothing but what the policy has observed
            since the episode began. None: they do for subclasses of `SwarmPolicy`, which must
            be deterministic, and for the package's policies except "random".
        workers: the number of processes; more than 1 needs joblib.
        ray: run on Ray instead: "local", "auto" or the address of a cluster.
        store: a folder, in which finished portions are stored and looked up. A portion is
            identified by the policy's code and state. If these cannot be determined, nothing
            is stored, and a line on stderr gives the reason.
        name: the policy's name in results. Portions stored under another name are not found.
        bound: the upper bound for the search, from `planning.success_bound`.
        progress: show a progress bar after two seconds.

    Returns:
        The episodes, with estimates and intervals.

    Raises:
        TypeError: an argument, or what the policy returns, is of the wrong type.
        ValueError: an argument, or what the policy returns, is out of range; or a policy that is
            to be deterministic acts differently after the same observations.
        ImportError: joblib or Ray is needed and not installed.
        StorageError: the store cannot be written; finished portions are kept.
        WorkerCrashed: a worker process died; finished portions are kept.
    """
    task = EvaluationTask(
        policy,
        search,
        episodes=episodes,
        seed=seed,
        bayesian_update=bayesian_update,
        view=view,
        observation=observation,
        action_mask=action_mask,
        right_of_way=right_of_way,
        deterministic=deterministic,
        store=store,
        name=name,
    )
    checked_bound(bound, task.search)
    what = f"{task.spec.name} on {task.search.name}"
    run_tasks([task], what, workers=workers, ray=ray, progress=progress)
    return task.evaluation().with_bound(bound)


def run_tasks(
    tasks: Sequence[EvaluationTask | BoundTask],
    what: str,
    *,
    workers: int,
    ray: str | None,
    progress: bool = True,
) -> None:
    """Do the work of several tasks together, which keeps all workers busy.

    Args:
        tasks: the tasks, in the order of their jobs.
        what: the work, for the progress bar.
        workers: see `evaluate`.
        ray: see `evaluate`.
        progress: see `evaluate`.
    """
    jobs = [job for task in tasks for job in task.jobs()]
    with Progress(what, sum(task.weight for task in tasks), progress) as bar:
        work.run(jobs, workers=workers, ray=ray, progress=bar)


class EvaluationTask:
    """A policy to be evaluated on a search by `run_tasks`.

    Args:
        policy, search, episodes, seed, bayesian_update, view, observation, action_mask,
            right_of_way, deterministic, store, name: see `evaluate`.

    Attributes:
        spec: the policy.
        search: the search, with `bayesian_update` as it is evaluated.
        weight: the number of episodes left to play, which are the unit of the jobs' weights.
    """

    def __init__(
        self,
        policy: object,
        search: object,
        *,
        episodes: int = 2000,
        seed: int = 0,
        bayesian_update: bool | None = None,
        view: str = "swarm",
        observation: str = "dict",
        action_mask: bool = False,
        right_of_way: bool = False,
        deterministic: bool | None = None,
        store: Store | str | Path | None = None,
        name: str | None = None,
    ) -> None:
        self.search: NamedSearch = as_named(search)
        if bayesian_update is not None:
            self.search = self.search.with_posterior(bayesian_update)
        self.weight = checks.integer("episodes", episodes, 1)
        self._seed = checks.integer("seed", seed, 0)
        self._view, self._observation = checked_view(view, observation)
        self._masks = checked_masks(action_mask, right_of_way)
        self.spec = PolicySpec.of(policy, name)
        if self.spec.is_batch_policy:
            _check_view_of_package_policy(
                self.spec.name, self._view, self._observation, self._masks
            )
        self._is_deterministic = self.spec.is_deterministic
        if deterministic is not None:
            self._is_deterministic = checks.boolean("deterministic", deterministic)
        scenario = self.search.scenario
        # In the coverage mission, every episode has its probability of success.
        self._wants_exact = self._is_deterministic and can_be_exact(scenario)
        self._wants_conditional = scenario.mission == "rescue" and not self._wants_exact
        numbers = 4 if self._wants_exact else 4 + scenario.timestep_limit
        checks.fits("their results", _NUMBER_BYTES * numbers * self.weight, episodes=self.weight)
        self._exact: Floats | None = None
        self._conditional: dict[range, Floats] = {}
        self._store = as_store(store)
        self._identity = self.spec.identity
        last = self._seed + self.weight
        self._portions = [
            range(first, min(first + PORTION, last)) for first in range(self._seed, last, PORTION)
        ]
        self._done: dict[range, Episodes] = {}

    def jobs(self) -> list[Job]:
        """Return the jobs that are left; stored portions are loaded.

        The package's own policies are identified without being made. Any other policy is made
        here to identify it, before a portion is played: playing may change the attributes of
        its classes and modules.
        """
        made = None
        if self._store is not None and not self.spec.is_known:
            made = self._make_and_identify(self._store)
        missing = [portion for portion in self._portions if not self._load(portion)]
        unestimated = [portion for portion in self._portions if not self._load_conditional(portion)]
        self.weight = sum(map(len, (*missing, *unestimated)))
        if self._needs_exact and not self._load_exact():
            self.weight += self._exact_weight
        if not self.weight:
            return []
        if made is not None:
            return list(self._portion_jobs(missing, unestimated, made))
        then = partial(self._portion_jobs, missing, unestimated)
        return [Job(self._making, _make, (self.spec, self.search), then=then)]

    def _make_and_identify(self, store: Store) -> Made:
        """Make the policy, and add a hash of its code and state to its identity."""
        with work.no_exit(self._making):
            made = _make(self.spec, self.search, lambda share: None)
        try:
            self._identity = f"{self.spec.identity}:{fingerprint_of_copies(made)}"
        except NotIdentifiedError as error:
            self._store = None
            print(
                f"{self.spec.name} on {self.search.name} is not stored in "
                f"{store.directory}: {error}",
                file=sys.stderr,
            )
        return made

    @property
    def _making(self) -> str:
        return f"the construction of {self.spec.name} for {self.search.name}"

    @property
    def _needs_exact(self) -> bool:
        """Whether the exact success is still to be computed."""
        return self._wants_exact and self._exact is None

    @property
    def _exact_weight(self) -> int:
        """The work for the exact success: an episode, or one for each first find."""
        scenario = self.search.scenario
        return scenario.timestep_limit * (len(scenario.situation) - 1) + 1

    @property
    def is_done(self) -> bool:
        """Whether all jobs are done."""
        conditional = len(self._portions) * self._wants_conditional
        return (
            len(self._done) == len(self._portions)
            and len(self._conditional) == conditional
            and not self._needs_exact
        )

    def evaluation(self) -> Evaluation:
        """Return the result, once all jobs are done.

        Raises:
            RuntimeError: they are not.
        """
        if not self.is_done:
            left = len(self._portions) - len(self._done)
            raise RuntimeError(f"{left} of {len(self._portions)} portions have not been played")
        episodes = Episodes.joined([self._done[portion] for portion in self._portions])
        exact = self._exact
        if self._is_deterministic and episodes.coverage is not None:
            exact = episodes.coverage.common_curve()
        conditional = None
        if self._wants_conditional:
            conditional = np.concatenate([self._conditional[each] for each in self._portions])
        return Evaluation(
            self.spec.name,
            self.search,
            self._seed,
            self._view,
            self._observation,
            episodes,
            exact=exact,
            conditional=conditional,
            action_mask=self._masks is not None,
            right_of_way=self._masks is True,
        )

    def _portion_jobs(
        self, portions: list[range], unestimated: list[range], policy: Made
    ) -> Iterator[Job]:
        shared = policy, self.search
        shown = self._view, self._observation, self._masks, self.spec.is_reusable
        if self._needs_exact:
            label = f"the exact success of {self.spec.name} on {self.search.name}"
            weight = self._exact_weight
            yield Job(label, _exact, (*shared, *shown), weight=weight, then=self._finish_exact)
        for portion in portions:
            yield Job(
                f"episodes {portion.start} to {portion.stop - 1} of {self.spec.name} on "
                f"{self.search.name}",
                _play,
                (*shared, portion, *shown),
                weight=len(portion),
                then=partial(self._finish, portion),
            )
        for portion in unestimated:
            yield Job(
                f"the conditional success of episodes {portion.start} to {portion.stop - 1} of "
                f"{self.spec.name} on {self.search.name}",
                _conditional,
                (*shared, portion, *shown),
                weight=len(portion),
                then=partial(self._finish_conditional, portion),
            )

    def _finish(self, portion: range, episodes: Episodes) -> Iterable[Job]:
        self._done[portion] = episodes
        if self._store is not None:
            self._store.save(self._key(portion), episodes.data)
        return ()

    def _finish_conditional(self, portion: range, curves: Floats) -> Iterable[Job]:
        self._conditional[portion] = curves
        if self._store is not None:
            self._store.save(self._conditional_key(portion), as_text(curves))
        return ()

    def _finish_exact(self, success: Floats) -> Iterable[Job]:
        self._exact = success
        if self._store is not None:
            self._store.save(self._exact_key, success.tolist())
        return ()

    def _load_exact(self) -> bool:
        """Load the exact success from the store, if it has it."""
        data = None if self._store is None else self._store.load(self._exact_key)
        try:
            success = np.array(data, np.float64)
        except (OverflowError, TypeError, ValueError):
            return False
        if success.shape == (self.search.scenario.timestep_limit + 1,) and is_curve(success):
            self._exact = success
        return self._exact is not None

    def _load_conditional(self, portion: range) -> bool:
        """Load the conditional success of a portion, if it is needed and the store has it."""
        if not self._wants_conditional:
            return True
        data = None if self._store is None else self._store.load(self._conditional_key(portion))
        shape = len(portion), self.search.scenario.timestep_limit + 1
        with contextlib.suppress(ValueError):
            self._conditional[portion] = from_text(data, shape)
        return portion in self._conditional

    def _load(self, portion: range) -> bool:
        """Load a portion from the store, if it has it."""
        data = None if self._store is None else self._store.load(self._key(portion))
        if data is None:
            return False
        try:
            episodes = Episodes.from_data(data)
        except ValueError:
            return False
        scenario = self.search.scenario
        coverage = episodes.coverage
        fits = episodes.found_at.shape == (len(portion), len(scenario.situation))
        if scenario.mission == "coverage":
            shape = len(portion), scenario.timestep_limit + 1
            fits &= coverage is not None and coverage.probability_of_success.shape == shape
        else:
            fits &= coverage is None
        if fits and episodes.steps.max() <= scenario.timestep_limit:
            self._done[portion] = episodes
        return portion in self._done

    def _key(self, portion: range) -> dict[str, Any]:
        """Everything that determines a portion's episodes."""
        return {"what": "episodes", **self._shared_key, "seeds": [portion.start, portion.stop]}

    def _conditional_key(self, portion: range) -> dict[str, Any]:
        """Everything that determines the conditional success of a portion."""
        return {**self._key(portion), "what": "conditional success"}

    @property
    def _exact_key(self) -> dict[str, Any]:
        """Everything that determines the exact success."""
        return {"what": "exact success", **self._shared_key}

    @property
    def _shared_key(self) -> dict[str, Any]:
        return {
            "policy": self._identity,
            "parameters": self.search.data,
            "view": self._view,
            "observation": self._observation,
            "masks": self._masks,
        }


def _check_view_of_package_policy(
    name: str, view: str, observation: str, masks: bool | None
) -> None:
    """Refuse a view, a layout or masks that the package's policies cannot read."""
    if view == "drone":
        raise ValueError(
            f"view must be 'swarm' or 'parallel' for {name}, which steers whole swarms, got 'drone'"
        )
    if observation != "dict":
        raise ValueError(
            f"observation must be 'dict' for {name}, which takes positions and a matrix, "
            f"got {observation!r}"
        )
    if masks is not None:
        raise ValueError(f"action_mask must be False for {name}, which takes no masks, got True")


# The jobs.


def _make(spec: PolicySpec, search: NamedSearch, report: Report) -> Made:
    """Make a policy for a search, and call its `prepare`."""
    policy = spec.make(search.scenario)
    prepare_policy(policy, search.drones, report)
    try:
        packed: bytes = cloudpickle.dumps(policy)
    except Exception:  # its parts may raise anything
        return policy
    return packed


def _play(
    policy: Made,
    search: NamedSearch,
    seeds: range,
    view: str,
    observation: str,
    masks: bool | None,
    is_reusable: bool,
    report: Report,
) -> Episodes:
    """Play a portion of episodes."""
    return play(_player(policy, is_reusable), search, seeds, view, observation, report, masks)


def _conditional(
    policy: Made,
    search: NamedSearch,
    seeds: range,
    view: str,
    observation: str,
    masks: bool | None,
    is_reusable: bool,
    report: Report,
) -> Floats:
    """Compute the conditional success of a portion of episodes."""
    player = _player(policy, is_reusable)
    return conditional_success(player, search, seeds, view, observation, report, masks)


def _exact(
    policy: Made,
    search: NamedSearch,
    view: str,
    observation: str,
    masks: bool | None,
    is_reusable: bool,
    report: Report,
) -> Floats:
    """Compute the exact success."""
    return exact_success(_player(policy, is_reusable), search, view, observation, report, masks)


def _player(policy: Made, is_reusable: bool) -> Callable[..., Any]:
    """The policy itself if it cannot be copied, otherwise a copy."""
    if not isinstance(policy, bytes):
        return policy
    if is_reusable:
        return _last_unpickled(policy)
    player: Callable[..., Any] = cloudpickle.loads(policy)
    return player


@lru_cache(maxsize=1)
def _last_unpickled(policy: bytes) -> Callable[..., Any]:
    """The same copy as in the portion before, whose caches save work."""
    unpickled: Callable[..., Any] = cloudpickle.loads(policy)
    return unpickled
