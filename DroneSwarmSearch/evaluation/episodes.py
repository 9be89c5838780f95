"""Episodes played by a policy on the batched engine, and what is noted of them.

A policy is shown the searches still under way and nothing else; what it returns is checked.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.grid import grid_of
from DroneSwarmSearch.evaluation.results import Episodes
from DroneSwarmSearch.evaluation.statistics import Reliability
from DroneSwarmSearch.evaluation.suite import NamedSearch
from DroneSwarmSearch.observations import observe
from DroneSwarmSearch.rules import Action
from DroneSwarmSearch.vector import DroneVectorEnv, SearchBatch, SwarmVectorEnv
from DroneSwarmSearch.wrappers.layouts import LAYOUTS

__all__ = ["VIEWS", "checked_view", "play"]

Ints = NDArray[np.int64]
Report = Callable[[float], None]
PolicyLike = Callable[[Any], Any]

VIEWS = ("swarm", "drone", "parallel")

_SEARCH, _IDLE = int(Action.SEARCH), int(Action.IDLE)


def checked_view(view: object, observation: object) -> tuple[str, str]:
    """A way to show searches to a policy, and a layout.

    Raises:
        TypeError: one of them is no string.
        ValueError: there is no such view or layout, or they do not go together.
    """
    view = checks.choice("view", view, VIEWS)
    observation = checks.choice("observation", observation, tuple(LAYOUTS))
    if view == "parallel" and observation != "dict":
        raise ValueError(f"view='parallel' needs observation='dict', got {observation!r}")
    return str(view), str(observation)


def play(
    policy: PolicyLike,
    search: NamedSearch,
    seeds: Sequence[int],
    view: str = "swarm",
    observation: str = "dict",
    report: Report = lambda share: None,
) -> Episodes:
    """Let a policy play an episode for each seed.

    Args:
        policy: a callable from observations to actions. Its method `reset`, if it has one,
            is told the episodes' seeds before they begin.
        search: what is searched.
        seeds: of the episodes, integers >= 0.
        view: "swarm": what `SwarmVectorEnv` shows of the searches under way, in the dict
            layout with their numbers as "row", int64 (E,); actions of shape (E, n_drones).
            "drone": what `DroneVectorEnv` shows; actions of shape (E * n_drones,).
            "parallel": what `DroneSwarmSearch` shows, one search after another; actions as
            a dict.
        observation: the layout of the first two, see `layouts.LAYOUTS`.
        report: told now and then which share of the work is done.

    Raises:
        TypeError: the policy returns something of the wrong type.
        ValueError: it returns actions out of range, or of the wrong shape.
    """
    if view != "parallel":
        return _play(policy, _vector_stage(search, len(seeds), view, observation), seeds, report)
    stage = _ParallelStage(search)
    parts = []
    for done, seed in enumerate(seeds, 1):
        parts.append(_play(policy, stage, [seed], lambda share: None))
        report(done / len(seeds))
    return Episodes.joined(parts)


def _play(policy: PolicyLike, stage: _Stage, seeds: Sequence[int], report: Report) -> Episodes:
    """Play all episodes of a stage together."""
    batch = stage.batch
    scenario = batch.scenario
    limit, detections = scenario.timestep_limit, np.array(scenario.detections)
    batch.reset(seeds)
    _reset(policy, stage.seeds(seeds))
    n, drones = len(seeds), scenario.n_drones
    found_at = np.zeros((n, len(detections)), np.int64)
    endings, steps, returns = np.zeros(n, np.int64), np.zeros(n, np.int64), np.zeros(n)
    reliability = Reliability.empty()
    rows, step = np.arange(n), 0
    while rows.size:
        step += 1
        actions = np.full((n, drones), _IDLE)
        actions[rows] = stage.read(policy(stage.observe(rows)), len(rows))

        missing, persons = batch.missing, batch.person_cells
        searchers, searching = (actions == _SEARCH).nonzero()
        cells = batch.cells[searchers, searching]
        chances = batch.probabilities(searchers, cells).astype(np.float64)
        chances *= missing[searchers] @ detections

        batch.step(actions)
        found = missing & ~batch.missing
        found_at[rows] += found[rows] * step
        hits = found[searchers] & (persons[searchers] == cells[:, None])
        reliability.count(chances, hits.sum(axis=1))
        for drone in range(drones):  # in one order, however many rows there are
            returns[rows] += batch.rewards[rows, drone]
        endings[rows] = batch.endings[rows]
        steps[rows] = step
        rows = rows[endings[rows] == 0]
        report(step / limit if rows.size else 1.0)
    return Episodes(found_at, endings, steps, returns, reliability)


def _reset(policy: PolicyLike, seed: int | list[int]) -> None:
    """Tell a policy, if it wants to know, that episodes begin."""
    reset = getattr(policy, "reset", None)
    if reset is None:
        return
    try:
        inspect.signature(reset).bind(seed=seed)
    except TypeError:
        raise TypeError(
            f"the policy's reset must take seed=None and rows=None, got {reset!r}"
        ) from None
    reset(seed=seed)


# How searches are shown, and actions read.


class _Stage(Protocol):
    """Searches of a batch, as a policy is shown them."""

    @property
    def batch(self) -> SearchBatch:
        """The engine."""

    def seeds(self, seeds: Sequence[int]) -> int | list[int]:
        """What a policy's `reset` is told."""

    def observe(self, rows: Ints) -> Any:
        """What a policy is shown of some rows."""

    def read(self, actions: Any, n: int) -> Ints:
        """What it has chosen for n rows: int64, (n, n_drones)."""


