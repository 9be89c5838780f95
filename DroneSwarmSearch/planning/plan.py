"""Open-loop plans for all drones together: the multi-robot path planning problem (MESPP).

With one person, every search before the find has the same outcome: nobody was found. The best
policy is therefore an open-loop plan, one path for each drone. Finding the best plan is NP-hard (K.
E. Trummel and J. R. Weisinger, Operations Research 34:324, 1986). `Plan` finds a good one:

- Adding a search of cell c in step t to a plan gains

      gain[t](c) = a[t](c) q (w[t] - r[t](c)),

  where a is the probability that the person is there and has not been found (forward pass), q
  the probability of detection, w[t] the worth of finding the person in that step, and r what
  the rest of the plan is expected to gain from a person in that cell (backward pass). This is
  exact for a single search, as in Brown's forward-and-backward algorithm (FAB; S. S. Brown,
  Operations Research 28:1275, 1980).
- The best path of a drone for given gains is a dynamic programme (`paths`). The sum of gains
  overrates a path that looks for the same person twice. So the plan changes one segment of one
  drone's path at a time, and only if its exact value increases.

No two drones are ever in one cell: each avoids the cells where the others will be.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch.drift.belief import after_search, over_hypotheses
from DroneSwarmSearch.drift.markov_chain import MarkovChain
from DroneSwarmSearch.planning.paths import FORBIDDEN, Path, best_path, values_to_go

__all__ = ["Plan", "Target", "idle_paths"]

Floats = NDArray[np.float64]

Schedule = list[list[int]]
"""The cells searched in each step, y * N + x."""

MIN_GAIN = 1e-9
"""Smaller improvements are rounding errors."""


@dataclass
class Target:
    """A missing person.

    Attributes:
        chain: the person's steps.
        detection: the probability of detection.
        belief: the person's distribution at the plan's first step: float64, shape (M, N, N),
            indexed [hypothesis, y, x].
        weight: the weight of finding this person in the plan's value.
    """

    chain: MarkovChain
    detection: float
    belief: Floats
    weight: float = 1.0


def idle_paths(starts: Sequence[int], steps: int) -> list[Path]:
    """Paths of drones that stay in their cells, y * N + x, without searching."""
    return [Path(np.full(steps + 1, cell), np.zeros(steps, np.bool_)) for cell in starts]


class Plan:
    """The drones' paths over the next n steps.

    Args:
        targets: the missing persons.
        worth: the worth of a find in each step of the plan: float64, shape (n,), non-increasing.
        first: the episode's step at which the plan begins.
        paths: every drone's path; no two drones are ever in one cell.

    Attributes:
        targets: the same; their weights may be changed.
        paths: the current paths.
    """

    def __init__(
        self, targets: Sequence[Target], worth: Floats, first: int, paths: Sequence[Path]
    ) -> None:
        self.targets = targets
        self._worth = worth
        self._first = first
        self._grid = targets[0].belief.shape[1:]
        self.paths = [Path(path.cells.copy(), path.searches.copy()) for path in paths]

    @property
    def steps(self) -> int:
        """The number of steps planned, n."""
        return len(self._worth)

    def success_probabilities(self) -> list[float]:
        """The probability that the plan finds each target (POS)."""
        schedule = _schedule(self.paths, self.steps)
        return [float(self._forward(t, t.belief, 0, schedule)[1].sum()) for t in self.targets]

    def value(self) -> float:
        """The expected worth of all finds."""
        beliefs = [target.belief for target in self.targets]
        return self._follow(beliefs, 0, _schedule(self.paths, self.steps))[1]

    def improve(self, *, min_length: int, min_gain: float, max_rounds: int) -> None:
        """Improve segments of full length, half of it and so on, in rounds.

        Args:
            min_length: minimum length of the segments, in steps.
            min_gain: stop after a round that gains less.
            max_rounds: the largest number of rounds.
        """
        lengths = [self.steps]
        while lengths[-1] > min_length:
            lengths.append(max(lengths[-1] // 2, min_length))
        for number in range(max_rounds):
            gained = 0.0
            for length in lengths:
                offset = number * length // 2 % length
                for drone in range(len(self.paths)):
                    gained += self.improve_path(drone, length, offset)
            if gained < min_gain:
                break

    def perturb(self, rng: np.random.Generator) -> None:
        """Improve every drone's whole path with randomly distorted gains.

        Plans that start from different perturbations improve to different local optima.
        """
        for drone in range(len(self.paths)):
            self.improve_path(
                drone,
                self.steps,
                distort=lambda gains: gains * np.exp(rng.normal(size=gains.shape)),
            )

    def improve_path(
        self,
        drone: int,
        length: int,
        offset: int = 0,
        distort: Callable[[Floats], Floats] | None = None,
    ) -> float:
        """Improve one drone's path segment by segment, from beginning to end.

        Args:
            drone: its number.
            length: length of the segments, in steps.
            offset: how many steps shorter the first segment is.
            distort: changes the gains before the best path is computed.

        Returns:
            How much the plan's value has increased.
        """
        others = [path for other, path in enumerate(self.paths) if other != drone]
        by_others = _schedule(others, self.steps)
        blocked = [[int(path.cells[step + 1]) for path in others] for step in range(self.steps)]
        schedule = _schedule(self.paths, self.steps)
        to_go = [self._backward(target, None, 0, schedule)[0] for target in self.targets]
        beliefs = [target.belief for target in self.targets]
        path, gained = self.paths[drone], 0.0
        for first in range(-offset, self.steps, length):
            begin, end = max(first, 0), min(first + length, self.steps)
            steps = slice(begin, end)
            after = [values[end] for values in to_go]
            gains = self._gains(begin, by_others[steps], beliefs, after)
            if distort is not None:
                gains = distort(gains)
            candidate = self._best_segment(path, begin, gains, blocked[steps])
            left, found = self._follow(beliefs, begin, _added(by_others[steps], candidate))
            gain = found + self._expected(left, after)
            gain -= self._expected(beliefs, [values[begin] for values in to_go])
            if gain > MIN_GAIN:
                gained += gain
                path.cells[begin : end + 1], path.searches[steps] = candidate
                beliefs = left
            else:
                beliefs, _ = self._follow(beliefs, begin, schedule[steps])
        return gained

    def _gains(
        self, begin: int, schedule: Schedule, beliefs: Sequence[Floats], after: Sequence[Floats]
    ) -> Floats:
        """The gain of one more search of each cell in each step of a segment.

        Args:
            begin: the first of the steps.
            schedule: the searches in them.
            beliefs: probability that each target is in each cell and unfound, before them.
            after: what the plan will gain from every target in each cell after them.

        Returns:
            float64, shape (n, N, N), indexed [t, y, x].
        """
        gains = np.zeros((len(schedule), *self._grid))
        worth = self._worth[begin : begin + len(schedule), None, None, None]
        for target, belief, value in zip(self.targets, beliefs, after, strict=True):
            masses, _ = self._forward(target, belief, begin, schedule)
            _, rest = self._backward(target, value, begin, schedule)
            gain = np.subtract(worth, rest)
            gain *= np.array(masses[:-1])
            gain *= target.weight * target.detection
            gains += over_hypotheses(gain.swapaxes(0, 1))
        return np.maximum(gains, 0.0, out=gains)  # rounding errors

    def _best_segment(
        self, path: Path, begin: int, gains: Floats, blocked: list[list[int]]
    ) -> Path:
        """The segment with the largest sum of gains that connects to the rest of a path."""
        end = begin + len(gains)
        at_end = np.zeros(self._grid)
        if end < self.steps:
            at_end += FORBIDDEN
            at_end.reshape(-1)[path.cells[end]] = 0.0
        values = values_to_go(gains, at_end, blocked)
        return best_path(gains, values, int(path.cells[begin]), blocked)

    def _expected(self, masses: Sequence[Floats], values: Sequence[Floats]) -> float:
        """The expected gain from all targets, given where they are and each cell's value."""
        return sum(
            target.weight * float(np.vdot(mass, value))
            for target, mass, value in zip(self.targets, masses, values, strict=True)
        )

    def _follow(
        self, beliefs: Sequence[Floats], begin: int, schedule: Schedule
    ) -> tuple[list[Floats], float]:
        """Where every unfound target is after the given searches, and the worth of the finds."""
        left, total = [], 0.0
        worth = self._worth[begin : begin + len(schedule)]
        for target, belief in zip(self.targets, beliefs, strict=True):
            masses, found = self._forward(target, belief, begin, schedule)
            left.append(masses[-1])
            total += target.weight * float(worth @ found)
        return left, total

    def _forward(
        self, target: Target, mass: Floats, begin: int, schedule: Schedule
    ) -> tuple[list[Floats], Floats]:
        """The forward pass: where an unfound target is.

        Args:
            target: the target.
            mass: probability that it is in each cell and unfound, before step `begin`.
            begin: a step of the plan.
            schedule: the searches from then on.

        Returns:
            The mass before each of these steps and after the last one, and the probability
            of finding the target in each step.
        """
        masses, found = [mass], np.zeros(len(schedule))
        for index, cells in enumerate(schedule):
            mass, found[index] = after_search(mass, cells, target.detection)
            mass = target.chain.forward(mass, self._first + begin + index)
            masses.append(mass)
        return masses, found

    def _backward(
        self, target: Target, value: Floats | None, begin: int, schedule: Schedule
    ) -> tuple[list[Floats], list[Floats]]:
        """The backward pass: what the plan will gain from a target in each cell.

        Args:
            target: the target.
            value: the value of each cell after the last step; None at the end of the plan.
            begin: the first of the steps.
            schedule: the searches in them.

        Returns:
            The values before each step and after the last one, and the values after the
            searches of each step.
        """
        q = target.detection
        if value is None:
            value = np.zeros_like(target.belief)
        before, after = [value], []
        for index in range(len(schedule) - 1, -1, -1):
            value = target.chain.backward(value, self._first + begin + index)
            after.append(value)
            if cells := schedule[index]:
                value = value.copy()
                for flat in value.reshape(len(value), -1):
                    flat[cells] = (1.0 - q) * flat[cells] + q * self._worth[begin + index]
            before.append(value)
        return before[::-1], after[::-1]


def _schedule(paths: Sequence[Path], steps: int) -> Schedule:
    """The cells that the paths search in each step."""
    schedule: Schedule = [[] for _ in range(steps)]
    for path in paths:
        cells = path.cells.tolist()
        for step in path.searches.nonzero()[0].tolist():
            schedule[step].append(cells[step])
    return schedule


def _added(schedule: Schedule, path: Path) -> Schedule:
    """A schedule together with the searches of one more path."""
    cells, searches = path.cells.tolist(), path.searches.tolist()
    return [
        [*others, cell] if searched else others
        for others, cell, searched in zip(schedule, cells, searches, strict=False)
    ]
