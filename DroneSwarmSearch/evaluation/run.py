"""Evaluation: a policy plays the episodes of a search, in portions, here or on workers.

Portions have a fixed size and each is played by a copy of the policy as it was made, so
that the figures are the same to the last bit, whatever the workers and whatever was found
in a store. A policy that cannot be copied by pickling plays itself, without workers alone.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import cloudpickle

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch.evaluation import workers as work
from DroneSwarmSearch.evaluation.episodes import checked_view, play
from DroneSwarmSearch.evaluation.files import Store
from DroneSwarmSearch.evaluation.identity import NotIdentifiedError, fingerprint_of_copies
from DroneSwarmSearch.evaluation.policy_spec import PolicySpec
from DroneSwarmSearch.evaluation.progress import Progress
from DroneSwarmSearch.evaluation.results import Bound, Episodes, Evaluation, checked_bound
from DroneSwarmSearch.evaluation.suite import NamedSearch, as_named
from DroneSwarmSearch.evaluation.workers import Job, Report

__all__ = ["PORTION", "EvaluationTask", "evaluate"]

PORTION = 500
"""Episodes played together, and kept together in a store."""

_EPISODE_BYTES = 32
"""What is kept of an episode at least: four numbers."""

Made = bytes | Callable[..., Any]
"""A policy, pickled; itself only where it cannot be."""


def evaluate(
    policy: object,
    search: object,
    *,
    episodes: int = 2000,
    seed: int = 0,
    bayesian_update: bool | None = None,
    view: str = "swarm",
    observation: str = "dict",
    workers: int = 1,
    ray: str | None = None,
    store: Store | str | Path | None = None,
    name: str | None = None,
    bound: Bound | None = None,
    progress: bool = True,
) -> Evaluation:
    """Evaluate a policy on a search.

    Episode i has the seed `seed + i`, so every policy meets the same seas. The policy plays
    in portions of 500 episodes, each with a copy of it as it was given. Of its methods,
    if it has them, `prepare(drones)` is told the drones' start cells once, before it is
    copied, and `reset(seed=..., rows=None)` the seeds when a portion begins.

    Args:
        policy: a name of the registry; "module:attribute" or "file.py:attribute"; or a
            callable from observations to actions. A class is called with the search's
            `Scenario` first.
        search: a name of the suite, a `NamedSearch`, or a `Scenario`.
        episodes: how many; at least 1.
        seed: of the first; at least 0.
        bayesian_update: whether the matrix shown is the posterior, or the drift alone;
            None: as the search has it.
        view: what the policy is shown, and what it returns. "swarm": all searches under way
            as `SwarmVectorEnv` shows them, and in the dict layout their numbers as "row";
            actions of shape (E, n_drones). "drone": their drones as `DroneVectorEnv` shows
            them; actions of shape (E * n_drones,). "parallel": one search at a time as
            `DroneSwarmSearch` shows it; a dict of actions.
        observation: the layout of the first two, a name of `layouts.LAYOUTS`.
        workers: processes to play in.
        ray: play on Ray instead: "local", or a cluster's address.
        store: where finished portions are kept and looked for; a `Store` or its folder.
            Portions are found again by the policy's code and state, as it is made for the
            search and prepared. Where these cannot be told, nothing is stored, and a line on
            stderr says why.
        name: what the policy is called; without it, what it calls itself. Portions stored
            under another name are not found.
        bound: what no policy can exceed on the search, see `planning.success_bound`.
        progress: show a progress bar if it takes more than two seconds.

    Returns:
        The episodes, with figures and intervals.

    Raises:
        TypeError: an argument is of the wrong type, or what the policy returns.
        ValueError: an argument is out of its limits, or what the policy returns.
        ImportError: `ray` is given and Ray is not installed.
        StorageError: the store cannot be written; what was finished before is kept.
        WorkerCrashed: a worker ended in mid-work; what was finished before is kept.
    """
    cell = EvaluationTask(
        policy,
        search,
        episodes=episodes,
        seed=seed,
        bayesian_update=bayesian_update,
        view=view,
        observation=observation,
        store=store,
        name=name,
    )
    checked_bound(bound, cell.search)
    with Progress(f"{cell.spec.name} on {cell.search.name}", episodes, progress) as bar:
        work.run(cell.jobs(), workers=workers, ray=ray, progress=bar)
    return cell.evaluation().with_bound(bound)


class EvaluationTask:
    """A policy on a search, to be evaluated: the jobs to do, and then the result.

    Jobs of many cells can be run together, to keep all workers busy to the end:

        workers.run([job for cell in cells for job in cell.jobs()], workers=2)

    Their weights are episodes.

    Args:
        policy, search, episodes, seed, bayesian_update, view, observation, store, name: as
            for `evaluate`.

    Attributes:
        spec: the policy.
        search: the search, with `bayesian_update` as it is to be.
        episodes: how many.
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
        store: Store | str | Path | None = None,
        name: str | None = None,
    ) -> None:
        self.search: NamedSearch = as_named(search)
        if bayesian_update is not None:
            self.search = self.search.with_posterior(bayesian_update)
        self.episodes = checks.integer("episodes", episodes, 1)
        checks.fits("their figures", _EPISODE_BYTES * self.episodes, episodes=self.episodes)
        self._seed = checks.integer("seed", seed, 0)
        self._view, self._observation = checked_view(view, observation)
        self.spec = PolicySpec.of(policy, name)
        if self.spec.is_batch_policy:
            _check_form(self.spec.name, self._view, self._observation)
        if store is None or isinstance(store, Store):
            self._store = store
        elif isinstance(store, (str, Path)):
            self._store = Store(store)
        else:
            raise TypeError(f"store must be a Store, a folder or None, got {store!r}")
        self._identity = self.spec.identity
        last = self._seed + self.episodes
        self._portions = [
            range(first, min(first + PORTION, last)) for first in range(self._seed, last, PORTION)
        ]
        self._done: dict[range, Episodes] = {}

    def jobs(self) -> list[Job]:
        """What is left to do; portions that the store has are taken from it.

        What they are found by is known of the package's own policies beforehand. Any other
        policy is made for it, here and before any portion is played: playing may change what
        classes and modules hold.
        """
        made = None
        if self._store is not None and not self.spec.is_known:
            made = self._identified(self._store)
        missing = [portion for portion in self._portions if not self._load(portion)]
        stored = Job("", None, weight=sum(map(len, self._portions)) - sum(map(len, missing)))
        if not missing:
            return [stored]
        if made is not None:
            return [stored, *self._jobs_of_portions(missing, made)]
        make = Job(
            self._making,
            _made,
            (self.spec, self.search),
            then=partial(self._jobs_of_portions, missing),
        )
        return [stored, make]

    def _identified(self, store: Store) -> Made:
        """The policy, made; from now on its portions are found by its fingerprint."""
        with work.no_exit(self._making):
            made = _made(self.spec, self.search, lambda share: None)
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
        return f"the making of {self.spec.name} for {self.search.name}"

    @property
    def is_done(self) -> bool:
        """Whether all portions have been played."""
        return len(self._done) == len(self._portions)

    def evaluation(self) -> Evaluation:
        """The result, once all jobs are done.

        Raises:
            RuntimeError: they are not.
        """
        if not self.is_done:
            left = len(self._portions) - len(self._done)
            raise RuntimeError(f"{left} of {len(self._portions)} portions have not been played")
        return Evaluation(
            self.spec.name,
            self.search,
            self._seed,
            self._view,
            self._observation,
            Episodes.joined([self._done[portion] for portion in self._portions]),
        )

    def _jobs_of_portions(self, portions: list[range], policy: Made) -> Iterator[Job]:
        is_ours = self.spec.is_ours
        for portion in portions:
            yield Job(
                f"episodes {portion.start} to {portion.stop - 1} of {self.spec.name} on "
                f"{self.search.name}",
                _played,
                (policy, self.search, portion, self._view, self._observation, is_ours),
                weight=len(portion),
                then=partial(self._take_in, portion),
            )

    def _take_in(self, portion: range, episodes: Episodes) -> Iterable[Job]:
        self._done[portion] = episodes
        if self._store is not None:
            self._store.save(self._key(portion), episodes.data)
        return ()

    def _load(self, portion: range) -> bool:
        """Take a portion from the store, if it is there."""
        data = None if self._store is None else self._store.load(self._key(portion))
        if data is None:
            return False
        try:
            episodes = Episodes.from_data(data)
        except ValueError:
            return False
        scenario = self.search.scenario
        fits = episodes.found_at.shape == (len(portion), len(scenario.person_initial_position))
        if fits and episodes.steps.max() <= scenario.timestep_limit:
            self._done[portion] = episodes
        return portion in self._done

    def _key(self, portion: range) -> dict[str, Any]:
        """All that a portion's episodes follow from."""
        return {
            "what": "episodes",
            "policy": self._identity,
            "parameters": self.search.data,
            "view": self._view,
            "observation": self._observation,
            "seeds": [portion.start, portion.stop],
        }