def _vector_stage(search: NamedSearch, n: int, view: str, observation: str) -> _VectorStage:
    make = SwarmVectorEnv if view == "swarm" else DroneVectorEnv
    return _VectorStage(make(n, observation=observation, **search.parameters))


class _VectorStage:
    """Searches as a vector environment shows them."""

    def __init__(self, env: SwarmVectorEnv | DroneVectorEnv) -> None:
        self.batch = env.batch
        self._env = env
        self._drones = env.batch.scenario.n_drones
        self._numbers_rows = isinstance(env, SwarmVectorEnv) and env.observation == "dict"

    def seeds(self, seeds: Sequence[int]) -> list[int]:
        return list(seeds)

    def observe(self, rows: Ints) -> Any:
        shown = self._env.observe(rows)
        if self._numbers_rows:
            shown["row"] = rows.copy()
        return shown

    def read(self, actions: Any, n: int) -> Ints:
        drones = self._drones
        one_each = (n, drones) if isinstance(self._env, SwarmVectorEnv) else (n * drones,)
        what = f"actions of shape {one_each}, one for each drone of each search shown"
        try:
            chosen = np.asarray(actions)
        except ValueError:  # rows of different lengths
            raise ValueError(f"the policy must return {what}, got {actions!r}") from None
        if chosen.dtype.kind not in "iu":
            raise TypeError(f"the policy must return {_INTEGERS}, got {_briefly(actions, chosen)}")
        if chosen.shape != one_each:
            raise ValueError(f"the policy must return {what}, got shape {chosen.shape}")
        wrong = (chosen < 0) | (chosen >= len(Action))
        if wrong.any():
            raise ValueError(f"the policy must return {_INTEGERS}, got {chosen[wrong][0]}")
        return chosen.astype(np.int64).reshape(n, drones)


class _ParallelStage:
    """One search, shown as `DroneSwarmSearch` shows it."""

    def __init__(self, search: NamedSearch) -> None:
        self.batch = SearchBatch(1, **search.parameters)
        self._names = tuple(f"drone{i}" for i in range(self.batch.scenario.n_drones))
        _, self._positions = grid_of(self.batch.scenario.grid_size)

    def seeds(self, seeds: Sequence[int]) -> int:
        return seeds[0]

    def observe(self, rows: Ints) -> Any:
        matrix = self.batch.matrices_of(rows)[0]
        matrix.flags.writeable = False
        cells = self.batch.cells[0].tolist()
        return observe(self._names, cells, self._positions, matrix, False)[0]

    def read(self, actions: Any, n: int) -> Ints:
        if not isinstance(actions, Mapping):
            raise TypeError(
                f"the policy must return a mapping with an action for each drone, got {actions!r}"
            )
        if {*actions} != {*self._names}:
            raise ValueError(
                f"the policy must return an action for each of {', '.join(self._names)}, "
                f"got actions for {', '.join(map(str, actions)) or 'none'}"
            )
        return np.array(
            [
                [
                    checks.integer(f"the policy's action for {name}", actions[name], 0, _IDLE)
                    for name in self._names
                ]
            ]
        )


_INTEGERS = f"integers from 0 to {len(Action) - 1}, see rules.Action"


def _briefly(value: Any, array: NDArray[Any]) -> str:
    """What came in place of integers."""
    if isinstance(value, Mapping):
        return f'{str(value)[:200]}; from dicts to dicts is view="parallel"'
    if array.dtype == object:
        return repr(value)[:200]
    return f"{array.dtype} of shape {array.shape}"
