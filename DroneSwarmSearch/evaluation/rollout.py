"""Play episodes with a policy on the batch, and record what happens.

The policy only sees the episodes that have not ended. Its actions are validated.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch._internal.actions import Reader, checked_actions
from DroneSwarmSearch._internal.grid import grid_of
from DroneSwarmSearch.evaluation.episodes import Coverage, Episodes, Reliability
from DroneSwarmSearch.evaluation.suite import NamedSearch
from DroneSwarmSearch.evaluation.view import View
from DroneSwarmSearch.layouts.masks import swarm_masks
from DroneSwarmSearch.observations import observe
from DroneSwarmSearch.rules import Action, RewardScheme
from DroneSwarmSearch.scenario import Scenario
from DroneSwarmSearch.vector.engine import SearchBatch
from DroneSwarmSearch.vector.observations import BatchObservations

__all__ = ["PolicyLike", "Stage", "play", "reset_policy", "stage_of"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
PolicyLike = Callable[[Any], Any]

TOP_CELLS = 8
"""Cells in the layout "top-cells", as the vector environments show them by default."""


def play(
    policy: PolicyLike,
    search: NamedSearch,
    seeds: Sequence[int],
    view: View,
    wants_curves: bool = True,
) -> Episodes:
    """Play one episode for each seed, and follow its success.

    In a rescue, a second batch goes through the same episodes, in which no search finds the last
    missing person. Given the path that the drones then fly, the probability that the person is
    found within t steps is one minus the product, over these steps, of the probability that the
    step's searches do not find the person. Until that find, the drones only learn that the person
    was not found, so the mean of these probabilities estimates the success without bias, with a
    variance never above that of the share of successes (conditional Monte Carlo: R. Y. Rubinstein
    and D. P. Kroese, Simulation and the Monte Carlo Method, 3rd edition, 2016, section 5.4). With
    one person, a policy that is deterministic in what it observes flies one path, whose curve is
    exact.

    Args:
        policy: a callable from observations to actions. Its method `reset`, if it has one,
            receives the seeds before the episodes begin.
        search: the search.
        seeds: of the episodes, integers >= 0.
        view: what the policy sees and returns.
        wants_curves: whether to follow the success of a rescue.

    Raises:
        TypeError: the policy returns a wrong type.
        ValueError: the policy returns actions out of range or of a wrong shape.
    """
    at_once = 1 if view.form == "parallel" else len(seeds)
    batch, unfound = SearchBatch(at_once, **search.parameters), None
    if wants_curves and search.scenario.mission == "rescue":
        # These rewards need the beliefs; the policy does not see them.
        scenario = search.scenario.replace(reward_scheme=RewardScheme.expected())
        unfound = SearchBatch(
            at_once, scenario=scenario, drones_positions=search.drones, finds_last=False
        )
    stage = stage_of(unfound or batch, view)
    return Episodes.joined(
        [
            _play(policy, batch, unfound, stage, seeds[first : first + at_once])
            for first in range(0, len(seeds), at_once)
        ]
    )


def _play(
    policy: PolicyLike,
    batch: SearchBatch,
    unfound: SearchBatch | None,
    stage: Stage,
    seeds: Sequence[int],
) -> Episodes:
    """Play all episodes of a batch together."""
    batch.reset(seeds)
    if unfound is not None:
        unfound.reset(seeds)
    reset_policy(policy, stage.seeds(seeds))
    record = _Recorder(batch.scenario, len(seeds))
    curves = None if unfound is None else _Curves(unfound)
    going_on = np.ones(len(seeds), np.bool_)
    followed = np.full(len(seeds), curves is not None)
    while (rows := (going_on | followed).nonzero()[0]).size:
        actions = np.full(batch.cells.shape, int(Action.IDLE))
        actions[rows] = stage.actions(policy, rows)
        if going_on.any():
            record.step(batch, actions, going_on.nonzero()[0])
            going_on &= batch.endings == 0
        if unfound is not None and curves is not None:
            unfound.step(actions)
            curves.step(followed.nonzero()[0])
            followed &= curves.goes_on
    return record.result(None if curves is None else curves.success)


class _Curves:
    """The probability of success of each row of a batch whose last persons are not found."""

    def __init__(self, batch: SearchBatch) -> None:
        self._batch, self._step = batch, 0
        self._success = np.zeros((batch.num_rows, batch.scenario.timestep_limit + 1))
        # The last person's probability of failure, before being the last.
        self._before = np.ones(batch.num_rows)
        self._was_last = batch.missing.sum(axis=1) == 1
        self.goes_on = np.ones(batch.num_rows, np.bool_)

    def step(self, rows: Ints) -> None:
        """Add a step that some rows took."""
        self._step += 1
        missing, failure = self._batch.missing[rows], self._batch.probability_of_failure
        assert failure is not None
        count, now = missing.sum(axis=1), failure[rows, missing.argmax(axis=1)]
        is_last = count == 1
        new = is_last & ~self._was_last[rows]
        self._before[rows[new]] = now[new]
        self._was_last[rows] = is_last
        before, missed = self._before[rows], np.ones(len(rows))
        np.divide(now, before, out=missed, where=is_last & (before > 0.0))
        self._success[rows, self._step] = np.where(count == 0, 1.0, 1.0 - missed)
        self.goes_on = (self._batch.endings == 0) & (self._success[:, self._step] < 1.0)

    @property
    def success(self) -> Floats:
        """After each number of steps: float64, (rows, L + 1); it stays as it is after the end."""
        return np.maximum.accumulate(self._success, axis=1)


class _Recorder:
    """Records n episodes."""

    def __init__(self, scenario: Scenario, n: int) -> None:
        self._detections, self._step = np.array(scenario.detections), 0
        self._found_at = np.zeros((n, len(self._detections)), np.int64)
        self._endings, self._steps = np.zeros(n, np.int64), np.zeros(n, np.int64)
        self._returns, self._reliability = np.zeros(n), Reliability.empty()
        self._covers = scenario.mission == "coverage"
        self._success = np.zeros((n if self._covers else 0, scenario.timestep_limit + 1))
        self._searches = np.zeros(n, np.int64)
        self._searched = np.zeros((n, scenario.grid_size**2 if self._covers else 0), np.bool_)

    def step(self, batch: SearchBatch, actions: Ints, rows: Ints) -> None:
        """Take a step with the batch; record it for the rows whose episodes go on."""
        self._step += 1
        missing, persons = batch.missing, batch.person_cells
        mine = np.full(actions.shape, int(Action.IDLE))
        mine[rows] = actions[rows]
        searchers, drones = (mine == int(Action.SEARCH)).nonzero()
        cells = batch.cells[searchers, drones]
        forecasts = batch.probabilities(searchers, cells).astype(np.float64)
        forecasts *= missing[searchers] @ self._detections

        batch.step(mine)
        if self._covers:
            success = batch.probability_of_success
            assert success is not None
            self._success[rows, self._step] = success[rows]
            self._searches += np.bincount(searchers, minlength=len(self._searches))
            self._searched[searchers, cells] = True
        else:
            found = missing & ~batch.missing
            self._found_at[rows] += found[rows] * self._step
            hits = found[searchers] & (persons[searchers] == cells[:, None])
            self._reliability.count(forecasts, hits.sum(axis=1))
        for drone in range(
            batch.scenario.n_drones
        ):  # one order of additions for any number of rows
            self._returns[rows] += batch.rewards[rows, drone]
        self._endings[rows] = batch.endings[rows]
        self._steps[rows] = self._step

    def result(self, curves: Floats | None) -> Episodes:
        """The episodes, with the curves of a rescue."""
        coverage = None
        if self._covers:
            # The probability never falls, so the last one is carried beyond the end of an episode.
            curves = np.maximum.accumulate(self._success, axis=1)
            coverage = Coverage(self._searches, self._searched.sum(axis=1))
        return Episodes(
            self._found_at,
            self._endings,
            self._steps,
            self._returns,
            self._reliability,
            curves,
            coverage,
        )


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


class Stage(Protocol):
    """Shows searches to a policy in one of the views, and reads its actions."""

    def seeds(self, seeds: Sequence[int]) -> int | list[int]:
        """The argument for the policy's `reset`."""

    def actions(self, policy: PolicyLike, rows: Ints) -> Ints:
        """The policy's validated actions in some rows: int64, (n, n_drones)."""


