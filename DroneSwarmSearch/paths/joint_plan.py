"""Open-loop plans for all drones together: the multi-robot path planning problem (MESPP).

Adding a search of cell c in step t to a plan gains

    gain[t](c) = a[t](c) q (w[t] - r[t](c)),

where a is the probability that the person is there and has not been found (forward pass), q the
probability of detection, w[t] the worth of finding the person in that step, and r what the rest of
the plan is expected to gain from a person in that cell (backward pass; S. S. Brown, Operations
Research 28:1275, 1980). The best path for given gains is a dynamic programme (`paths`).

A plan improves by simulated annealing (S. Kirkpatrick, C. D. Gelatt, M. P. Vecchi, Science 220:671,
1983) in large neighbourhoods (P. Shaw, CP 1998). A trial replaces a few steps of a drone's path, or
of two drones' that are near each other. These may exchange the rest of their paths, since all
drones are equal. The candidates are the best paths for randomly distorted gains, and the old path.
The gains ignore a path's own searches, except that one right after another of the same cell gains
only what that has left. The value V of each candidate is computed (`windows`), and one is drawn
with a probability proportional to exp(V / temperature), a heat bath. Trials go through time back
and forth, so that the passes need little updating. No two drones are ever in one cell: each avoids
the cells where the others will be.

Best paths for distorted gains soon improve a small search no further. The rest of the work goes to
random changes of the best plan (`nudges`), at low temperatures.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from DroneSwarmSearch._internal.arrays import Flags, Floats, Ints
from DroneSwarmSearch.core.grid import Grid
from DroneSwarmSearch.core.rules import BLOCK, END, PASS
from DroneSwarmSearch.paths.best_paths import (
    FORBIDDEN,
    DronePath,
    best_paths,
    cells_looked_at,
    values_to_go,
)
from DroneSwarmSearch.paths.nudges import nudged
from DroneSwarmSearch.paths.passes import Passes, Target
from DroneSwarmSearch.paths.windows import Boxes, TargetWindow

SHORTEST = 3  # the length of a replaced segment, in steps
LONGEST = 30
LONGEST_LATER = 15  # in the second half of the work

STRENGTHS = (0.2, 0.5, 1.0)
"""Standard deviations of the logarithm of the factors that distort gains."""

TRIES = ((2.0, 1.0), (0.1, 0.5))
"""The first temperature of each try, in units of a plan's mean value per drone and step; and its
work as a fraction of `seconds`. The best try counts: some searches, such as those with a fast
drift, do not come back from the heat."""

COLDEST = 0.02  # the last temperature, in the same unit

TOGETHER = 4  # the most drones in a trial without pairs
PAIRS = 0.5  # the fraction of trials with pairs of drones
EXCHANGES = 0.5  # the fraction of pairs that may exchange the rest of their paths

VALUES = 20000  # masses of all candidates of a trial together
# candidates of a trial
FEWEST = 8
MOST = 32

NOISE = 2**18  # random factors that are drawn once, and used from a random index on in every trial

ENOUGH = 200
"""The most trials for each step of a drone, times the fraction in `TRIES`; in small searches, work
is left for nudges then."""

WARM = 0.3  # the first temperature with nudges, in the unit of `TRIES`
ENOUGH_NUDGES = 60  # the most trials with nudges for each step of a drone

# In seconds, on a busy machine. An idle one takes two thirds of it, and so about `seconds` for all
# tries.
TRIAL_COST = 260e-6
STEP_COST = 150e-6  # of each step of a trial
VALUE_COST = 18e-9  # of each mass of a candidate


Index = tuple[Any, ...]  # of an array


@dataclass(frozen=True)
class Segments:
    """The steps that a trial replaces, and the drones that take part.

    K boxes of the grid are tried at once, each with its own team of one or two drones.

    Attributes:
        begin: the first step to replace.
        end: the step before which the segments end.
        cells: every drone's cell at the beginning and after each step: (L + 1, drones).
        searches: whether it searches in each step: (L, drones).
        teams: the drones of each box: (K, members).
        goals: the cells in which each team's new segments end, (K, members); -1: anywhere.
        reach: the cells where the drones can be.
        boxes: these, and a margin that searches there affect.
    """

    begin: int
    end: int
    cells: Ints
    searches: Flags
    teams: Ints
    goals: Ints
    reach: Boxes
    boxes: Boxes

    @property
    def steps(self) -> int:
        """The number of steps, L."""
        return self.end - self.begin


@dataclass(frozen=True)
class Candidates:
    """New segments for the drones of each box.

    Attributes:
        total: what the segments of a team gain together: (K, m).
        indices: for each member of the teams, `cells` as indices in the boxes.
        cells: for each member of the teams, the cells at the beginning and after each step:
            (L + 1, K, m).
        searches: for each member, the steps with a search: (L, K, m).
    """

    total: Floats
    indices: list[Ints]
    cells: list[Ints]
    searches: list[Flags]


class JointPlan:
    """The drones' paths over the next n steps, from the episode's step `first` on.

    Args:
        targets: the missing persons.
        first: the plan's first step.
        paths: the drones' paths to begin with.
        in_flight: whether drones search in flight, see `best_paths`.
        crash: what happens to drones that meet, see `core.rules`. Unless they pass each other, no
            two are ever in one cell; if they block each other, none enters a cell before another
            one has left it, lower numbers first.

    Attributes:
        paths: the current paths.
    """

    def __init__(
        self,
        targets: Sequence[Target],
        first: int,
        paths: Sequence[DronePath],
        *,
        in_flight: bool = False,
        crash: str = END,
    ) -> None:
        self._in_flight = in_flight
        self._crash = crash
        self._steps = len(targets[0].worth)
        self._size = targets[0].belief.shape[-1]
        self._grid = Grid.of(self._size)
        self.paths = [DronePath(path.cells.copy(), path.searches.copy()) for path in paths]
        self._passes = [Passes(target, first, self.paths, in_flight) for target in targets]
        self._boxed = all(target.model.transitions(first) for target in targets)

    def found(self) -> list[Floats]:
        """The probability that the plan finds each target in each step, (n,)."""
        return [passes.found() for passes in self._passes]

    def value(self) -> float:
        """The expected worth of all finds."""
        return sum(float(passes.target.worth @ passes.found()) for passes in self._passes)

    def gains(self) -> Floats:
        """What one more search of each cell gains in each step: (n, N, N)."""
        gains = np.zeros((self._steps, self._size, self._size))
        for passes in self._passes:
            gains += passes.gains()
        return gains

    # Annealing.

    def anneal(
        self,
        seconds: float,
        rng: np.random.Generator,
        on_progress: Callable[[float], object] = lambda fraction: None,
    ) -> None:
        """Improve the plan by some work, given as the time that it takes on an idle machine.

        `on_progress` is called with the share of the work that is done.
        """
        noise = rng.normal(size=NOISE).astype(np.float32)
        noises = [np.exp(strength * noise) for strength in STRENGTHS]
        start = copy.deepcopy(self.paths)
        total = sum(share for _, share in TRIES)
        drone_steps = len(start) * self._steps
        best_value = -math.inf
        best_paths_so_far = start
        before = 0.0
        left = total * seconds
        for hottest, share in TRIES:
            self._replace(range(len(start)), 0, start)
            enough = share * ENOUGH * drone_steps
            for done, work in self._cool(hottest, share * seconds, enough, noises, rng):
                left -= work
                on_progress((before + share * done) / total)
            before += share
            value = self.value()
            if value > best_value:
                best_value = value
                best_paths_so_far = copy.deepcopy(self.paths)
        self._replace(range(len(start)), 0, best_paths_so_far)
        for _ in self._cool(WARM, left, ENOUGH_NUDGES * drone_steps, [], rng):
            pass

    def _cool(
        self,
        hottest: float,
        work: float,
        enough: float,
        noises: Sequence[Floats],
        rng: np.random.Generator,
    ) -> Iterator[tuple[float, float]]:
        """Anneal from a temperature, and keep the best paths.

        After each trial, yields what is done, from 0 to 1, and the work of the trial.

        Args:
            hottest: the first temperature, see `TRIES`.
            work: in seconds.
            enough: the most trials.
            noises: random factors of gains, (NOISE,) each; without any, paths are nudged.
            rng: the random numbers.
        """
        begin = 0
        direction = 1
        value = most = self.value()
        best = copy.deepcopy(self.paths)
        drone_steps = len(best) * self._steps
        unit = max(value, 1e-9) / drone_steps
        done = 0.0 if work > 0.0 else 1.0
        while done < 1.0:
            temperature = unit * hottest * (COLDEST / hottest) ** done
            longest = LONGEST if noises and done < 0.5 else LONGEST_LATER
            length = round(SHORTEST * (longest / SHORTEST) ** rng.random())
            length = min(length, self._steps)
            begin = min(max(begin, 0), self._steps - length)
            factors = noises[int(rng.integers(len(noises)))] if noises else None
            gained, took = self.trial(begin, begin + length, temperature, factors, rng)
            value += gained
            done += max(took / work, 1.0 / enough)
            yield min(done, 1.0), took
            if value > most + 1e-9:
                most = value
                best = copy.deepcopy(self.paths)
            begin += direction * int(rng.integers(4))
            if not 0 <= begin <= self._steps - length:
                direction = -direction
        self._replace(range(len(best)), 0, best)

    # A trial.

    def trial(
        self,
        begin: int,
        end: int,
        temperature: float,
        factors: Floats | None,
        rng: np.random.Generator,
    ) -> tuple[float, float]:
        """Replace segments of some drones' paths; returns the value gained and the work done.

        Args:
            begin: the first step to replace.
            end: the step before which the segments end.
            temperature: of the heat bath, in value.
            factors: random factors of gains, (NOISE,); or None to nudge the paths.
            rng: the random numbers.
        """
        segments = self._drawn_segments(begin, end, rng)
        windows = [
            TargetWindow(passes, begin, segments.steps, segments.boxes, self._crash == PASS)
            for passes in self._passes
        ]
        values = segments.steps * sum(window.cells for window in windows)
        count = min(max(VALUES // values, FEWEST), MOST)

        old = self._removed(windows, segments)
        candidates = self._proposed(windows, segments, count, factors, rng)
        total = np.hstack([candidates.total - old, np.zeros_like(old)])  # at last, the old paths
        chosen = (total / temperature + rng.gumbel(size=total.shape)).argmax(axis=1)

        gained = self._take(segments, candidates, chosen, total)
        members = segments.teams.shape[1]
        each = STEP_COST * segments.steps + VALUE_COST * values * count
        return gained, TRIAL_COST + members * each

    def _drawn_segments(self, begin: int, end: int, rng: np.random.Generator) -> Segments:
        """Draw the drones of a trial, and where their new segments end."""
        steps = end - begin
        cells = np.array([path.cells[begin : end + 1] for path in self.paths]).T
        searches = np.array([path.searches[begin:end] for path in self.paths]).T
        teams = self._teams(cells, rng)
        count, members = teams.shape
        starts = cells[0, teams]
        old_goals = cells[-1, teams]
        goals = cells[-1, teams]
        if end == self._steps:
            old_goals = goals = np.full_like(goals, -1)
        elif members > 1 and self._crash != BLOCK:
            can = (self._grid.distance(starts, goals[:, ::-1]) <= steps).all(axis=1)
            exchanges = can & (rng.random(count) < EXCHANGES)
            goals[exchanges] = goals[exchanges, ::-1]
        starts_twice = np.hstack([starts, starts])
        all_goals = np.hstack([old_goals, goals])
        return Segments(
            begin=begin,
            end=end,
            cells=cells,
            searches=searches,
            teams=teams,
            goals=goals,
            reach=Boxes.around(starts_twice, all_goals, steps, 0, self._size),
            boxes=Boxes.around(starts_twice, all_goals, steps, steps // 2, self._size),
        )

    def _teams(self, cells: Ints, rng: np.random.Generator) -> Ints:
        """The drones of each box: one, (K, 1), or two that are near each other, (K, 2)."""
        order = rng.permutation(len(self.paths))
        waiting = order if rng.random() < PAIRS else order[:0]
        middle = cells[len(cells) // 2]
        pairs = []
        while len(waiting) > 1:
            drone = waiting[0]
            others = waiting[1:]
            far = self._grid.distance(middle[others], middle[drone])
            nearest = far.argmin()
            waiting = others
            if far[nearest] < len(cells):
                pairs.append((drone, others[nearest]))
                waiting = np.delete(others, nearest)
        most = len(order) if self._boxed else 1
        if pairs:
            return np.array(pairs[:most])
        return order[: min(TOGETHER, most), None]

    def _removed(self, windows: Sequence[TargetWindow], segments: Segments) -> Floats:
        """Remove the old segments from the windows; returns what they have gained, (K, 1)."""
        old = np.zeros((len(segments.teams), 1))
        for drones in segments.teams.T:
            for window in windows:
                cells = cells_looked_at(segments.cells[:, drones], self._in_flight)
                old[:, 0] += window.remove(cells, segments.searches[:, drones])
        return old

    def _proposed(
        self,
        windows: Sequence[TargetWindow],
        segments: Segments,
        count: int,
        factors: Floats | None,
        rng: np.random.Generator,
    ) -> Candidates:
        """Some candidates for each box, drone after drone: the best paths for distorted gains.

        Without factors, they are nudged paths.
        """
        reach = segments.reach
        boxes, members = segments.teams.shape
        shape = (segments.steps, boxes, count, reach.height, reach.width)
        by_others = reach.indices(segments.cells[..., None])  # [step, drone, box]
        # Members of a team have no paths yet, but stand in their first cells.
        by_others[1:, segments.teams.T, np.arange(boxes)] = -1
        found = Candidates(np.zeros((boxes, count)), [], [], [])
        for member, drones in enumerate(segments.teams.T):
            ends: Any = -1
            if np.all(segments.goals >= 0):
                ends = reach.indices(segments.goals[:, member])
            taken: list[list[Index]] = [[] for _ in range(segments.steps)]
            if self._crash != PASS:
                taken = self._taken(by_others[..., None], np.arange(len(self.paths)), drones)
                for other, own in zip(segments.teams.T, found.indices, strict=False):
                    mine = self._taken(own[:, None], other[None], drones)
                    taken = [before + more for before, more in zip(taken, mine, strict=True)]
            if factors is None:
                old = segments.cells[:, drones]
                cells = nudged(old, segments.goals[:, member], count, self._size, rng)
                indices, searches, is_possible = _checked(reach, cells, ends, taken)
                searches |= self._in_flight
            else:
                gains = sum(window.gains(reach) for window in windows)
                some = factors[int(rng.integers(NOISE)) :][: math.prod(shape)]
                gains = np.maximum(gains, 0.0) * np.resize(some, shape)  # below 0 by rounding
                starts = reach.indices(segments.cells[0, drones])
                indices, searches, is_possible = _best(gains, starts, ends, taken, self._in_flight)
            found.indices.append(indices)
            cells = reach.cells(indices)
            looked_at = cells_looked_at(cells, self._in_flight)
            is_last = member == members - 1
            found.total[...] += sum(
                window.add(looked_at, searches, is_last=is_last) for window in windows
            )
            found.total[~is_possible] = -np.inf
            found.cells.append(cells)
            found.searches.append(searches)
        return found

    def _taken(self, indices: Ints, others: Ints, drones: Ints) -> list[list[Index]]:
        """The cells that a drone in each box must not be in after each step, as indices.

        Args:
            indices: of other drones' cells in the boxes at the beginning and after each step, or
                -1: (L + 1, others, K, m), or m = 1 for all candidates.
            others: their numbers: (others,), or by box (others, K).
            drones: the number of the drone in each box: (K,).
        """
        steps = len(indices) - 1
        taken = [_where(indices[step]) for step in range(1, steps + 1)]
        if self._crash == BLOCK:
            numbers = others if others.ndim > 1 else others[:, None]
            later = (numbers > drones)[..., None]  # they move later, and must be out of the way
            for step in range(1, steps + 1):
                taken[step - 1] += _where(np.where(later, indices[step - 1], -1))
                if step < steps:
                    taken[step - 1] += _where(np.where(~later, indices[step + 1], -1))
        return taken

    def _take(
        self, segments: Segments, candidates: Candidates, chosen: Ints, total: Floats
    ) -> float:
        """Take the chosen candidate of each box, unless it is the last, the old segments.

        Returns the value gained. Boxes that do not meet do not affect each other; of those that
        meet, only the first one changes.
        """
        gained = 0.0
        changed = np.zeros(len(segments.teams), np.bool_)
        for box in (chosen < candidates.total.shape[1]).nonzero()[0]:
            if (segments.boxes.meet(box) & changed).any():
                continue
            changed[box] = True
            best = chosen[box]
            gained += float(total[box, best])
            by_member = zip(candidates.cells, candidates.searches, strict=True)
            parts = [
                DronePath(cells[:, box, best], searches[:, box, best])
                for cells, searches in by_member
            ]
            self._replace(segments.teams[box].tolist(), segments.begin, parts)
        return gained

    # Changes.

    def _segment(self, drone: int, begin: int, end: int) -> DronePath:
        """A part of a drone's path; a view."""
        path = self.paths[drone]
        return DronePath(path.cells[begin : end + 1], path.searches[begin:end])

    def _replace(self, drones: Sequence[int], begin: int, new: Sequence[DronePath]) -> None:
        """Replace a segment of each drone's path.

        If the new segments end at swapped cells, the drones also swap the rest of their paths.
        """
        end = begin + len(new[0].searches)
        old = [self._segment(drone, begin, end) for drone in drones]
        for passes in self._passes:
            passes.replace(old, new, begin)
        rests = [copy.deepcopy(self._segment(drone, end, self._steps)) for drone in drones]
        rest_from = {int(rest.cells[0]): rest for rest in rests}
        for drone, segment, own in zip(drones, new, rests, strict=True):
            path = self.paths[drone]
            path.cells[begin : end + 1] = segment.cells
            path.searches[begin:end] = segment.searches
            if end < self._steps:
                is_own = segment.cells[-1] == own.cells[0]
                rest = own if is_own else rest_from[int(segment.cells[-1])]
                path.cells[end:] = rest.cells
                path.searches[end:] = rest.searches


