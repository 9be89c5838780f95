"""Play episodes with a policy on the batch, and record what happens.

The policy only sees the episodes that have not ended. Its actions are validated.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol, cast

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.actions import Reader, checked_actions
from DroneSwarmSearch._internal.grid import grid_of
from DroneSwarmSearch.evaluation.episodes import Coverage, Episodes, Reliability
from DroneSwarmSearch.evaluation.suite import NamedSearch
from DroneSwarmSearch.evaluation.workers import Report
from DroneSwarmSearch.observations import observe
from DroneSwarmSearch.rules import Action
from DroneSwarmSearch.scenario import Cell, Scenario
from DroneSwarmSearch.vector.engine import SearchBatch
from DroneSwarmSearch.vector.observations import BatchObservations
from DroneSwarmSearch.wrappers.layouts import LAYOUTS
from DroneSwarmSearch.wrappers.masks import swarm_masks

__all__ = [
    "VIEWS",
    "Searches",
    "Stage",
    "checked_masks",
    "checked_view",
    "play",
    "prepare_policy",
    "reset_policy",
    "stage_of",
]

Ints = NDArray[np.int64]
PolicyLike = Callable[[Any], Any]

VIEWS = ("swarm", "drone", "parallel")

TOP_CELLS = 8
"""Cells in the layout "top-cells", as the vector environments show them by default."""

_SEARCH, _IDLE = int(Action.SEARCH), int(Action.IDLE)


def checked_view(view: object, observation: object) -> tuple[str, str]:
    """Validate a view and an observation layout.

    Raises:
        TypeError: one of them is not a string.
        ValueError: one of them is unknown, or they cannot be combined.
    """
    view = checks.choice("view", view, VIEWS)
    observation = checks.choice("observation", observation, tuple(LAYOUTS))
    if view == "parallel" and observation != "dict":
        raise ValueError(f"view='parallel' needs observation='dict', got {observation!r}")
    return str(view), str(observation)


def checked_masks(action_mask: object, right_of_way: object) -> bool | None:
    """Whether the masks that a policy gets have right of way, or None if it gets none.

    Raises:
        TypeError: one of them is not a bool.
        ValueError: right of way is wanted without masks.
    """
    has_way = checks.boolean("right_of_way", right_of_way)
    if checks.boolean("action_mask", action_mask):
        return has_way
    if has_way:
        raise ValueError("right_of_way=True needs action_mask=True, got action_mask=False")
    return None


def play(
    policy: PolicyLike,
    search: NamedSearch,
    seeds: Sequence[int],
    view: str = "swarm",
    observation: str = "dict",
    report: Report = lambda share: None,
    masks: bool | None = None,
) -> Episodes:
    """Play one episode for each seed.

    Args:
        policy: a callable from observations to actions. Its method `reset`, if it has one,
            receives the seeds before the episodes begin.
        search: the search.
        seeds: of the episodes, integers >= 0.
        view: what the policy sees and returns, see `evaluate`; validated.
        observation: the layout of its observations.
        report: called with the share of the work done.
        masks: whether the masks that it gets have right of way; None for no masks.

    Raises:
        TypeError: the policy returns a wrong type.
        ValueError: the policy returns actions out of range or of a wrong shape.
    """
    if view != "parallel":
        batch = SearchBatch(len(seeds), **search.parameters)
        return _play(policy, batch, stage_of(batch, view, observation, masks), seeds, report)
    batch = SearchBatch(1, **search.parameters)
    stage, parts = stage_of(batch, view, observation, masks), []
    for done, seed in enumerate(seeds, 1):
        parts.append(_play(policy, batch, stage, [seed], lambda share: None))
        report(done / len(seeds))
    return Episodes.joined(parts)


def _play(
    policy: PolicyLike,
    batch: SearchBatch,
    stage: Stage,
    seeds: Sequence[int],
    report: Report,
) -> Episodes:
    """Play all episodes of a batch together."""
    scenario = batch.scenario
    limit, detections = scenario.timestep_limit, np.array(scenario.detections)
    batch.reset(seeds)
    reset_policy(policy, stage.seeds(seeds))
    n, drones = len(seeds), scenario.n_drones
    found_at = np.zeros((n, len(detections)), np.int64)
    endings, steps, returns = np.zeros(n, np.int64), np.zeros(n, np.int64), np.zeros(n)
    reliability = Reliability.empty()
    coverage = _CoverageRecorder(scenario, n) if scenario.mission == "coverage" else None
    rows, step = np.arange(n), 0
    while rows.size:
        step += 1
        actions = np.full((n, drones), _IDLE)
        actions[rows] = stage.actions(policy, rows)

        missing, persons = batch.missing, batch.person_cells
        searchers, searching = (actions == _SEARCH).nonzero()
        cells = batch.cells[searchers, searching]
        forecasts = batch.probabilities(searchers, cells).astype(np.float64)
        forecasts *= missing[searchers] @ detections

        batch.step(actions)
        if coverage is None:
            found = missing & ~batch.missing
            found_at[rows] += found[rows] * step
            hits = found[searchers] & (persons[searchers] == cells[:, None])
            reliability.count(forecasts, hits.sum(axis=1))
        else:
            coverage.add(batch, step, rows, searchers, cells)
        for drone in range(drones):  # one order of additions for any number of rows
            returns[rows] += batch.rewards[rows, drone]
        endings[rows] = batch.endings[rows]
        steps[rows] = step
        rows = rows[endings[rows] == 0]
        report(step / limit if rows.size else 1.0)
    covered = None if coverage is None else coverage.result()
    return Episodes(found_at, endings, steps, returns, reliability, covered)


class _CoverageRecorder:
    """Records what the searches of n coverage missions cover."""

    def __init__(self, scenario: Scenario, n: int) -> None:
        self._success = np.zeros((n, scenario.timestep_limit + 1))
        self._searches = np.zeros(n, np.int64)
        self._searched = np.zeros((n, scenario.grid_size**2), np.bool_)

    def add(self, batch: SearchBatch, step: int, rows: Ints, searchers: Ints, cells: Ints) -> None:
        """Add a step: the rows that took it, and the row and the cell of every search."""
        success = batch.probability_of_success
        assert success is not None
        self._success[rows, step] = success[rows]
        self._searches += np.bincount(searchers, minlength=len(self._searches))
        self._searched[searchers, cells] = True

    def result(self) -> Coverage:
        # The probability never falls, so the last one is carried beyond the end of an episode.
        success = np.maximum.accumulate(self._success, axis=1)
        return Coverage(success, self._searches, self._searched.sum(axis=1))


def prepare_policy(policy: PolicyLike, drones: Sequence[Cell], report: Report) -> None:
    """Call the policy's `prepare`, if it has one.

    Args:
        policy: the policy.
        drones: every drone's start cell (x, y).
        report: passed on, if `prepare` has a parameter of that name.
    """
    prepare = getattr(policy, "prepare", None)
    if prepare is None:
        return
    if "report" in inspect.signature(prepare).parameters:
        prepare(drones, report=report)
    else:
        prepare(drones)


def reset_policy(policy: PolicyLike, seed: int | list[int]) -> None:
    """Call the policy's `reset`, if it has one.

    Raises:
        TypeError: it does not take a seed.
    """
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


# Observations and actions of each view.


class Searches(Protocol):
    """What the drones of some searches observe; a `SearchBatch` has it."""

    @property
    def num_rows(self) -> int: ...
    @property
    def scenario(self) -> Scenario: ...
    @property
    def cells(self) -> Ints: ...
    @property
    def positions(self) -> NDArray[np.int32]: ...
    @property
    def steps(self) -> Ints: ...
    def scenario_of(self, row: int) -> Scenario: ...
    def matrices_of(self, rows: Ints) -> NDArray[np.float32]: ...


class Stage(Protocol):
    """Shows searches to a policy in one of the views, and reads its actions."""

    def seeds(self, seeds: Sequence[int]) -> int | list[int]:
        """The argument for the policy's `reset`."""

    def actions(self, policy: PolicyLike, rows: Ints) -> Ints:
        """The policy's validated actions in some rows: int64, (n, n_drones)."""


