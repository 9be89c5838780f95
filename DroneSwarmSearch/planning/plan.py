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
- When no segment improves, the plan distorts the gains of one segment at random, improves the
  steps around it again, and keeps the result if it is better (large neighbourhood search; P. Shaw,
  CP 1998).

Removing or adding the searches of a segment changes the passes only near the segment. A drone
that gets from one end to the other in L steps stays in a box, and a person who leaves the box must
come back to be searched again, so a margin of L / 2 cells around it makes the passes exact.

No two drones are ever in one cell: each avoids the cells where the others will be.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch.drift.belief import over_hypotheses
from DroneSwarmSearch.drift.markov_chain import MarkovChain
from DroneSwarmSearch.planning.paths import FORBIDDEN, Path, best_path, values_to_go

__all__ = ["Plan", "Report", "Target", "idle_paths"]

Floats = NDArray[np.float64]

Distortion = Callable[[Floats], Floats]
"""Changes the gains of a segment."""

Report = Callable[[float], None]
"""Is called from time to time with the completed fraction of some work."""

MIN_GAIN = 1e-9
"""Smaller improvements are rounding errors."""

NEGLIGIBLE = 1e-13
"""A cell with less probability cannot make a plan better."""

STRENGTHS = (0.2, 0.5, 1.0)
"""Standard deviations of the logarithm of the factors that distort gains."""

NEAREST = 3
"""The number of drones whose paths are improved around a distorted segment."""

SEGMENT_WORK, STEP_WORK = 6000, 1200
"""The fixed work for a segment and for each of its steps, in cells that take as long."""


@dataclass
class Target:
    """A missing person.

    Attributes:
        chain: the person's steps.
        detection: the probability of detection.
        belief: the person's distribution at the plan's first step: float64, shape (M, N, N),
            indexed [hypothesis, y, x].
        worth: the worth of finding this person in each step of the plan: float64, shape (n,).
        unfound: the worth of the person's being in a cell, unfound, at the beginning of each
            step and after the last one: float64, shape (n + 1, M, N, N); None for 0.
    """

    chain: MarkovChain
    detection: float
    belief: Floats
    worth: Floats
    unfound: Floats | None = None


def idle_paths(starts: Sequence[int], steps: int) -> list[Path]:
    """Paths of drones that stay in their cells, y * N + x, without searching."""
    return [Path(np.full(steps + 1, cell), np.zeros(steps, np.bool_)) for cell in starts]


