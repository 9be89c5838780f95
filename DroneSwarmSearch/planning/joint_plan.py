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
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from DroneSwarmSearch._internal.arrays import Flags, Floats, Ints
from DroneSwarmSearch.bound.paths import FORBIDDEN, Path, best_paths, values_to_go
from DroneSwarmSearch.core.grid import Grid
from DroneSwarmSearch.planning.passes import Passes, Target
from DroneSwarmSearch.planning.windows import Boxes, TargetWindow

SHORTEST, LONGEST, LONGEST_LATER = 3, 30, 15
"""Lengths of a replaced segment, in steps; the longest at first and in the second half."""

STRENGTHS = (0.2, 0.5, 1.0)
"""Standard deviations of the logarithm of the factors that distort gains."""

TRIES, COLDEST = ((2.0, 1.0), (0.1, 0.5)), 0.02
"""The first temperature of each try and its work as a fraction of `seconds`, and the last
temperature; in units of a plan's mean value per drone and step. The best try counts: some searches,
such as those with a fast drift, do not come back from the heat."""

TOGETHER = 4  # the most drones in a trial without pairs

PAIRS, EXCHANGES = 0.5, 0.5
"""The fractions of trials with pairs, and of pairs that may exchange the rest of their paths."""

VALUES, FEWEST, MOST = 20000, 8, 32
"""Masses of all candidates of a trial together, and the fewest and the most candidates."""

NOISE = 2**18  # random factors that are drawn once, and used from a random place on in every trial

ENOUGH = 200
"""The most trials for each step of a drone, times the fraction in `TRIES`; more improve small
searches no further."""

TRIAL_COST, STEP_COST, VALUE_COST = 260e-6, 150e-6, 18e-9
"""The time of a trial, of each of its steps and of each mass of a candidate, in seconds, on a busy
machine. An idle one takes two thirds of it, and so about `seconds` for all tries."""