def stage_of(batch: SearchBatch, view: View) -> Stage:
    """The stage for a view; "parallel" has one search."""
    return _ParallelStage(batch, view) if view.form == "parallel" else _VectorStage(batch, view)


def _validated(read: Callable[[Any], Ints], returned: Any) -> Ints:
    """The actions that a policy returned; errors name the policy."""
    try:
        return read(returned)
    except (TypeError, ValueError) as error:
        raise type(error)(f"the policy's {error}") from None


class _VectorStage:
    """The views "swarm" and "drone"."""

    def __init__(self, batch: SearchBatch, view: View) -> None:
        self._is_swarm = view.form == "swarm"
        self._observations = BatchObservations(
            batch, view.observation, self._is_swarm, TOP_CELLS, True, view.masks
        )
        self._is_masked = view.action_mask
        self._drones = batch.scenario.n_drones
        self._shows_rows = self._is_swarm and view.observation == "dict"

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

    def __init__(self, batch: SearchBatch, view: View) -> None:
        self._batch = batch
        self._masks = view.masks
        self._names = tuple(f"drone{i}" for i in range(batch.scenario.n_drones))
        self._neighbours, self._positions = grid_of(batch.scenario.grid_size)
        self._reader = Reader(self._names)

    def seeds(self, seeds: Sequence[int]) -> int:
        return seeds[0]

    def actions(self, policy: PolicyLike, rows: Ints) -> Ints:
        matrix = self._batch.matrices_of(rows)[0]
        matrix.flags.writeable = False
        cells = self._batch.cells[0].tolist()
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
