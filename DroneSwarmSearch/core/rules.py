"""The rules of the search: actions, rewards and endings.

A drone's reward in a step is given by the first line that applies (t: steps completed before
this one; L: timestep_limit; p: what the matrix that it observed holds for its cell):

| event                                               | reward                          |
|-----------------------------------------------------|---------------------------------|
| it collided                                         | -100000                         |
| it left the grid                                    | -100000                         |
| it searched and found a person                      | 10000 + 10000 (1 - t/L)         |
| time limit, and it has found nobody in this episode | -(its return so far) - 100000   |
| it searched and found nobody                        | 10000 p if 100 p > 1, else -100 |
| anything else                                       | 1                               |

With `RewardScheme.expected_finds`, a search pays `find` times the probability of success (POS)
that it adds, and times the probability that the person is alive (`Person.survival`), whether or not
it finds a person, and the line on the time limit does not apply.

All drones act at once, so a search counts even if another drone flies into the searcher: the
person is found, although the searcher gets the reward of the collision.

The episode ends for all drones together if drones collide, a drone leaves the grid or all
persons are found, and with step number L. In the coverage mission nobody is found. The line on
the time limit does not apply, and the episode also ends once less than 1% is left to find.

That is `crash="end"`. With "block", a drone that would leave the grid or enter a taken cell stays
where it is; lower numbers go first. With "pass", only the border blocks: drones fly at different
heights, and may share a cell. A blocked move is rewarded as "anything else".

With `search_in_flight`, every drone searches in every step the cell in which it is after its
action, so "it searched" applies to all drones.

Each rule has a scalar form, for one search, and beside it an array form, for many.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, fields
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.arrays import Flags, Floats, Ints
from DroneSwarmSearch.core.grid import OFF_GRID


class Action(IntEnum):
    """The actions of a drone, the moves first; y grows downward, so UP is towards row 0."""

    LEFT = 0
    RIGHT = 1
    UP = 2
    DOWN = 3
    SEARCH = 4
    IDLE = 5


class Ending(IntEnum):
    """Why an episode ended. Arrays hold the numbers; 0 stands for a running episode."""

    FOUND = 1
    COLLISION = 2
    LEFT_GRID = 3
    TIME_LIMIT = 4
    COVERED = 5

    @property
    def description(self) -> str:
        """The ending in words."""
        return _DESCRIPTIONS[self]


_DESCRIPTIONS = {
    Ending.FOUND: "every person was found",
    Ending.COLLISION: "drones collided",
    Ending.LEFT_GRID: "a drone left the grid",
    Ending.TIME_LIMIT: "the time limit was reached",
    Ending.COVERED: "less than 1% was left to find",
}

_SEARCH = int(Action.SEARCH)  # comparing with a plain int is faster
COVERED_AT = 0.99  # the coverage mission ends above this probability of success
_LARGEST = 1e100  # the largest figure of a scheme


@dataclass(frozen=True)
class RewardScheme:
    """The figures of the reward table, per step and drone.

    Attributes:
        step: a step that no other line covers.
        search: an unsuccessful search, times the observed probability of the cell.
        search_threshold: an unsuccessful search of a cell with this probability or less
            gets `search_unlikely` instead.
        search_unlikely: see `search_threshold`.
        find: finding a person.
        find_early: added to `find`, times the remaining fraction of the time limit.
        timeout: the return of a drone that has found nobody by the time limit; exact for
            whole numbers such as the defaults, else up to rounding.
        leave_grid: trying to leave the grid.
        collision: being in the same cell as another drone after moving.
        expected_finds: whether a search pays `find` times the probability of success that it
            adds, in place of what it finds or does not find; see `expected`.
        given_misses: whether that probability is given that those still missing have been missed.

    Raises:
        TypeError: a figure is not a real number, or a flag is not a bool.
        ValueError: a figure is beyond ±1e100, so that sums of rewards could overflow; or
            `given_misses` is True without `expected_finds`.
    """

    step: float = 1.0
    search: float = 10_000.0
    search_threshold: float = 0.01
    search_unlikely: float = -100.0
    find: float = 10_000.0
    find_early: float = 10_000.0
    timeout: float = -100_000.0
    leave_grid: float = -100_000.0
    collision: float = -100_000.0
    expected_finds: bool = False
    given_misses: bool = False

    def __post_init__(self) -> None:
        checks.boolean("RewardScheme.expected_finds", self.expected_finds)
        checks.boolean("RewardScheme.given_misses", self.given_misses)
        if self.given_misses and not self.expected_finds:
            raise ValueError("RewardScheme.given_misses must be False without expected_finds")
        for name in self._figures():
            figure = checks.real(f"RewardScheme.{name}", getattr(self, name), -_LARGEST, _LARGEST)
            object.__setattr__(self, name, figure)

    @classmethod
    def sparse(cls) -> RewardScheme:
        """Reward 1 to a drone that finds a person, and 0 otherwise."""
        return cls(find=1.0, **cls._zeros())

    @classmethod
    def expected(cls, find: float = 1.0, *, given_misses: bool = False) -> RewardScheme:
        """Pay each search `find` times the probability of success (POS) that it adds.

        All other figures are 0. The reward does not depend on where the person is, only on
        what is known, so returns vary less than with `sparse`. A search of cell k adds the
        mean over persons of (1 - POS) b(k) q, where b is the belief and q the probability of
        detection; of several drones in a step, each counts its own cell. Of persons who drift
        together (`Scenario.shared_drift`), only those still missing count, and (1 - POS) b(k) is
        the probability, given the finds, that one is in the cell and has been missed so far.
        Persons with `survival` count as much as the probability that they are alive in that step.

        In a rescue, the sum of an episode is then less than the share of the persons found in the
        mean, because a late search pays little even while everybody is missing. With
        `given_misses`, a search pays the mean over persons of b(k) q, and nothing for those who
        have been found: what it finds in the mean, given all that is known. The return is then an
        unbiased estimate of the share found, for policies that learn from finds.

        Args:
            find: the reward of a certain find, of all persons.
            given_misses: see above.
        """
        return cls(find=find, expected_finds=True, given_misses=given_misses, **cls._zeros())

    @classmethod
    def _figures(cls) -> list[str]:
        """The names of all figures: the fields that are numbers."""
        return [field.name for field in fields(cls) if not isinstance(field.default, bool)]

    @classmethod
    def _zeros(cls) -> dict[str, Any]:
        """All figures but `find` as 0."""
        return {name: 0.0 for name in cls._figures() if name != "find"}


END = "end"
BLOCK = "block"
PASS = "pass"

CRASHES = (END, BLOCK, PASS)
"""What happens to drones that leave the grid or enter a cell that is taken."""


def arrivals(cells: Sequence[int], targets: Sequence[int], crash: str) -> list[int]:
    """The cells in which drones arrive that want to move to their targets, or to OFF_GRID.

    Nobody leaves the grid. With "block", a drone finds those with lower numbers where they have
    moved to, and those with higher numbers where they are, and stays if its target is taken.
    """
    reached = list(cells)
    for drone, target in enumerate(targets):
        if target != OFF_GRID and (crash != BLOCK or target not in reached):
            reached[drone] = target
    return reached


def arrivals_of_rows(cells: Ints, targets: Ints, crash: str) -> Ints:
    """`arrivals` for many searches: (rows, drones); a new array."""
    reached: Ints = cells.copy()
    for drone in range(cells.shape[1]):
        target = targets[:, drone]
        moves = target != OFF_GRID
        if crash == BLOCK:
            moves &= ~(reached == target[:, None]).any(axis=1)
        reached[moves, drone] = target[moves]
    return reached


def same_cell(targets: Sequence[int]) -> set[int]:
    """The cells that two or more drones enter; these drones collide.

    Drones that exchange cells do not, nor do those that try to leave the grid.
    """
    if len(set(targets)) == len(targets):
        return set()
    counts = Counter(targets)
    return {cell for cell in counts if counts[cell] > 1 and cell != OFF_GRID}


def collisions(targets: Ints) -> Ints:
    """The drones in a cell of `same_cell`, each as row * drones + drone, in ascending order.

    `targets` are the cells that the drones try to enter, or OFF_GRID: (rows, drones).
    """
    by_drone = np.ascontiguousarray(targets.T)  # comparing long rows is faster
    collided = np.zeros(by_drone.shape, np.bool_)
    for apart in range(1, len(by_drone)):
        equal = by_drone[apart:] == by_drone[:-apart]
        collided[apart:] |= equal
        collided[:-apart] |= equal
    collided &= by_drone != OFF_GRID
    return collided.T.reshape(-1).nonzero()[0]


class SearchRules(NamedTuple):
    """What the rules depend on in all steps of a search.

    Attributes:
        scheme: the figures of the table.
        timestep_limit: the number of steps in an episode.
        is_rescue: whether the mission is to find persons.
        crash: one of `CRASHES`.
        search_in_flight: whether every drone searches in every step.
    """

    scheme: RewardScheme
    timestep_limit: int
    is_rescue: bool
    crash: str = END
    search_in_flight: bool = False

    def is_quiet(self, actions: bytes, targets: Sequence[int], steps_before: int) -> bool:
        """Whether `outcome` is `RewardScheme.step` for all drones, without an ending.

        Only searches find persons or cover the area, so no drone searches, none crashes, and it is
        not the last step. Most steps are quiet, and skipping the table saves a fifth of their time.
        """
        return (
            _SEARCH not in actions
            and not self.search_in_flight
            and steps_before != self.timestep_limit - 1
            and len({OFF_GRID, *targets}) > len(targets)
        )


class StepEvents(NamedTuple):
    """What happened in a step of one search.

    Attributes:
        targets: the cell that each drone tries to enter, or OFF_GRID; with another rule than "end"
            for crashes, that in which it arrives.
        observed: for each drone that searches, what the matrix that it observed holds for its
            cell; or, with `expected_finds`, the probability of success that its search adds.
        found: the drones whose searches find a person.
        found_before: the drones that found one in an earlier step of the episode.
        returns: each drone's sum of rewards before this step.
        steps_before: steps completed before this one.
        all_found: whether all persons have been found.
        covered: whether the coverage mission is complete, see `COVERED_AT`.
    """

    targets: Sequence[int]
    observed: Mapping[int, float]
    found: Collection[int]
    found_before: Collection[int]
    returns: Sequence[float]
    steps_before: int
    all_found: bool
    covered: bool


class BatchEvents(NamedTuple):
    """`StepEvents` of many searches.

    Arrays have the shape (searches, n), or (searches,) without drones. Exceptions: `observed` is
    for the drones that search, in their order; `found` holds the numbers of drones, row * n +
    drone, possibly with repetitions; `all_found` and `covered` hold numbers of searches.
    `searching` says which drones search.
    """

    searching: Flags
    targets: Ints
    observed: Floats
    found: Ints
    found_before: NDArray[np.bool_]
    returns: Floats
    steps_before: Ints
    all_found: Ints
    covered: Ints


def outcome(rules: SearchRules, events: StepEvents) -> tuple[list[float], Ending | None]:
    """The outcome of a step: every drone's reward, and the ending if it is the last one."""
    scheme = rules.scheme
    timestep_limit = rules.timestep_limit
    targets, observed, found, found_before, returns, steps_before, all_found, covered = events
    is_last = steps_before == timestep_limit - 1
    shared = same_cell(targets) if rules.crash == END else set()
    rewards = []
    for drone, target in enumerate(targets):
        if target in shared:
            reward = scheme.collision
        elif target == OFF_GRID:
            reward = scheme.leave_grid
        elif scheme.expected_finds:
            reward = scheme.find * observed[drone] if drone in observed else scheme.step
        elif drone in found:
            reward = scheme.find + scheme.find_early * (1 - steps_before / timestep_limit)
        elif is_last and rules.is_rescue and drone not in found_before:
            reward = scheme.timeout - returns[drone]
        elif drone not in observed:
            reward = scheme.step
        elif observed[drone] > scheme.search_threshold:
            reward = scheme.search * observed[drone]
        else:
            reward = scheme.search_unlikely
        rewards.append(reward)
    if all_found:  # success takes precedence over crashes
        return rewards, Ending.FOUND
    if covered:
        return rewards, Ending.COVERED
    if shared:
        return rewards, Ending.COLLISION
    if OFF_GRID in targets:
        return rewards, Ending.LEFT_GRID
    return rewards, Ending.TIME_LIMIT if is_last else None