class JointPlan:
    """The drones' paths over the next n steps, from the episode's step `first` on.

    Attributes:
        paths: the current paths; no two drones are ever in one cell.
    """

    def __init__(self, targets: Sequence[Target], first: int, paths: Sequence[Path]) -> None:
        self._steps, self._size = len(targets[0].worth), targets[0].belief.shape[-1]
        self._grid = Grid.of(self._size)
        self.paths = [Path(path.cells.copy(), path.searches.copy()) for path in paths]
        self._passes = [Passes(target, first, self.paths) for target in targets]
        self._boxed = all(target.chain.matrices(first) for target in targets)

    def found(self) -> list[Floats]:
        """The probability that the plan finds each target in each step, (n,)."""
        return [passes.found() for passes in self._passes]

    def value(self) -> float:
        """The expected worth of all finds."""
        return sum(float(passes.target.worth @ passes.found()) for passes in self._passes)

    def anneal(
        self,
        seconds: float,
        rng: np.random.Generator,
        report: Callable[[float], object] = lambda fraction: None,
    ) -> None:
        """Improve the plan by some work, given as the time that it takes on an idle machine.

        `report` is told the share of the work that is done.
        """
        noise = rng.normal(size=NOISE).astype(np.float32)
        noises = [np.exp(strength * noise) for strength in STRENGTHS]
        start, found = copy.deepcopy(self.paths), []
        before, total = 0.0, sum(share for _, share in TRIES)
        for hottest, share in TRIES:
            self._replace(range(len(start)), 0, start)
            for done in self._cool(hottest, share, seconds, noises, rng):
                report((before + share * done) / total)
            before += share
            found.append((self.value(), copy.deepcopy(self.paths)))
        best = max(found, key=lambda one: one[0])
        self._replace(range(len(start)), 0, best[1])

    def _cool(
        self,
        hottest: float,
        share: float,
        seconds: float,
        noises: Sequence[Floats],
        rng: np.random.Generator,
    ) -> Iterator[float]:
        """Anneal from a temperature, and keep the best paths; yields the fraction completed."""
        begin, direction = 0, 1
        value = most = self.value()
        best = copy.deepcopy(self.paths)
        drone_steps = len(best) * self._steps
        unit = max(value, 1e-9) / drone_steps
        done = 0.0 if seconds else 1.0
        while done < 1.0:
            yield done
            temperature = unit * hottest * (COLDEST / hottest) ** done
            longest = LONGEST if done < 0.5 else LONGEST_LATER
            length = round(SHORTEST * (longest / SHORTEST) ** rng.random())
            length = min(length, self._steps)
            begin = min(max(begin, 0), self._steps - length)
            factors = noises[int(rng.integers(len(noises)))]
            gained, took = self.trial(begin, begin + length, temperature, factors, rng)
            value += gained
            done += max(took / seconds, 1.0 / (ENOUGH * drone_steps)) / share
            if value > most + 1e-9:
                most = value
                best = copy.deepcopy(self.paths)
            begin += direction * int(rng.integers(4))
            if not 0 <= begin <= self._steps - length:
                direction = -direction
        self._replace(range(len(best)), 0, best)

    def trial(
        self, begin: int, end: int, temperature: float, factors: Floats, rng: np.random.Generator
    ) -> tuple[float, float]:
        """Replace segments of some drones' paths; returns the value gained and the work done.

        Args:
            begin: the first step to replace.
            end: the step before which the segments end.
            temperature: of the heat bath, in value.
            factors: random factors of gains, (NOISE,).
            rng: the random numbers.
        """
        steps, size, is_tail = end - begin, self._size, end == self._steps
        # [step, drone]
        cells = np.array([path.cells[begin : end + 1] for path in self.paths]).T
        searches = np.array([path.searches[begin:end] for path in self.paths]).T
        teams = self._teams(cells, rng)  # [box, place]
        (count, members), starts = teams.shape, cells[0, teams]
        old_goals, goals = cells[-1, teams], cells[-1, teams]
        if is_tail:
            old_goals = goals = np.full_like(goals, -1)
        elif members > 1:
            can = (self._grid.distance(starts, goals[:, ::-1]) <= steps).all(axis=1)
            exchanges = can & (rng.random(count) < EXCHANGES)
            goals[exchanges] = goals[exchanges, ::-1]
        ways = np.hstack([starts, starts]), np.hstack([old_goals, goals])
        reach = Boxes.around(*ways, steps, 0, size)
        boxes = Boxes.around(*ways, steps, steps // 2, size)
        windows = [TargetWindow(passes, begin, steps, boxes) for passes in self._passes]
        values = steps * sum(window.cells for window in windows)
        candidates = min(max(VALUES // values, FEWEST), MOST)
        took = STEP_COST * steps + VALUE_COST * values * candidates
        took = TRIAL_COST + members * took
        old = np.zeros((count, 1))
        for drones in teams.T:
            for window in windows:
                old[:, 0] += window.remove(cells[:-1, drones], searches[:, drones])
        total, new = self._proposed(windows, cells, teams, goals, reach, factors, rng, candidates)
        total = np.hstack([total - old, np.zeros((count, 1))])  # at last, the old paths
        chosen = (total / temperature + rng.gumbel(size=total.shape)).argmax(axis=1)
        gained, changed = 0.0, np.zeros(count, np.bool_)
        for box in (chosen < candidates).nonzero()[0]:
            # Boxes that do not meet do not affect each other.
            if not (boxes.meet(box) & changed).any():
                changed[box], best = True, chosen[box]
                gained += float(total[box, best])
                parts = [Path(paths[:, box, best], looks[:, box, best]) for paths, looks in new]
                self._replace(teams[box].tolist(), begin, parts)
        return gained, took

    def _proposed(
        self,
        windows: Sequence[TargetWindow],
        cells: Ints,
        teams: Ints,
        goals: Ints,
        reach: Boxes,
        factors: Floats,
        rng: np.random.Generator,
        candidates: int,
    ) -> tuple[Floats, list[tuple[Ints, Flags]]]:
        """The values of candidates in each box, (K, m), and their cells and searches by place."""
        count, members = teams.shape
        taken = self._others(reach.indices(cells[..., None]), teams)
        total, new = np.zeros((count, candidates)), []
        for place, drones in enumerate(teams.T):
            gains = sum(window.gains(reach) for window in windows)
            many = (len(cells) - 1, count, candidates, reach.height, reach.width)
            some = factors[int(rng.integers(NOISE)) :][: math.prod(many)]
            gains = np.maximum(gains, 0.0) * np.resize(some, many)  # below 0 by rounding errors
            ends = reach.indices(goals[:, place]) if np.all(goals >= 0) else -1
            paths, looks, possible = _best(gains, reach.indices(cells[0, drones]), ends, taken)
            for indices, here in zip(taken, paths[1:], strict=True):
                indices.append((*np.indices(here.shape), here))
            paths, is_last = reach.cells(paths), place == members - 1
            total += sum(window.add(paths[:-1], looks, is_last) for window in windows)
            total[~possible] = -np.inf
            new.append((paths, looks))
        return total, new

    def _teams(self, cells: Ints, rng: np.random.Generator) -> Ints:
        """The drones of each box: one, (K, 1), or two that are near each other, (K, 2)."""
        order = rng.permutation(len(self.paths))
        pairs, free = [], order if rng.random() < PAIRS else order[:0]
        middle = cells[len(cells) // 2]
        while len(free) > 1:
            drone, free = free[0], free[1:]
            far = self._grid.distance(middle[free], middle[drone])
            if far.min() < len(cells):
                pairs.append((drone, free[far.argmin()]))
                free = np.delete(free, far.argmin())
        most = len(order) if self._boxed else 1
        return np.array(pairs[:most]) if pairs else order[: min(TOGETHER, most), None]

    @staticmethod
    def _others(indices: Ints, teams: Ints) -> list[list[tuple[Any, ...]]]:
        """The cells of all drones but its team in each box: for each step, an index.

        Given are their indices in the boxes, [step, drone, box].
        """
        indices[:, teams.T, np.arange(len(teams))] = -1
        taken: list[list[tuple[Any, ...]]] = []
        for here in indices[1:]:
            drone, box = (here >= 0).nonzero()
            taken.append([(box, slice(None), here[drone, box])])
        return taken

    def _segment(self, drone: int, begin: int, end: int) -> Path:
        """A part of a drone's path; a view."""
        path = self.paths[drone]
        return Path(path.cells[begin : end + 1], path.searches[begin:end])

    def _replace(self, drones: Sequence[int], begin: int, new: Sequence[Path]) -> None:
        """Replace segments of some drones' paths; each goes on as the one who was there did."""
        end = begin + len(new[0].searches)
        old = [self._segment(drone, begin, end) for drone in drones]
        for passes in self._passes:
            passes.replace(old, new, begin)
        rests = [copy.deepcopy(self._segment(drone, end, self._steps)) for drone in drones]
        rest_from = {int(rest.cells[0]): rest for rest in rests}
        for drone, path in zip(drones, new, strict=True):
            cells, searches = self.paths[drone]
            cells[begin : end + 1], searches[begin:end] = path
            if end < self._steps:
                cells[end:], searches[end:] = rest_from[int(path.cells[-1])]


def _best(
    gains: Floats,
    starts: Ints,
    ends: Any,
    taken: Sequence[Sequence[tuple[Any, ...]]],
) -> tuple[Ints, Flags, Flags]:
    """The best paths for some gains, see `paths`; and whether each can get there.

    Args:
        gains: for each of m candidates in each of K boxes, also right after a search: shape
            (2, L, K, m, h, w).
        starts: the first cell of the paths in a box, (K,).
        ends: their last cell, (K,), or -1 if it does not matter.
        taken: for each step, the cells of others after it.
    """
    count, candidates, height, width = gains.shape[2:]
    at_end = np.zeros((count, 1, height * width))
    if np.all(ends >= 0):
        at_end += FORBIDDEN
        at_end[np.arange(count), 0, ends] = 0.0
    at_end = at_end.reshape(count, 1, height, width)
    values = values_to_go(gains[0], at_end, taken, gains[1])
    flat = count * candidates, height, width
    gains, values = gains.reshape(2, -1, *flat), values.reshape(2, -1, *flat)
    starts, which = starts.repeat(candidates), np.arange(count * candidates)
    cells, searches = best_paths(gains[0], values, starts, which, gains[1])
    possible = values[0, 0].take(which * (height * width) + starts) > FORBIDDEN
    return (
        cells.reshape(-1, count, candidates),
        searches.reshape(-1, count, candidates),
        possible.reshape(count, candidates),
    )