def _where(here: Ints) -> list[Index]:
    """The cells of drones, (others, K, m) or -1, as indices of arrays (K, m, cells)."""
    other, box, candidate = (here >= 0).nonzero()
    if here.shape[-1] == 1:
        return [(box, slice(None), here[other, box, 0])]
    return [(box, candidate, here[other, box, candidate])]


def _checked(
    reach: Boxes, cells: Ints, ends: Any, taken: Sequence[Sequence[Index]]
) -> tuple[Ints, Flags, Flags]:
    """Given paths, (L + 1, K, m), in the form of `_best`; a drone that stays searches."""
    indices = np.moveaxis(reach.indices(np.moveaxis(cells, 1, 2)), 1, 2)
    is_possible: Any = (indices >= 0).all(axis=0)
    indices = np.maximum(indices, 0)
    if np.all(ends >= 0):
        is_possible &= indices[-1] == ends[:, None]
    for now, others in zip(indices[1:], taken, strict=True):
        blocked = np.zeros((*now.shape, reach.height * reach.width), np.bool_)
        for other in others:
            blocked[other] = True
        is_possible &= ~np.take_along_axis(blocked, now[..., None], axis=-1)[..., 0]
    return indices, cells[1:] == cells[:-1], is_possible


def _best(
    gains: Floats,
    starts: Ints,
    ends: Any,
    taken: Sequence[Sequence[Index]],
    in_flight: bool,
) -> tuple[Ints, Flags, Flags]:
    """The best paths for some gains, see `best_paths`; and whether each can get there.

    Args:
        gains: for each of m candidates in each of K boxes, also right after a search: shape
            (2, L, K, m, h, w).
        starts: the first cell of the paths in a box, (K,).
        ends: their last cell, (K,), or -1 if it does not matter.
        taken: for each step, the cells of others after it.
        in_flight: whether drones search in flight.
    """
    boxes, count, height, width = gains.shape[2:]
    at_end = np.zeros((boxes, 1, height * width))
    if np.all(ends >= 0):
        at_end += FORBIDDEN
        at_end[np.arange(boxes), 0, ends] = 0.0
    at_end = at_end.reshape(boxes, 1, height, width)
    values = values_to_go(gains[0], at_end, taken, gains[1], in_flight)

    # All candidates of all boxes in a row.
    flat_shape = (2, -1, boxes * count, height, width)
    flat_gains = gains.reshape(flat_shape)
    flat_values = values.reshape(flat_shape)
    flat_starts = starts.repeat(count)
    which = np.arange(boxes * count)
    cells, searches = best_paths(
        flat_gains[0], flat_values, flat_starts, which, flat_gains[1], in_flight
    )
    at_start = flat_values[0, 0].take(which * (height * width) + flat_starts)
    return (
        cells.reshape(-1, boxes, count),
        searches.reshape(-1, boxes, count),
        (at_start > FORBIDDEN).reshape(boxes, count),
    )
