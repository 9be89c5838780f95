"""Play episodes with a policy on the batch, and record what happens."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.arrays import Floats, Ints
from DroneSwarmSearch._internal.cells import cell_number
from DroneSwarmSearch.core.named_search import NamedSearch
from DroneSwarmSearch.core.rules import Action, RewardScheme
from DroneSwarmSearch.core.scenario import Scenario, checked_scenario
from DroneSwarmSearch.drift.chain import fine_cells
from DroneSwarmSearch.evaluation.episodes import POS_EDGES, Episodes
from DroneSwarmSearch.evaluation.stage import PolicyLike, Stage, reset_policy
from DroneSwarmSearch.layouts.view import View
from DroneSwarmSearch.persons.tracks import Tracks
from DroneSwarmSearch.vector.engine import SearchBatch


def roll_out(
    policy: PolicyLike,
    search: NamedSearch,
    seeds: Sequence[int],
    view: View,
    *,
    wants_curves: bool = True,
) -> Episodes:
    """Play one episode for each seed, and follow its success.

    In a rescue, a second batch goes through the same episodes, in which no search finds the last
    missing person. Given the path that the drones then fly, the probability that the person is
    found within t steps is one minus the product, over these steps, of the probability that the
    step's searches do not find the person. The drones learn no more than that until the find, so
    the mean of these probabilities estimates the success without bias (conditional Monte Carlo:
    R. Y. Rubinstein and D. P. Kroese, Simulation and the Monte Carlo Method, 3rd edition, 2016,
    section 5.4). With one person, a deterministic policy flies one path, whose curve is exact.

    Args:
        policy: a callable from observations to actions.
        search: the search.
        seeds: one for each episode.
        view: what the policy sees and returns.
        wants_curves: whether to follow the success; without it, the curves of a rescue are 0.
    """
    at_once = 1 if view.form == "parallel" else len(seeds)
    batch = SearchBatch(at_once, **search.parameters)
    unfound = None
    if wants_curves and search.scenario.mission == "rescue":
        # These rewards need the beliefs; the policy does not see them.
        scenario = search.scenario.replace(reward_scheme=RewardScheme.expected())
        unfound = SearchBatch(
            at_once, scenario=scenario, drones_positions=search.drones, finds_last=False
        )
    stage = Stage(unfound or batch, view)
    parts = []
    for first in range(0, len(seeds), at_once):
        mine = seeds[first : first + at_once]
        reset_policy(policy, mine[0] if view.form == "parallel" else list(mine))
        parts.append(_rolled_out(policy, batch, unfound, stage, mine))
    return Episodes.joined(parts)


def share_found(
    tracks: Tracks,
    policy: Any,
    scenario: Scenario | None = None,
    *,
    drones_positions: object = None,
) -> float:
    """The share of some tracks that a policy or a plan finds by the time limit.

    Compare it, for tracks that were held out from the fit, with the success that is promised.

    Args:
        tracks: at least as many steps as the scenario has.
        policy: a policy for `scenario`, or a plan, the actions of all drones: integers of shape
            (steps, n_drones).
        scenario: of one person; by default the policy's.
        drones_positions: as for `DroneSwarmSearch.reset`.
    """
    search = checked_scenario(scenario or getattr(policy, "scenario", None))
    missed = tracks.weights.copy()
    size = search.grid_size
    for step, cells in enumerate(_searches_of(policy, search, drones_positions)):
        x, y = fine_cells(tracks.positions[min(step, tracks.steps)], size, 1)
        missed[np.isin(cell_number(x, y, size), cells)] *= 1.0 - search.detections[0]
    return 1.0 - float(missed.sum())


def _searches_of(policy: Any, scenario: Scenario, drones_positions: Any) -> Iterator[Ints]:
    """The cells that a policy, or the actions of a plan, (steps, n), search in each step.

    Nobody is found on the way. The policy sees what `DroneSwarmSearch` shows.
    """
    if len(scenario.persons_to_find) > 1:
        raise ValueError(f"scenario must have one person, got {len(scenario.persons_to_find)}")
    plan = None if callable(policy) else checks.numbers("policy", policy, "a policy or a plan")
    batch = SearchBatch(1, scenario=scenario, drones_positions=drones_positions, finds_last=False)
    stage = Stage(batch, View(form="parallel"))
    steps = scenario.timestep_limit
    rows = np.arange(1)
    batch.reset([0])
    if plan is None:
        reset_policy(policy, 0)
    for step in range(steps if plan is None else min(steps, len(plan))):
        actions = stage.actions(policy, rows) if plan is None else plan[step][None]
        batch.step(actions)
        yield batch.cells[batch.searching]
        if batch.endings[0]:
            return


def _rolled_out(
    policy: PolicyLike,
    batch: SearchBatch,
    unfound: SearchBatch | None,
    stage: Stage,
    seeds: Sequence[int],
) -> Episodes:
    batch.reset(seeds)
    record = _Recorder(batch)
    played: list[_Recorder | _Follower] = [record]
    if unfound is not None:
        unfound.reset(seeds)
        played.append(_Follower(unfound, record.episodes.curves))
    while True:
        rows = np.any([player.goes_on for player in played], axis=0).nonzero()[0]
        if not rows.size:
            break
        actions = np.full(batch.cells.shape, int(Action.IDLE))
        actions[rows] = stage.actions(policy, rows)
        for player in played:
            player.step(actions)
    curves = record.episodes.curves
    np.maximum.accumulate(curves, axis=1, out=curves)  # each stays as it is after the end
    record.episodes.cells_searched[:] = record.searched.sum(axis=1)
    return record.episodes


class _Recorder:
    def __init__(self, batch: SearchBatch) -> None:
        scenario = batch.scenario_of(0)
        n = batch.num_rows
        self._batch = batch
        self._detections = np.array(scenario.detections)
        self._covers = scenario.mission == "coverage"
        self.episodes = Episodes.empty(n, len(scenario.detections), scenario.timestep_limit)
        self.searched = np.zeros((n, scenario.grid_size**2), np.bool_)
        self.goes_on = np.ones(n, np.bool_)

    def step(self, actions: Ints) -> None:
        """Take a step in the episodes that go on."""
        batch = self._batch
        episodes = self.episodes
        rows = self.goes_on.nonzero()[0]
        if not rows.size:
            return
        episodes.steps[rows] += 1
        missing = batch.missing
        persons = batch.person_cells
        mine = np.where(self.goes_on[:, None], actions, int(Action.IDLE))
        searchers, cells = batch.searches_of(mine)
        going = self.goes_on[searchers]
        searchers = searchers[going]
        cells = cells[going]
        forecasts = batch.probabilities(searchers, cells).astype(np.float64)
        forecasts *= missing[searchers] @ self._detections

        batch.step(mine)
        n = len(actions)
        episodes.searches[:] += np.bincount(searchers, minlength=n)
        self.searched[searchers, cells] = True
        if self._covers:
            success = batch.probability_of_success
            assert success is not None
            episodes.curves[rows, episodes.steps[rows]] = success[rows]
        else:
            found = missing & ~batch.missing
            episodes.found_at[rows] += found[rows] * episodes.steps[rows, None]
            hits = (found[searchers] & (persons[searchers] == cells[:, None])).sum(axis=1)
            bins = len(POS_EDGES) - 1
            at = searchers * bins + np.searchsorted(POS_EDGES, forecasts, side="right") - 1
            for kind, values in enumerate((None, forecasts, hits)):
                added = np.bincount(at, values, n * bins)
                episodes.forecasts[:, kind] += added.reshape(n, bins)
        for drone in range(actions.shape[1]):  # one order of additions for any number of rows
            episodes.returns[rows] += batch.rewards[rows, drone]
        episodes.endings[rows] = batch.endings[rows]
        self.goes_on &= batch.endings == 0


class _Follower:
    """Writes the probability of success by step in a batch whose last persons are not found."""

    def __init__(self, batch: SearchBatch, curves: Floats) -> None:
        self._batch = batch
        self._curves = curves
        self._step = 0
        # The last person's probability of failure, before being the last.
        self._before = np.ones(batch.num_rows)
        self._was_last = batch.missing.sum(axis=1) == 1
        self.goes_on = np.ones(batch.num_rows, np.bool_)

    def step(self, actions: Ints) -> None:
        """Take a step with the rows that go on."""
        self._batch.step(actions)
        self._step += 1
        missing = self._batch.missing
        failure = self._batch.probability_of_failure
        assert failure is not None
        count = missing.sum(axis=1)
        now = failure[np.arange(len(missing)), missing.argmax(axis=1)]
        is_last = count == 1
        self._before = np.where(is_last & ~self._was_last, now, self._before)
        self._was_last = is_last
        missed = np.ones(len(missing))
        np.divide(now, self._before, out=missed, where=is_last & (self._before > 0.0))
        success = np.where(count == 0, 1.0, 1.0 - missed)
        self._curves[self.goes_on, self._step] = success[self.goes_on]
        self.goes_on &= (self._batch.endings == 0) & (success < 1.0)
