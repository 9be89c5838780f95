"""Open-loop plans for all drones together: the multi-robot path planning problem (MESPP).

Adding a search of cell c in step t to a plan gains

    gain[t](c) = a[t](c) q (w[t] - r[t](c)),

where a is the probability that the person is there and has not been found (forward pass), q the
probability of detection, w[t] the worth of finding the person in that step, and r what the rest of
the plan is expected to gain from a person in that cell (backward pass; S. S. Brown, Operations
Research 28:1275, 1980). The best path for given gains is a dynamic programme (`paths`). The sum of
gains overrates a path that looks for the same person twice, so a plan changes one segment of one
drone's path at a time (`segments`), and only if its exact value increases. Then it distorts the
gains of a segment at random, improves the steps around it again, and keeps the result unless it is
worse (large neighbourhood search; P. Shaw, CP 1998).

No two drones are ever in one cell: each avoids the cells where the others will be.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence

import numpy as np

from DroneSwarmSearch._internal.arrays import Floats
from DroneSwarmSearch.planning.passes import Passes, Target
from DroneSwarmSearch.planning.paths import FORBIDDEN, Path, best_path, values_to_go
from DroneSwarmSearch.planning.segments import Segment, reach_of

Distortion = Callable[[Floats], Floats]
"""Changes the gains of a segment."""

Report = Callable[[float], None]
"""Is called from time to time with the completed fraction of some work."""

MIN_GAIN = 1e-9
"""Smaller improvements are rounding errors."""

STRENGTHS = (0.2, 0.5, 1.0)
"""Standard deviations of the logarithm of the factors that distort gains."""

SHORTEST, LONGEST = 3, 10
"""Lengths of a distorted segment, in steps."""

NEAREST = 3
"""The number of drones whose paths are improved around a distorted segment."""

SEGMENT_WORK, STEP_WORK = 6000, 1200
"""The fixed work for a segment and for each of its steps, in cells that take as long."""


def idle_paths(starts: Sequence[int], steps: int) -> list[Path]:
    """Paths of drones that stay in their cells, y * N + x, without searching."""
    return [Path(np.full(steps + 1, cell), np.zeros(steps, np.bool_)) for cell in starts]


class Plan:
    """The drones' paths over the next n steps, from the episode's step `first` on.

    With `in_flight`, drones search in every even step of the episode, and in no other.

    Attributes:
        paths: the current paths; no two drones are ever in one cell.
        work: the work done to improve the plan, in steps times cells.
        round_work: the work of one round of improvement with short segments, about.
    """

    def __init__(
        self,
        targets: Sequence[Target],
        first: int,
        paths: Sequence[Path],
        *,
        in_flight: bool = False,
    ) -> None:
        self.work, self._steps, self._size = 0, len(targets[0].worth), targets[0].belief.shape[-1]
        self.paths = [Path(path.cells.copy(), path.searches.copy()) for path in paths]
        self._passes = [Passes(target, first, self.paths) for target in targets]
        self._stays = np.arange(first, first + self._steps) % 2 == 0 if in_flight else None
        cells = sum(target.belief.size for target in targets)
        self.round_work = len(paths) * self._steps * (STEP_WORK + cells)

    def found(self) -> list[Floats]:
        """The probability that the plan finds each target in each step, (n,)."""
        return [passes.found() for passes in self._passes]

    def value(self) -> float:
        """The expected worth of all finds."""
        return sum(float(passes.target.worth @ passes.found()) for passes in self._passes)

    def improve(
        self,
        *,
        min_length: int,
        min_gain: float,
        max_rounds: int,
        begin: int = 0,
        end: int | None = None,
        max_length: int | None = None,
        drones: Sequence[int] | None = None,
        report: Report = lambda fraction: None,
    ) -> float:
        """Improve segments of full length, half of it and so on; returns the value gained.

        Args:
            min_length: minimum length of the segments, in steps.
            min_gain: stop after a round that gains less.
            max_rounds: the largest number of rounds.
            begin: the first step to change.
            end: the step before which changes end; by default the plan's end.
            max_length: maximum length of the segments.
            drones: those whose paths may change; all by default.
            report: called from time to time with the completed fraction of `max_rounds`.
        """
        end = self._steps if end is None else end
        drones = range(len(self.paths)) if drones is None else drones
        lengths = [min(max_length or end - begin, end - begin)]
        while lengths[-1] > min_length:
            lengths.append(max(lengths[-1] // 2, min_length))
        total, direction = 0.0, 1
        for number in range(max_rounds):
            gained = 0.0
            for place, length in enumerate(lengths):
                firsts = range(begin - number * length // 2 % length, end, length)
                # The passes are up to date where the last sweep ended.
                for first in firsts[::direction]:
                    report((number + place / len(lengths)) / max_rounds)
                    for drone in drones:
                        segment = max(first, begin), min(first + length, end)
                        gained += self.improve_segment(drone, *segment)
                direction = -direction
            total += gained
            if gained < min_gain:
                break
        return total

    def improve_segment(
        self, drone: int, begin: int, end: int, distort: Distortion | None = None
    ) -> float:
        """Improve a drone's path from one step until before another; returns the value gained.

        `distort` changes the gains before the best path is computed; the value may then fall.
        """
        old = self._segment(drone, begin, end)
        start, goal = int(old.cells[0]), None if end == self._steps else int(old.cells[-1])
        stays = None if self._stays is None else self._stays[begin:end]
        moves = end - begin if stays is None else int(np.sum(~stays))
        reach = reach_of(start, goal, moves, self._size)
        parts = [Segment(passes, old, begin, reach) for passes in self._passes]
        self.work += SEGMENT_WORK + (end - begin) * (STEP_WORK + sum(part.cells for part in parts))
        gains = np.zeros((end - begin, *reach.shape))
        for part in parts:
            part.add_gains(gains)
        np.maximum(gains, 0.0, out=gains)  # rounding errors
        if stays is not None:
            gains[~stays] = 0.0
        if distort is not None:
            gains = distort(gains)
        elif not gains.any():
            return 0.0
        # The path is one of cells in reach: row and column there, and the number.
        paths = np.array([path.cells[begin : end + 1] for path in self.paths])
        y, x, inside = reach.local(paths)
        numbers = np.where(inside, y * reach.shape[1] + x, -1)
        others = [ahead for which, (_, *ahead) in enumerate(numbers.tolist()) if which != drone]
        blocked = [[cell for cell in cells if cell >= 0] for cells in zip(*others, strict=True)]
        at_end = np.zeros(reach.shape)
        if goal is not None:
            at_end += FORBIDDEN
            at_end.reshape(-1)[numbers[drone, -1]] = 0.0
        values = values_to_go(gains, at_end, blocked, stays)
        cells, searches = best_path(gains, values, int(numbers[drone, 0]), blocked, stays)
        rows, columns = np.divmod(cells, reach.shape[1])
        new = Path((rows + reach.top) * self._size + columns + reach.left, searches)
        if np.array_equal(new.cells, old.cells) and np.array_equal(new.searches, old.searches):
            return 0.0
        gain = sum(part.gain(new) for part in parts)
        if gain <= MIN_GAIN and distort is None:
            return 0.0
        self._replace(drone, begin, new)
        return gain

    def _segment(self, drone: int, begin: int, end: int) -> Path:
        """A part of a drone's path; a view."""
        path = self.paths[drone]
        return Path(path.cells[begin : end + 1], path.searches[begin:end])

    def _replace(self, drone: int, begin: int, new: Path) -> None:
        """Replace a segment of a drone's path."""
        old = self._segment(drone, begin, begin + len(new.searches))
        for passes in self._passes:
            passes.replace(old, new, begin)
        old.cells[:], old.searches[:] = new

    def perturb(self, rng: np.random.Generator) -> None:
        """Improve every drone's whole path with randomly distorted gains."""
        for drone in range(len(self.paths)):
            self.improve_segment(
                drone, 0, self._steps, lambda gains: gains * np.exp(rng.normal(size=gains.shape))
            )

    def explore(
        self, rng: np.random.Generator, work: float, report: Report = lambda fraction: None
    ) -> None:
        """Distort short segments at random, improve around them, and keep what is not worse."""
        begin_work = self.work
        while self.work < begin_work + work:
            report((self.work - begin_work) / work)
            length = min(int(rng.integers(SHORTEST, LONGEST + 1)), self._steps)
            begin = int(rng.integers(self._steps - length + 1))
            first, last = max(begin - length // 4, 0), min(begin + length * 5 // 4, self._steps)
            near = self._nearest(int(rng.integers(len(self.paths))), begin + length // 2)
            strength = float(rng.choice(STRENGTHS))

            def distort(gains: Floats, strength: float = strength) -> Floats:
                return gains * np.exp(strength * rng.normal(size=gains.shape))

            before = copy.deepcopy({d: self._segment(d, first, last) for d in sorted(near)})
            gained = sum(
                self.improve_segment(drone, begin, begin + length, distort)
                for drone in near[: int(rng.integers(1, 3))]
            )
            gained += self.improve(
                min_length=SHORTEST, min_gain=0.0, max_rounds=1, begin=first, end=last, drones=near
            )
            if gained < 0.0:
                for drone, old in before.items():
                    self._replace(drone, first, old)

    def _nearest(self, drone: int, step: int) -> list[int]:
        """A drone and those nearest to it in a step, `NEAREST` in all."""
        y, x = np.divmod([path.cells[step] for path in self.paths], self._size)
        distances = abs(y - y[drone]) + abs(x - x[drone])
        nearest: list[int] = distances.argsort(kind="stable")[:NEAREST].tolist()
        return nearest