def _check_form(name: str, view: str, observation: str) -> None:
    """Refuse to show a policy of the package what it does not take."""
    if view == "drone":
        raise ValueError(
            f"view must be 'swarm' or 'parallel' for {name}, which steers whole swarms, got 'drone'"
        )
    if observation != "dict":
        raise ValueError(
            f"observation must be 'dict' for {name}, which takes positions and a matrix, "
            f"got {observation!r}"
        )


# What is done by jobs.


def _made(spec: PolicySpec, search: NamedSearch, report: Report) -> Made:
    """A policy for a search, prepared for it if it can be."""
    policy = spec.make(search.scenario)
    prepare = getattr(policy, "prepare", None)
    if prepare is not None:
        prepare(search.drones)
    try:
        packed: bytes = cloudpickle.dumps(policy)
    except Exception:  # whatever its parts raise; nothing is sent anywhere without workers
        return policy
    return packed


def _played(
    policy: Made,
    search: NamedSearch,
    seeds: range,
    view: str,
    observation: str,
    is_ours: bool,
    report: Report,
) -> Episodes:
    """A portion of episodes."""
    if not isinstance(policy, bytes):
        player = policy
    elif is_ours:
        player = _last_unpacked(policy)
    else:
        player = cloudpickle.loads(policy)
    return play(player, search, seeds, view, observation, report)


@lru_cache(maxsize=1)
def _last_unpacked(policy: bytes) -> Callable[..., Any]:
    """A policy of the registry, the same one as in the portion before.

    What it remembers of earlier episodes changes none of its actions, but spares it work.
    """
    unpacked: Callable[..., Any] = cloudpickle.loads(policy)
    return unpacked