def stage_of(searches: Searches, view: str, observation: str, masks: bool | None = None) -> Stage:
    """The stage for a view and a layout; "parallel" has one search. Masks as for `play`."""
    if view == "parallel":
        return _ParallelStage(searches, masks)
    return _VectorStage(searches, view, observation, masks)


def _validated(read: Callable[[Any], Ints], returned: Any) -> Ints:
    """The actions that a policy returned; errors name the policy."""
    try:
        return read(returned)
    except (TypeError, ValueError) as error:
        raise type(error)(f"the policy's {error}") from None


class _VectorStage:
    """The views "swarm" and "drone"."""

    def __init__(self, searches: Searches, view: str, observation: str, masks: bool | None) -> None:
        self._is_swarm = view == "swarm"
        # It only reads what `Searches` has.
        batch = cast("SearchBatch", searches)
        self._observations = BatchObservations(
            batch, observation, self._is_swarm, TOP_CELLS, True, masks
        )
        self._is_masked = masks is not None
        self._drones = searches.scenario.n_drones
        self._shows_rows = self._is_swarm and observation == "dict"

    def seeds(self, seeds: Sequence[int]) -> list[int]:
        return list(seeds)

    def actions(self, policy: PolicyLike, rows: Ints) -> Ints:
        shown = self._observations.of_rows(rows)
        if self._shows_rows:
            entries = shown["observation"] if self._is_masked else shown
            entries["row"] = rows.copy()
        return _validated(lambda returned: self._read(returned, len(rows)), policy(shown))

    def _read(self, actions: Any, n: int) -> Ints:
        if isinstance(actions, Mapping):
            raise TypeError(
                f"actions must be an array of integers, got {actions!r:.200}; "
                'a policy from dicts to dicts needs view="parallel"'
            )
        shape = (n, self._drones) if self._is_swarm else (n * self._drones,)
        return checked_actions(actions, shape, np.int64).reshape(n, self._drones)


class _ParallelStage:
    """The view "parallel", of one episode at a time."""

    def __init__(self, searches: Searches, masks: bool | None) -> None:
        self._searches = searches
        self._masks = masks
        self._names = tuple(f"drone{i}" for i in range(searches.scenario.n_drones))
        self._neighbours, self._positions = grid_of(searches.scenario.grid_size)
        self._reader = Reader(self._names)

    def seeds(self, seeds: Sequence[int]) -> int:
        return seeds[0]

    def actions(self, policy: PolicyLike, rows: Ints) -> Ints:
        matrix = self._searches.matrices_of(rows)[0]
        matrix.flags.writeable = False
        cells = self._searches.cells[0].tolist()
        shown: dict[str, Any]
        shown, _ = observe(self._names, cells, self._positions, matrix, False)
        if self._masks is not None:
            masks = swarm_masks(cells, self._neighbours, self._masks)
            shown = {
                name: {"observation": observation, "action_mask": mask}
                for (name, observation), mask in zip(shown.items(), masks, strict=True)
            }
        return _validated(lambda returned: self._read(returned, cells), policy(shown))

    def _read(self, actions: Any, cells: list[int]) -> Ints:
        read, _ = self._reader(actions, self._neighbours, cells)
        return np.array([[*read]])
