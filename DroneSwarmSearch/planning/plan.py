"""Plans for all drones together: paths, improved a stretch at a time.

With one person adrift the only news that a search ever brings is that it found nobody, so
the best policy is a plan made in advance: a path for each drone. To find the best one is
hard (Trummel and Weisinger, Operations Research 34:324, 1986). A good one comes from this:

- A search of cell c in step t, added to a plan, is worth

      gain[t](c) = a[t](c) q (w[t] - r[t](c)),

  a the chance that the person is there and has not been found (the pass forth), q the
  probability of detection, w[t] what finding the person in that step is worth, and r what
  the rest of the plan will still gain, on average, from a person in that cell (the pass
  back). For a single search this is exact (Brown, Operations Research 28:1275, 1980).
- For given gains the best path of a drone is a dynamic programme (`paths`). The sum of
  gains overrates a path that looks for the same person twice. Therefore it is solved for
  one stretch of one drone's path at a time, all else as planned, and the stretch is
  replaced only if the whole plan, evaluated exactly, becomes better.

No two drones are ever in one cell: each avoids the cells where the others will be.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch.planning.chain import Chain
from DroneSwarmSearch.planning.paths import NOWHERE, Path, best_path, values_to_go

__all__ = ["Plan", "Target", "idle_paths"]

Floats = NDArray[np.float64]

Schedule = list[list[int]]
"""For each step the cells that are searched in it, y * N + x."""

LEAST_GAIN = 1e-9
"""Improvements below this are rounding."""


@dataclass
class Target:
    """A person to be found.

    Attributes:
        chain: of the person's steps.
        belief: where the person is at the plan's first step: float64, shape (N, N).
        weight: what finding this person counts for.
    """

    chain: Chain
    belief: Floats
    weight: float = 1.0


def idle_paths(starts: Sequence[int], steps: int) -> list[Path]:
    """Paths of drones that stay where they are.

    Args:
        starts: every drone's cell, y * N + x.
        steps: how many.
    """
    return [Path(np.full(steps + 1, cell), np.zeros(steps, np.bool_)) for cell in starts]


class Plan:
    """The drones' paths from a step to the end of the episode.

    Args:
        targets: the persons to be found.
        worth: what finding somebody in each step of the plan is worth, float64, shape (n,);
            it must never rise.
        first: the step of the episode with which the plan begins.
        paths: every drone's path over n steps; no two are ever in one cell.

    Attributes:
        targets: as given; weights may be changed.
        paths: as they are now.
    """

    def __init__(
        self, targets: Sequence[Target], worth: Floats, first: int, paths: Sequence[Path]
    ) -> None:
        self.targets = targets
        self._worth = worth
        self._first = first
        self._grid = targets[0].belief.shape
        self.paths = [Path(path.cells.copy(), path.searches.copy()) for path in paths]

    @property
    def steps(self) -> int:
        """The number of steps planned, n."""
        return len(self._worth)

    def chances(self) -> list[float]:
        """Each target's chance to be found."""
        schedule = self._schedule()
        return [float(self._forth(t, t.belief, 0, schedule)[1].sum()) for t in self.targets]

    def value(self) -> float:
        """The expected worth of what is found."""
        beliefs = [target.belief for target in self.targets]
        return self._found(beliefs, 0, self._schedule())[1]

    def improve(self, *, shortest: int, least: float, rounds: int) -> None:
        """Improve stretches of the whole length, half of it and so on, round after round.

        Args:
            shortest: stretches need not be shorter than this, in steps.
            least: what a round must gain for another one to follow.
            rounds: the most to make.
        """
        lengths = [self.steps]
        while lengths[-1] > shortest:
            lengths.append(max(lengths[-1] // 2, shortest))
        for number in range(rounds):
            gained = 0.0
            for length in lengths:
                shift = number * length // 2 % length
                for drone in range(len(self.paths)):
                    gained += self.sweep(drone, length, shift)
            if gained < least:
                break

    def scatter(self, rng: np.random.Generator) -> None:
        """Improve every drone's path as a whole, by gains that are distorted at random.

        Different numbers lead to different plans, whose improvement ends in different ones.
        """
        for drone in range(len(self.paths)):
            self.sweep(
                drone,
                self.steps,
                distort=lambda gains: gains * np.exp(rng.normal(size=gains.shape)),
            )

    def sweep(
        self,
        drone: int,
        length: int,
        shift: int = 0,
        distort: Callable[[Floats], Floats] | None = None,
    ) -> float:
        """Improve a drone's path stretch by stretch, from its beginning to its end.

        Args:
            drone: its number.
            length: of the stretches, in steps.
            shift: by so many steps the first one is cut short.
            distort: changes the gains before a path is sought.

        Returns:
            What the plan gained.
        """
        others = [path for other, path in enumerate(self.paths) if other != drone]
        by_others = _schedule(others, self.steps)
        taken = [[int(path.cells[step + 1]) for path in others] for step in range(self.steps)]
        schedule = self._schedule()
        ahead = [self._back(target, None, 0, schedule)[0] for target in self.targets]
        beliefs = [target.belief for target in self.targets]
        present, gained = self.paths[drone], 0.0
        for middle in range(-shift, self.steps, length):
            begin, end = max(middle, 0), min(middle + length, self.steps)
            steps = slice(begin, end)
            stretch = _Stretch(
                begin, by_others[steps], taken[steps], beliefs, [values[end] for values in ahead]
            )
            path = self._best(stretch, present, distort)
            left, found = self._found(beliefs, begin, _with(stretch.by_others, path))
            gain = found + self._worth_of(left, stretch.ahead)
            gain -= self._worth_of(beliefs, [values[begin] for values in ahead])
            if gain > LEAST_GAIN:
                gained += gain
                present.cells[begin : end + 1], present.searches[steps] = path
                beliefs = left
            else:
                beliefs, _ = self._found(beliefs, begin, schedule[steps])
        return gained

    # A stretch.

    def _best(
        self, stretch: _Stretch, present: Path, distort: Callable[[Floats], Floats] | None
    ) -> Path:
        """The path that the sum of gains makes look best, from where it begins to where it ends."""
        begin, n = stretch.begin, len(stretch.by_others)
        gains = np.zeros((n, *self._grid))
        worth = self._worth[begin : begin + n, None, None]
        for target, belief, ahead in zip(self.targets, stretch.beliefs, stretch.ahead, strict=True):
            masses, _ = self._forth(target, belief, begin, stretch.by_others)
            _, rest = self._back(target, ahead, begin, stretch.by_others)
            share = np.subtract(worth, rest)
            share *= np.array(masses[:-1])
            share *= target.weight * target.chain.detection
            gains += share
        np.maximum(gains, 0.0, out=gains)  # rounding
        if distort is not None:
            gains = distort(gains)
        at_end = np.zeros(self._grid)
        if begin + n < self.steps:
            at_end += NOWHERE
            at_end.reshape(-1)[present.cells[begin + n]] = 0.0
        values = values_to_go(gains, at_end, stretch.taken)
        return best_path(gains, values, int(present.cells[begin]), stretch.taken)

    def _worth_of(self, masses: Sequence[Floats], values: Sequence[Floats]) -> float:
        """What will be gained from all targets."""
        return sum(
            target.weight * float(np.vdot(mass, value))
            for target, mass, value in zip(self.targets, masses, values, strict=True)
        )

    # The two passes.

    def _found(
        self, beliefs: Sequence[Floats], begin: int, schedule: Schedule
    ) -> tuple[list[Floats], float]:
        """Who is left after some steps of all targets, and the worth of what was found."""
        left, total = [], 0.0
        worth = self._worth[begin : begin + len(schedule)]
        for target, belief in zip(self.targets, beliefs, strict=True):
            masses, found = self._forth(target, belief, begin, schedule)
            left.append(masses[-1])
            total += target.weight * float(worth @ found)
        return left, total

    def _forth(
        self, target: Target, mass: Floats, begin: int, schedule: Schedule
    ) -> tuple[list[Floats], Floats]:
        """Where a target is that has not been found.

        Args:
            target: the target.
            mass: the chances before step `begin` of the plan.
            begin: that step.
            schedule: what is searched from then on.

        Returns:
            The chances before each of these steps and after the last one, and the chance
            to be found in each.
        """
        q = target.chain.detection
        masses, found = [mass], np.zeros(len(schedule))
        for place, cells in enumerate(schedule):
            if cells:
                mass = mass.copy()
                flat = mass.reshape(-1)
                there = flat[cells]
                flat[cells] = (1.0 - q) * there
                found[place] = q * there.sum()
            mass = target.chain.forward(mass, self._first + begin + place)
            masses.append(mass)
        return masses, found

    def _back(
        self, target: Target, ahead: Floats | None, begin: int, schedule: Schedule
    ) -> tuple[list[Floats], list[Floats]]:
        """What will be gained from a target in each cell.

        Args:
            target: the target.
            ahead: that after the last of the steps; None where the plan ends.
            begin: the first of the steps.
            schedule: what is searched in them.

        Returns:
            That before each step and after the last one, and that after the searches of
            each step.
        """
        q = target.chain.detection
        value = np.zeros(self._grid) if ahead is None else ahead
        before, after = [value], []
        for place in range(len(schedule) - 1, -1, -1):
            value = target.chain.backward(value, self._first + begin + place)
            after.append(value)
            if cells := schedule[place]:
                value = value.copy()
                flat = value.reshape(-1)
                flat[cells] = (1.0 - q) * flat[cells] + q * self._worth[begin + place]
            before.append(value)
        return before[::-1], after[::-1]

    def _schedule(self) -> Schedule:
        return _schedule(self.paths, self.steps)


@dataclass
class _Stretch:
    """Some steps of a plan, in which one drone's path is to be changed.

    Attributes:
        begin: the first of them.
        by_others: what the other drones search in each.
        taken: where the others are after each.
        beliefs: where each target is before them.
        ahead: what will be gained from each target in each cell after them.
    """

    begin: int
    by_others: Schedule
    taken: list[list[int]]
    beliefs: Sequence[Floats]
    ahead: Sequence[Floats]


def _schedule(paths: Sequence[Path], steps: int) -> Schedule:
    schedule: Schedule = [[] for _ in range(steps)]
    for path in paths:
        cells = path.cells.tolist()
        for step in path.searches.nonzero()[0].tolist():
            schedule[step].append(cells[step])
    return schedule


def _with(schedule: Schedule, path: Path) -> Schedule:
    """A schedule with the searches of one more path."""
    cells, searches = path.cells.tolist(), path.searches.tolist()
    return [
        [*others, cell] if searched else others
        for others, cell, searched in zip(schedule, cells, searches, strict=False)
    ]