def outcomes(rules: SearchRules, events: BatchEvents) -> tuple[Floats, NDArray[np.int8]]:
    """`outcome` for many searches; applies the lines of the table from last to first.

    Returns:
        Rewards, float64, (searches, n), and endings, int8, (searches,): an `Ending`, or 0.
    """
    scheme = rules.scheme
    targets = events.targets
    observed = events.observed
    found = events.found
    n = targets.shape[1]
    searched = events.searching.reshape(-1).nonzero()[0]
    left_grid = (targets == OFF_GRID).reshape(-1).nonzero()[0]
    collided = targets[:0, 0]
    if rules.crash == END:
        collided = collisions(targets)
    last = (events.steps_before == rules.timestep_limit - 1).nonzero()[0]
    rewards = np.full(targets.size, scheme.step)
    if scheme.expected_finds:
        rewards[searched] = scheme.find * observed
    else:
        likely = observed > scheme.search_threshold
        rewards[searched] = np.where(likely, scheme.search * observed, scheme.search_unlikely)
        if rules.is_rescue and last.size:
            timed_out = (last[:, None] * n + np.arange(n))[~events.found_before[last]]
            rewards[timed_out] = scheme.timeout - events.returns.take(timed_out)
        early = 1 - events.steps_before.take(found // n) / rules.timestep_limit
        rewards[found] = scheme.find + scheme.find_early * early
    rewards[left_grid] = scheme.leave_grid
    rewards[collided] = scheme.collision

    endings = np.zeros(len(targets), np.int8)
    endings[last] = Ending.TIME_LIMIT.value
    endings[left_grid // n] = Ending.LEFT_GRID.value
    endings[collided // n] = Ending.COLLISION.value
    endings[events.covered] = Ending.COVERED.value
    endings[events.all_found] = Ending.FOUND.value
    return rewards.reshape(targets.shape), endings


def is_success(ending: Ending | None) -> bool:
    """Whether an episode ends well: all persons found, or the coverage mission complete."""
    return ending in _WELL


_WELL = frozenset({Ending.FOUND, Ending.COVERED})
_SUCCESSES = np.array([False, *map(is_success, Ending)])  # by the number of the ending


def successes(endings: NDArray[np.int8]) -> NDArray[np.bool_]:
    """`is_success` for many searches; endings are the numbers of an `Ending`, or 0."""
    return _SUCCESSES.take(endings)