class _Passes:
    """The forward and backward pass of one target, computed as far as they are needed.

    Attributes:
        kept: the probability that the searches of a step miss the person in a cell, by step:
            shape (n, N, N).
        masses: the probability that the person is in a cell, and unfound, before each step and
            after the last: shape (n + 1, M, N, N).
        rests: what the plan is expected to gain from a person in a cell after the searches of
            each step: shape (n, M, N, N).
    """

    def __init__(self, target: Target, first: int, paths: Sequence[Path]) -> None:
        n, grid = len(target.worth), target.belief.shape[1:]
        self.target = target
        self._first = first
        self.kept = np.ones((n, *grid))
        self.masses = np.empty((n + 1, *target.belief.shape))
        self.masses[0] = target.belief
        self.rests = np.empty((n, *target.belief.shape))
        self._masses_to = 0  # masses are up to date until this step
        self._rests_from = n  # rests are up to date from this step
        self._extents: NDArray[np.int64] | None = None  # see `likely`
        for path in paths:
            self.change(path, 0, self.target.detection)

    def change(self, path: Path, begin: int, detection: float) -> None:
        """Add the searches of a path that begins in a step; a detection of 0 removes them."""
        steps = path.searches.nonzero()[0]
        flat = self.kept.reshape(len(self.kept), -1)
        flat[begin + steps, path.cells[steps]] = 1.0 - detection

    def is_changed(self, begin: int, end: int) -> None:
        """Note that searches from step `begin` to before step `end` are others."""
        self._masses_to = min(self._masses_to, begin)
        self._rests_from = max(self._rests_from, end - 1)

    def matrices(self, step: int) -> tuple[Floats, Floats]:
        return self.target.chain.matrices(self._first + step)

    def forward_to(self, step: int) -> None:
        """Bring the masses up to date until before a step."""
        for now in range(self._masses_to, step):
            along_x, along_y = self.matrices(now)
            mass = self.masses[now] * self.kept[now]
            np.matmul(along_y.swapaxes(1, 2) @ mass, along_x, out=self.masses[now + 1])
        self._masses_to = max(self._masses_to, step)

    def backward_to(self, step: int) -> None:
        """Bring the rests up to date from a step on."""
        for now in range(self._rests_from - 1, step - 1, -1):
            along_x, along_y = self.matrices(now)
            value = self.value_before(now + 1)
            np.matmul(along_y @ value, along_x.swapaxes(1, 2), out=self.rests[now])
        self._rests_from = min(self._rests_from, step)

    def value_before(self, step: int) -> Floats:
        """What the plan is expected to gain from a person in each cell before a step."""
        target = self.target
        value = np.zeros_like(target.belief)
        if step < len(self.kept):
            kept = self.kept[step]
            value = kept * self.rests[step] + (1.0 - kept) * target.worth[step]
        if target.unfound is not None:
            value = value + target.unfound[step]
        return value

    def likely(self, begin: int, end: int) -> _Box:
        """The smallest box of all cells that are not negligible in some steps, without searches.

        A search that looks useless may find the person once an earlier one is removed.
        """
        if self._extents is None:
            self._extents = self._unsearched_extents()
        top, bottom, left, right = self._extents[:, begin:end]
        size = self.kept.shape[-1]
        return _Box(int(top.min()), int(bottom.max()), int(left.min()), int(right.max()), size)

    def _unsearched_extents(self) -> NDArray[np.int64]:
        """First row, last row + 1, first column and last column + 1 of the forecast, by step."""
        mass, extents = self.target.belief, []
        for step in range(len(self.kept)):
            is_likely = mass.max(axis=0) > NEGLIGIBLE
            rows, columns = is_likely.any(axis=1).nonzero()[0], is_likely.any(axis=0).nonzero()[0]
            extents.append((rows[0], rows[-1] + 1, columns[0], columns[-1] + 1))
            mass = self.target.chain.forward(mass, self._first + step)
        return np.array(extents).T

    def found(self) -> Floats:
        """The probability of finding the person in each step."""
        self.forward_to(len(self.kept))
        masses = self.masses[:-1].sum(axis=1) if self.masses.shape[1] > 1 else self.masses[:-1, 0]
        found: Floats = ((1.0 - self.kept) * masses).sum(axis=(1, 2))
        return found

    def value(self) -> float:
        """The expected worth of finding the person, and of not finding the person."""
        total = float(self.target.worth @ self.found())
        if self.target.unfound is not None:
            total += float(np.vdot(self.masses, self.target.unfound))
        return total


