"""Play episodes with a policy on the batch, and record what happens.

The policy only sees the episodes that have not ended. Its actions are validated.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from DroneSwarmSearch._internal.arrays import Floats, Ints
from DroneSwarmSearch.actions import Reader, checked_actions
from DroneSwarmSearch.evaluation.episodes import Episodes, Reliability
from DroneSwarmSearch.evaluation.suite import NamedSearch
from DroneSwarmSearch.evaluation.view import View
from DroneSwarmSearch.grid import grid_of
from DroneSwarmSearch.layouts.masks import swarm_masks
from DroneSwarmSearch.observations import observe
from DroneSwarmSearch.rules import Action, RewardScheme
from DroneSwarmSearch.scenario import Scenario
from DroneSwarmSearch.vector.engine import SearchBatch
from DroneSwarmSearch.vector.observations import BatchObservations

__all__ = ["PolicyLike", "play", "reset_policy"]

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
    stage, parts = _Stage(unfound or batch, view), []
    for first in range(0, len(seeds), at_once):
        mine = seeds[first : first + at_once]
        reset_policy(policy, mine[0] if view.form == "parallel" else list(mine))
        parts.append(_play(policy, batch, unfound, stage, mine))
    return Episodes.joined(parts)


def reset_policy(policy: PolicyLike, seed: int | list[int]) -> None:
    """Call the policy's `reset`, if it has one."""
    reset = getattr(policy, "reset", None)
    if reset is not None:
        reset(seed=seed)


def _play(
    policy: PolicyLike,
    batch: SearchBatch,
    unfound: SearchBatch | None,
    stage: _Stage,
    seeds: Sequence[int],
) -> Episodes:
    """Play all episodes of a batch together."""
    batch.reset(seeds)
    if unfound is not None:
        unfound.reset(seeds)
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
        return _never_falling(self._success)


class _Recorder:
    """Records n episodes."""

    def __init__(self, scenario: Scenario, n: int) -> None:
        self._covers = scenario.mission == "coverage"
        self._detections, self._step = np.array(scenario.detections), 0
        self._found_at = np.zeros((n, len(self._detections)), np.int64)
        self._endings, self._steps = np.zeros(n, np.int64), np.zeros(n, np.int64)
        self._returns, self._reliability = np.zeros(n), Reliability.empty()
        self._success = np.zeros((n if self._covers else 0, scenario.timestep_limit + 1))
        self._searches = np.zeros(n, np.int64)
        self._searched = np.zeros((n, scenario.grid_size**2), np.bool_)

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
        self._searches += np.bincount(searchers, minlength=len(self._searches))
        self._searched[searchers, cells] = True
        if self._covers:
            success = batch.probability_of_success
            assert success is not None
            self._success[rows, self._step] = success[rows]
        else:
            found = missing & ~batch.missing
            self._found_at[rows] += found[rows] * self._step
            hits = found[searchers] & (persons[searchers] == cells[:, None])
            self._reliability.add(forecasts, hits.sum(axis=1))
        for drone in range(actions.shape[1]):  # one order of additions for any number of rows
            self._returns[rows] += batch.rewards[rows, drone]
        self._endings[rows] = batch.endings[rows]
        self._steps[rows] = self._step

    def result(self, curves: Floats | None) -> Episodes:
        """The episodes, with the curves of a rescue."""
        return Episodes(
            self._found_at,
            self._endings,
            self._steps,
            self._returns,
            self._searches,
            self._searched.sum(axis=1),
            self._reliability,
            _never_falling(self._success) if curves is None else curves,
        )


def _never_falling(success: Floats) -> Floats:
    """The probabilities of success, with the last one carried beyond the end of an episode."""
    curves: Floats = np.maximum.accumulate(success, axis=1)
    return curves


class _Stage:
    """Shows the searches of a batch to a policy, and reads its actions."""

    def __init__(self, batch: SearchBatch, view: View) -> None:
        self._batch, self._view = batch, view
        self._drones = batch.scenario.n_drones
        if view.form == "parallel":
            self._names = tuple(f"drone{i}" for i in range(self._drones))
            self._neighbours, self._positions = grid_of(batch.scenario.grid_size)
            self._reader = Reader(self._names)
        else:
            self._observations = BatchObservations(
                batch, view.observation, view.form == "swarm", TOP_CELLS, True, view.masks
            )

    def actions(self, policy: PolicyLike, rows: Ints) -> Ints:
        """The policy's validated actions in some rows: int64, (n, n_drones)."""
        is_single = self._view.form == "parallel"
        returned = policy(self._one(rows) if is_single else self._several(rows))
        try:
            return self._read_one(returned) if is_single else self._read(returned, len(rows))
        except (TypeError, ValueError) as error:
            raise type(error)(f"the policy's {error}") from None

    def _several(self, rows: Ints) -> Any:
        """The observations of the views "swarm" and "drone"."""
        shown = self._observations.of_rows(rows)
        if self._view.form == "swarm" and self._view.observation == "dict":
            entries = shown["observation"] if self._view.action_mask else shown
            entries["row"] = rows.copy()
        return shown

    def _read(self, actions: Any, n: int) -> Ints:
        if isinstance(actions, Mapping):
            raise TypeError(
                f"actions must be an array of integers, got {actions!r:.200}; "
                'a policy from dicts to dicts needs view="parallel"'
            )
        shape = (n, self._drones) if self._view.form == "swarm" else (n * self._drones,)
        return checked_actions(actions, shape, np.int64).reshape(n, self._drones)

    def _one(self, rows: Ints) -> dict[str, Any]:
        """The observations of the view "parallel", of one search."""
        matrix = self._batch.matrices_of(rows)[0]
        matrix.flags.writeable = False
        cells = self._batch.cells[0].tolist()
        shown: dict[str, Any]
        shown, _ = observe(self._names, cells, self._positions, matrix, False)
        if self._view.masks is None:
            return shown
        masks = swarm_masks(cells, self._neighbours, self._view.masks)
        return {
            name: {"observation": observation, "action_mask": mask}
            for (name, observation), mask in zip(shown.items(), masks, strict=True)
        }

    def _read_one(self, actions: Any) -> Ints:
        read, _ = self._reader(actions, self._neighbours, self._batch.cells[0].tolist())
        return np.array([[*read]])
