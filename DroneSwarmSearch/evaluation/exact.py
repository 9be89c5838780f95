"""The exact success of a deterministic policy, from episodes without chance finds.

Until the first find, the drones only learn that nobody was found, so a policy that is
deterministic in what it observes flies one path. With one person, success within t steps is
therefore one minus the product, over these steps, of the probability that the step's searches do
not find the person (`drift.belief`), and one episode without a find gives all of it.

With two persons, the same episode gives the probability of every first find: of each person, in
each step. After it, the policy flies one path for the other person, which another episode
gives. The sum over all first finds is exact: the law of total probability.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch._internal.grid import grid_of
from DroneSwarmSearch.evaluation.rollout import PolicyLike, reset_policy, stage_of
from DroneSwarmSearch.evaluation.suite import NamedSearch
from DroneSwarmSearch.evaluation.workers import Report
from DroneSwarmSearch.policies.belief_tracker import BeliefTracker
from DroneSwarmSearch.rules import OFF_GRID, Action, same_cell
from DroneSwarmSearch.scenario import Scenario

__all__ = ["can_be_exact", "exact_success"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

MOST_FIRST_FINDS = 1000
"""The most first finds to enumerate: two persons and 500 steps. Beyond that, sampling is faster."""

TOGETHER = 64
"""The most episodes that are played together, which bounds their memory."""

NEGLIGIBLE = 1e-15
"""A search ends when the probability that anybody is still to be found is not above this."""

_NEVER = (0, 0)
"""A first find that does not occur; see `_Branches`."""


def can_be_exact(scenario: Scenario) -> bool:
    """Whether the success of a deterministic policy can be computed by `exact_success`."""
    persons = len(scenario.situation)
    enumerable = persons == 2 and persons * scenario.timestep_limit <= MOST_FIRST_FINDS
    return scenario.mission == "rescue" and (persons == 1 or enumerable)


def exact_success(
    policy: PolicyLike,
    search: NamedSearch,
    view: str = "swarm",
    observation: str = "dict",
    report: Report = lambda share: None,
    masks: bool | None = None,
) -> Floats:
    """The probability that every person is found within t steps, t = 0..L: float64, (L + 1,).

    Args:
        policy: a callable from observations to actions that depend on nothing but what it has
            observed since the episode began. Its method `reset`, if it has one, is called before.
        search: a search that `can_be_exact`.
        view: what the policy sees and returns, see `evaluate`; validated.
        observation: the layout of its observations.
        report: called with the share of the work done.
        masks: whether the masks that it gets have right of way; None for no masks.

    Raises:
        TypeError: the policy returns a wrong type.
        ValueError: the policy acts differently after the same observations, or returns actions out
            of range or of a wrong shape.
    """
    at_once = 1 if view == "parallel" else TOGETHER

    def played(finds: Sequence[tuple[int, int]], seed: int = 0) -> Iterator[Floats]:
        """The chances of the branches with these first finds, see `_Branches`."""
        for first in range(0, len(finds), at_once):
            branches = _Branches(search, finds[first : first + at_once])
            yield from branches.play(policy, view, observation, seed, masks)

    limit, persons = search.scenario.timestep_limit, len(search.scenario.situation)
    # One after the other and with different seeds, so that a policy cannot give both the same
    # random actions.
    trunk, twin = (next(played([_NEVER], seed)) for seed in range(2))
    _check_equal(trunk, twin)
    found_in = np.zeros(limit + 1)  # the probability that the last find is in this step
    before = np.concatenate([[1.0], np.cumprod((1.0 - trunk).prod(axis=1))])  # nobody found yet
    found_in[1:] = before[:-1] * trunk.prod(axis=1)
    if persons == 2:
        weights = before[:-1, None] * trunk * (1.0 - trunk[:, ::-1])  # of each first find
        finds = [(step + 1, person) for step, person in np.argwhere(weights > 0.0).tolist()]
        for done, ((step, person), chances) in enumerate(zip(finds, played(finds), strict=True), 1):
            _check_equal(trunk[:step], chances[:step])
            of_other = chances[step:, 1 - person]
            missing = np.concatenate([[1.0], np.cumprod(1.0 - of_other)])
            found_in[step + 1 :] += weights[step - 1, person] * missing[:-1] * of_other
            report(done / len(finds))
    report(1.0)
    return np.minimum(np.cumsum(found_in), 1.0)


def _check_equal(first: NDArray[Any], second: NDArray[Any]) -> None:
    """Raise unless the policy acted in the same way after the same observations."""
    if not np.array_equal(first, second):
        raise ValueError(
            "deterministic must be False for a policy that acts differently after the same "
            "observations"
        )


class _Branches:
    """Searches in which nobody is found by chance, but each has a given first find.

    Searches without a find so far are in the same state, and share one `BeliefTracker`.

    Args:
        search: the search.
        finds: of each search, the step of the first find, from 1, and the person; step 0 for none.
    """

    def __init__(self, search: NamedSearch, finds: Sequence[tuple[int, int]]) -> None:
        scenario = search.scenario
        self._scenario, self._finds = scenario, finds
        self._neighbours, self._positions = grid_of(scenario.grid_size)
        starts = scenario.drone_cells(search.drones)
        self._trackers = [BeliefTracker(scenario)] * len(finds)
        self._cells = np.tile(np.array(starts), (len(finds), 1))
        # The probability that no search since the given find has found anybody.
        self._kept = np.ones(len(finds))

    # What the policy observes, see `rollout.Searches`.

    @property
    def num_rows(self) -> int:
        return len(self._finds)

    @property
    def scenario(self) -> Scenario:
        return self._scenario

    def scenario_of(self, row: int) -> Scenario:
        return self._scenario

    @property
    def cells(self) -> Ints:
        return self._cells

    @property
    def positions(self) -> NDArray[np.int32]:
        y, x = np.divmod(self._cells, self._scenario.grid_size)
        return np.stack([x, y], axis=-1).astype(np.int32)

    @property
    def steps(self) -> Ints:
        return np.array([tracker.step for tracker in self._trackers])

    def matrices_of(self, rows: Ints) -> NDArray[np.float32]:
        shown = {id(tracker): tracker for tracker in (self._trackers[row] for row in rows)}
        matrices = {key: tracker.matrix() for key, tracker in shown.items()}
        return np.array([matrices[id(self._trackers[row])] for row in rows])

    def play(
        self, policy: PolicyLike, view: str, observation: str, seed: int, masks: bool | None
    ) -> Floats:
        """Play every search until drones crash, nobody is left to find, or the time limit.

        Args:
            policy: as for `exact_success`.
            view: as for `exact_success`.
            observation: as for `exact_success`.
            seed: for the policy, of the first search.
            masks: as for `exact_success`.

        Returns:
            The probability that each step's searches find each person who is still missing:
            float64, shape (searches, L, persons); 0 for the others, and after a crash.
        """
        limit, persons = self._scenario.timestep_limit, len(self._scenario.situation)
        chances = np.zeros((self.num_rows, limit, persons))
        stage = stage_of(self, view, observation, masks)
        reset_policy(policy, stage.seeds(range(seed, seed + self.num_rows)))
        rows = np.arange(self.num_rows)
        for step in range(limit):
            actions = stage.actions(policy, rows)
            going_on = []
            for places in self._in_the_same_state(rows):
                here, first = rows[places], actions[places[0]]
                _check_equal(actions[places], np.tile(first, (len(here), 1)))
                chances[here, step] = now = self._chances(here[0], first)
                self._kept[here] *= np.prod(1.0 - np.array(now))
                if self._advance(here, first):
                    going_on.append(here[self._kept[here] > NEGLIGIBLE])
            rows = np.sort(np.concatenate([rows[:0], *going_on]))
            if not rows.size:
                break
        return chances

    def _in_the_same_state(self, rows: Ints) -> list[Ints]:
        """The places of the rows that share a tracker, for each tracker."""
        places: dict[int, list[int]] = {}
        for place, row in enumerate(rows.tolist()):
            places.setdefault(id(self._trackers[row]), []).append(place)
        return [np.array(each) for each in places.values()]

    def _chances(self, row: int, actions: Ints) -> list[float]:
        """The probability that a step's searches find each person."""
        searched = self._cells[row][actions == Action.SEARCH]
        tracker = self._trackers[row]
        chances = [0.0] * len(self._scenario.situation)
        for person in tracker.missing:
            chances[person] = tracker.chance_of_find(person, searched)
        return chances

    def _advance(self, rows: Ints, actions: Ints) -> bool:
        """Advance searches in the same state by a step; whether they go on."""
        tracker = self._trackers[rows[0]]
        cells = self._cells[rows[0]].tolist()
        tracker.update([self._positions[cell] for cell in cells], actions.tolist())
        for row in rows.tolist():
            step, person = self._finds[row]
            if step == tracker.step:
                self._kept[row] = 1.0
                self._trackers[row] = branch = copy.deepcopy(tracker)
                branch.missing = tuple(each for each in tracker.missing if each != person)
        targets = [
            self._neighbours[cell][action]
            for cell, action in zip(cells, actions.tolist(), strict=True)
        ]
        if OFF_GRID in targets or same_cell(targets):
            return False
        self._cells[rows] = targets
        return True