class Plan:
    """The drones' paths over the next n steps.

    Args:
        targets: the missing persons.
        first: the episode's step at which the plan begins.
        paths: every drone's path; no two drones are ever in one cell.

    Attributes:
        targets: the same.
        paths: the current paths.
        work: the work done to improve the plan, in steps times cells.
    """

    def __init__(self, targets: Sequence[Target], first: int, paths: Sequence[Path]) -> None:
        self.targets = targets
        self.work = 0
        self._grid = targets[0].belief.shape[1:]
        self.paths = [Path(path.cells.copy(), path.searches.copy()) for path in paths]
        self._passes = [_Passes(target, first, self.paths) for target in targets]

    @property
    def steps(self) -> int:
        """The number of steps planned, n."""
        return len(self.paths[0].searches)

    def found(self) -> list[Floats]:
        """The probability of finding each target in each step, shape (n,)."""
        return [passes.found() for passes in self._passes]

    def masses(self) -> list[Floats]:
        """The probability that each target is in a cell, and unfound.

        float64, shape (n + 1, M, N, N): before each step and after the last; do not change it.
        """
        for passes in self._passes:
            passes.forward_to(self.steps)
        return [passes.masses for passes in self._passes]

    def values(self) -> list[Floats]:
        """What the plan is expected to gain from each target in a cell before its first step.

        float64, shape (M, N, N).
        """
        for passes in self._passes:
            passes.backward_to(0)
        return [passes.value_before(0) for passes in self._passes]

    def success_probabilities(self) -> list[float]:
        """The probability that the plan finds each target (POS)."""
        return [float(found.sum()) for found in self.found()]

    def value(self) -> float:
        """The expected worth of all finds."""
        return sum(passes.value() for passes in self._passes)

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
        """Improve segments of full length, half of it and so on, in rounds.

        Args:
            min_length: minimum length of the segments, in steps.
            min_gain: stop after a round that gains less.
            max_rounds: the largest number of rounds.
            begin: the first step to change.
            end: the step before which changes end; the number of steps by default.
            max_length: maximum length of the segments, the number of these steps by default.
            drones: the drones whose paths may change; all by default.
            report: called from time to time with the completed fraction of `max_rounds`.

        Returns:
            How much the plan's value has increased.
        """
        end = self.steps if end is None else end
        lengths = [min(max_length or end - begin, end - begin)]
        while lengths[-1] > min_length:
            lengths.append(max(lengths[-1] // 2, min_length))
        total, is_forward = 0.0, True
        for number in range(max_rounds):
            gained = 0.0
            for place, length in enumerate(lengths):
                offset = number * length // 2 % length
                firsts = range(begin - offset, end, length)
                # The passes are up to date where the last sweep ended.
                for first in firsts if is_forward else reversed(firsts):
                    report((number + place / len(lengths)) / max_rounds)
                    for drone in range(len(self.paths)) if drones is None else drones:
                        segment = max(first, begin), min(first + length, end)
                        gained += self.improve_segment(drone, *segment)
                is_forward = not is_forward
            total += gained
            if gained < min_gain:
                break
        return total

    def improve_segment(
        self, drone: int, begin: int, end: int, distort: Distortion | None = None
    ) -> float:
        """Improve a segment of one drone's path.

        Args:
            drone: its number.
            begin: the segment's first step.
            end: the step before which it ends.
            distort: changes the gains before the best path is computed; the result may then be
                worse.

        Returns:
            How much the plan's value has increased.
        """
        size = self._grid[1]
        path = self.paths[drone]
        old = Path(path.cells[begin : end + 1], path.searches[begin:end])
        is_last = end == self.steps
        reach = _reach(
            int(old.cells[0]), None if is_last else int(old.cells[-1]), end - begin, size
        )
        parts = [_Segment(passes, old, begin, end, reach) for passes in self._passes]
        self.work += SEGMENT_WORK + (end - begin) * (STEP_WORK + sum(part.cells for part in parts))
        gains = np.zeros((end - begin, *reach.shape))
        for part in parts:
            part.add_gains(gains)
        np.maximum(gains, 0.0, out=gains)  # rounding errors
        if distort is not None:
            gains = distort(gains)
        elif not gains.any():
            return 0.0
        others = [other for number, other in enumerate(self.paths) if number != drone]
        blocked = None
        if others:
            ahead = np.array([other.cells[begin + 1 : end + 1] for other in others])
            blocked = reach.inside(ahead)
        at_end = np.zeros(reach.shape)
        if not is_last:
            at_end += FORBIDDEN
            at_end.reshape(-1)[reach.to_local(int(old.cells[-1]))] = 0.0
        values = values_to_go(gains, at_end, blocked)
        new = best_path(gains, values, reach.to_local(int(old.cells[0])), blocked)
        new = Path(reach.to_grid(new.cells), new.searches)
        if np.array_equal(new.cells, old.cells) and np.array_equal(new.searches, old.searches):
            return 0.0
        gain = sum(part.gain(new) for part in parts)
        if gain <= MIN_GAIN and distort is None:
            return 0.0
        self._replace(drone, begin, new)
        return gain

    def _replace(self, drone: int, begin: int, new: Path) -> None:
        """Replace a segment of a drone's path."""
        path, end = self.paths[drone], begin + len(new.searches)
        old = Path(path.cells[begin : end + 1], path.searches[begin:end])
        for passes in self._passes:
            passes.change(old, begin, 0.0)
            passes.change(new, begin, passes.target.detection)
            passes.is_changed(begin, end)
        path.cells[begin : end + 1], path.searches[begin:end] = new

    def perturb(self, rng: np.random.Generator) -> None:
        """Improve every drone's whole path with randomly distorted gains.

        Plans that start from different perturbations improve to different local optima.
        """
        for drone in range(len(self.paths)):
            self.improve_segment(
                drone, 0, self.steps, lambda gains: gains * np.exp(rng.normal(size=gains.shape))
            )

    @property
    def round_work(self) -> int:
        """The work of one round of improvement with short segments, about."""
        cells = sum(target.belief.size for target in self.targets)
        return len(self.paths) * self.steps * (STEP_WORK + cells)

    def explore(
        self,
        rng: np.random.Generator,
        work: float,
        *,
        lengths: tuple[int, int] = (3, 10),
        report: Report = lambda fraction: None,
    ) -> None:
        """Distort short segments at random, improve around them, and keep what is not worse.

        Args:
            rng: the source of random numbers.
            work: how much to do, see the attribute `work`.
            lengths: the smallest and the largest length of a distorted segment, in steps.
            report: called from time to time with the completed fraction of the work.
        """
        begin_work = self.work
        while self.work < begin_work + work:
            report((self.work - begin_work) / work)
            length = min(int(rng.integers(lengths[0], lengths[1] + 1)), self.steps)
            begin = int(rng.integers(self.steps - length + 1))
            first, last = max(begin - length // 4, 0), min(begin + length * 5 // 4, self.steps)
            near = self._nearest(int(rng.integers(len(self.paths))), begin + length // 2)
            strength = float(rng.choice(STRENGTHS))

            def distort(gains: Floats, strength: float = strength) -> Floats:
                return gains * np.exp(strength * rng.normal(size=gains.shape))

            before = {
                drone: Path(path.cells[first : last + 1].copy(), path.searches[first:last].copy())
                for drone, path in enumerate(self.paths)
                if drone in near
            }
            gained = sum(
                self.improve_segment(drone, begin, begin + length, distort)
                for drone in near[: int(rng.integers(1, 3))]
            )
            gained += self.improve(
                min_length=lengths[0],
                min_gain=0.0,
                max_rounds=1,
                begin=first,
                end=last,
                drones=near,
            )
            if gained < 0.0:
                for drone, old in before.items():
                    self._replace(drone, first, old)

    def _nearest(self, drone: int, step: int) -> list[int]:
        """A drone and those nearest to it in a step, `NEAREST` in all."""
        cells = np.array([path.cells[step] for path in self.paths])
        y, x = np.divmod(cells, self._grid[1])
        distances = abs(y - y[drone]) + abs(x - x[drone])
        nearest: list[int] = distances.argsort(kind="stable")[:NEAREST].tolist()
        return nearest


@dataclass(frozen=True)
class _Box:
    """A rectangle of cells: rows top to before bottom, columns left to before right."""

    top: int
    bottom: int
    left: int
    right: int
    size: int

    @property
    def shape(self) -> tuple[int, int]:
        return max(self.bottom - self.top, 0), max(self.right - self.left, 0)

    @property
    def rows(self) -> slice:
        return slice(self.top, self.bottom)

    @property
    def columns(self) -> slice:
        return slice(self.left, self.right)

    def grown(self, margin: int) -> _Box:
        """The box with a margin, on the grid."""
        return _Box(
            max(self.top - margin, 0),
            min(self.bottom + margin, self.size),
            max(self.left - margin, 0),
            min(self.right + margin, self.size),
            self.size,
        )

    def common(self, other: _Box) -> _Box:
        """The cells in both boxes."""
        return _Box(
            max(self.top, other.top),
            min(self.bottom, other.bottom),
            max(self.left, other.left),
            min(self.right, other.right),
            self.size,
        )

    def to_local(self, cell: int) -> int:
        """The number of a grid cell within the box."""
        y, x = divmod(cell, self.size)
        return (y - self.top) * (self.right - self.left) + x - self.left

    def to_grid(self, cells: NDArray[np.int64]) -> NDArray[np.int64]:
        """The grid cells of cells within the box."""
        y, x = np.divmod(cells, self.right - self.left)
        return (y + self.top) * self.size + x + self.left

    def inside(self, cells: NDArray[np.int64]) -> list[list[int]]:
        """For each column of grid cells, the numbers within the box of those inside it."""
        y, x = np.divmod(cells, self.size)
        is_inside = (self.top <= y) & (y < self.bottom) & (self.left <= x) & (x < self.right)
        local = (y - self.top) * (self.right - self.left) + x - self.left
        result: list[list[int]] = [[] for _ in range(cells.shape[1])]
        for which, step in zip(*is_inside.nonzero(), strict=True):
            result[step].append(int(local[which, step]))
        return result


def _reach(start: int, goal: int | None, steps: int, size: int) -> _Box:
    """The cells on the way from a start cell to a goal, in a number of steps."""
    y, x = divmod(start, size)
    if goal is None:
        return _Box(y, y + 1, x, x + 1, size).grown(steps)
    to_y, to_x = divmod(goal, size)
    slack = (steps - abs(to_y - y) - abs(to_x - x)) // 2
    box = _Box(min(y, to_y), max(y, to_y) + 1, min(x, to_x), max(x, to_x) + 1, size)
    return box.grown(slack)


class _Segment:
    """What one target contributes to the gains of a segment of one drone's path."""

    def __init__(self, passes: _Passes, old: Path, begin: int, end: int, reach: _Box) -> None:
        passes.forward_to(end - 1)
        passes.backward_to(begin)
        self._passes, self._begin, self._reach = passes, begin, reach
        masses = passes.masses[begin:end]
        box = reach.grown((end - begin) // 2).common(passes.likely(begin, end))
        self._box = box
        self.cells = 0
        if not all(box.shape):
            return
        where = (slice(None), slice(None), box.rows, box.columns)
        self.cells = masses[0][where[1:]].size
        q, worth = passes.target.detection, passes.target.worth[begin:end]
        self._matrices = []
        for step in range(begin, end):
            along_x, along_y = passes.matrices(step)
            self._matrices.append(
                (along_x[:, box.columns, box.columns], along_y[:, box.rows, box.rows])
            )
        self._kept = passes.kept[begin:end, box.rows, box.columns].copy()
        searches = self._local(old)
        for step, y, x in searches:
            self._kept[step, y, x] = 1.0
        # Without the drone's own searches:
        self._masses, self._rests = masses[where].copy(), passes.rests[begin:end][where].copy()
        left: Floats | None = None
        last = end - begin - 1
        at = {step: (y, x) for step, y, x in searches}
        for step in range(last + 1):
            search = at.get(step)
            if left is not None:
                after = left * self._kept[step]
            elif search is not None:
                after = np.zeros_like(self._masses[0])
            else:
                continue
            if search is not None:
                after[(slice(None), *search)] += q * self._masses[(step, slice(None), *search)]
            if left is not None:
                self._masses[step] += left
            if step < last:
                along_x, along_y = self._matrices[step]
                left = along_y.swapaxes(1, 2) @ after @ along_x
        fewer: Floats | None = None
        self._old_gain = 0.0
        for step in range(last, -1, -1):
            search = at.get(step)
            if fewer is not None:
                before = fewer * self._kept[step]
            elif search is not None:
                before = np.zeros_like(self._rests[0])
            else:
                continue
            if search is not None:
                here = (step, slice(None), *search)
                rest = self._rests[here]
                before[(slice(None), *search)] += q * (worth[step] - rest)
                without = rest if fewer is None else rest - fewer[(slice(None), *search)]
                mass = masses[where][here]
                self._old_gain += q * float(mass @ (worth[step] - without))
            if fewer is not None:
                self._rests[step] -= fewer
            if step:
                along_x, along_y = self._matrices[step - 1]
                fewer = along_y @ before @ along_x.swapaxes(1, 2)
        self._worth, self._q = worth, q

    def _local(self, path: Path) -> list[tuple[int, int, int]]:
        """The searches of a path in the box: step, row and column."""
        steps = path.searches.nonzero()[0]
        y, x = np.divmod(path.cells[steps], self._box.size)
        box = self._box
        inside = (box.top <= y) & (y < box.bottom) & (box.left <= x) & (x < box.right)
        rows, columns = y[inside] - box.top, x[inside] - box.left
        return list(zip(steps[inside].tolist(), rows.tolist(), columns.tolist(), strict=True))

    def add_gains(self, gains: Floats) -> None:
        """Add the gain of one search of each cell in reach in each step."""
        if not self.cells:
            return
        box, reach = self._box, self._reach
        common = box.common(reach)
        if not all(common.shape):
            return
        inner = (
            slice(None),
            slice(None),
            slice(common.top - box.top, common.bottom - box.top),
            slice(common.left - box.left, common.right - box.left),
        )
        gain = self._worth[:, None, None, None] - self._rests[inner]
        gain *= self._masses[inner]
        gain *= self._q
        outer = (
            slice(None),
            slice(common.top - reach.top, common.bottom - reach.top),
            slice(common.left - reach.left, common.right - reach.left),
        )
        gains[outer] += over_hypotheses(gain.swapaxes(0, 1))

    def gain(self, new: Path) -> float:
        """How much the value increases if the segment is replaced."""
        if not self.cells:
            return 0.0
        total, fewer, q = 0.0, None, self._q
        at = {step: (y, x) for step, y, x in self._local(new)}
        last = max(at, default=-1)
        for step in range(last + 1):
            search = at.get(step)
            if fewer is not None:
                after = fewer * self._kept[step]
            elif search is not None:
                after = np.zeros_like(self._masses[0])
            else:
                continue
            if search is not None:
                here = (slice(None), *search)
                mass = self._masses[(step, *here)]
                if fewer is not None:
                    mass = mass - fewer[here]
                total += q * float(mass @ (self._worth[step] - self._rests[(step, *here)]))
                after[here] += q * mass
            if step < last:
                along_x, along_y = self._matrices[step]
                fewer = along_y.swapaxes(1, 2) @ after @ along_x
        return total - self._old_gain
