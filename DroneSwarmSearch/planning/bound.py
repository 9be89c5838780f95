"""A limit on what any policy can reach: search by mixtures of flights, relaxed.

Whatever a policy does, and however it draws lots, the searches it makes while a person has
not been found form a random set of flights, one for each drone. Let e[t](c) be the mean
number of searches of cell c in step t, and s the sum of e along a person's way. Were s
always whole, 1 - (1 - q)^s of those who go that way would be found; the smallest concave
function g that agrees there joins these values by straight lines (min(s, 1) where q = 1).
By Jensen's inequality no policy finds more than E[g(s)], and so none finds more than

    max E[g(s)]  over all mixtures e of flights.

That is a concave problem over a convex set, and the best flight for given gains is a
dynamic programme (`paths`): the method of Frank and Wolfe (Naval Research Logistics
Quarterly 3:95, 1956) applies. At every point e it also gives a bound: g lies below each of
its tangents, so that the tangents' intercepts plus the best flights' gains limit the
maximum, hence every policy. The difference to the value at e is the duality gap.

Expectations are over the person's ways: all of them where they are few, else a sample of
independent ones. The maximum over a sample is at least the sample's value at the true
optimum, whose error Chernoff's inequality limits (Annals of Mathematical Statistics
23:493, 1952): it is added. The relaxation is solved once for each person and number of
steps, and each sampled solution may fail. A union bound (Bonferroni) divides the
probability of failure among them, so that all of them hold together at the stated
confidence. Where q < 1 the larger function 1 - (1 - q)^s, which is a product along the
way, gives another bound, exact from two passes over the chain. The smaller one counts.

To find all of several persons is no likelier than to find the one who is hardest to find.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.streams import numbers, stream_keys
from DroneSwarmSearch.drift.probability_matrix import ProbabilityMatrix
from DroneSwarmSearch.planning.chain import Chain
from DroneSwarmSearch.planning.paths import best_path, values_to_go
from DroneSwarmSearch.scenario import Scenario

__all__ = [
    "Effort",
    "Objective",
    "Relaxed",
    "SuccessBound",
    "anywhere",
    "chernoff_limit",
    "flights",
    "frank_wolfe",
    "success_bound",
]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SAMPLE = 32768
"""Trajectories of a person in the sample that gives the bound."""

ITERATIONS = 600
"""The most for the episode's limit."""

ITERATIONS_BEFORE = 60
"""The most for fewer steps."""

MEMORY = 10.0
"""The mean of tangents is over about the latest tenth for every so many iterations."""

FEW = 65536
"""Up to so many ways are enumerated, with their probabilities, instead of sampled."""

CONFIDENCE = 0.999
"""Of a sampled bound: that it holds for all persons and all steps of the curve together."""

SOFTNESS = 0.5, 0.02
"""How far from its corners g is rounded off, in searches, at first and at last."""

SOFTENING = 10.0
"""After so many steps of the method g's corners are rounded off half as far as at first."""

HORIZONS = 12
"""Numbers of steps for which the relaxation is solved; those between take the next one's."""


class Effort(NamedTuple):
    """Searches: so much effort in some cells and steps.

    Attributes:
        places: int64, shape (k,): t * N * N + y * N + x; they may repeat.
        amounts: float64, shape (k,).
    """

    places: Ints
    amounts: Floats


class Objective(Protocol):
    """A concave function of effort, at a point that moves."""

    def value(self) -> float:
        """The function's value at the point."""

    def tangent(self) -> tuple[float, Floats]:
        """An upper bound of the function that is linear: its value without effort, and its gains.

        The gains have the shape (T, N, N), indexed [t, y, x], and are not negative.
        """

    def approach(self, target: Effort) -> None:
        """Move the point towards another one, about as far as the function grows."""


Oracle = Callable[[Floats], tuple[float, Effort]]
"""From gains to the most that can be gained, and the effort that gains it."""


class Relaxed(NamedTuple):
    """What the method of Frank and Wolfe has reached.

    Attributes:
        value: of the objective, at the best point met.
        limit: a bound of its maximum.
    """

    value: float
    limit: float

    @property
    def gap(self) -> float:
        """The duality gap."""
        return self.limit - self.value


def frank_wolfe(
    objective: Objective, oracle: Oracle, *, gap: float, iterations: int, most: float = math.inf
) -> Relaxed:
    """Maximise a concave function over the mixtures of what an oracle can return.

    Args:
        objective: the function; its point is moved.
        oracle: maximises linear functions.
        gap: the duality gap at which to stop, as a share of the limit.
        iterations: the most to make.
        most: a bound known beforehand.
    """
    value, limit = -math.inf, most
    mean_intercept, mean_gains = 0.0, np.zeros(())
    for iteration in range(iterations + 1):
        value = max(value, objective.value())
        intercept, gains = objective.tangent()
        # The mean of tangents is an upper bound as each of them is, and swings less.
        share = MEMORY / (iteration + MEMORY)
        mean_intercept += share * (intercept - mean_intercept)
        mean_gains = mean_gains + share * (gains - mean_gains)
        gained, target = oracle(mean_gains)
        limit = min(limit, mean_intercept + gained)
        if limit - value <= gap * limit or iteration == iterations:
            break
        objective.approach(target)
    return Relaxed(value, limit)


def flights(starts: Sequence[int]) -> Oracle:
    """The oracle of drones that must fly, one flight for each.

    Args:
        starts: every drone's first cell, y * N + x.
    """

    def oracle(gains: Floats) -> tuple[float, Effort]:
        values = values_to_go(gains, np.zeros(gains.shape[1:]))
        cells_in_grid = gains[0].size
        places = []
        for start in starts:
            path = best_path(gains, values, start)
            steps = path.searches.nonzero()[0]
            places.append(steps * cells_in_grid + path.cells[steps])
        gained = float(values[0].reshape(-1)[list(starts)].sum())
        found = np.concatenate(places)
        return gained, Effort(found, np.ones(len(found)))

    return oracle


def anywhere(amount: float) -> Oracle:
    """The oracle of searchers that need not fly: so much effort in each step, in any cell."""

    def oracle(gains: Floats) -> tuple[float, Effort]:
        flat = gains.reshape(len(gains), -1)
        best = flat.argmax(axis=1)
        gained = amount * float(flat.max(axis=1).sum())
        places = np.arange(len(gains)) * flat.shape[1] + best
        return gained, Effort(places, np.full(len(places), amount))

    return oracle


# Trajectories of a person.


class Trajectories(NamedTuple):
    """Trajectories of a person with their probabilities.

    Attributes:
        cells: int64, shape (T, K): where each is at every step, y * N + x.
        chances: float64, shape (K,), sum to 1.
    """

    cells: Ints
    chances: Floats

    def until(self, steps: int) -> Trajectories:
        """The first steps of all ways."""
        return Trajectories(self.cells[:steps], self.chances)


def enumerated_trajectories(forecast: ProbabilityMatrix, steps: int) -> Trajectories | None:
    """All ways of a person over some steps; None if there are more than `FEW`."""
    size = forecast.grid_size
    x, y = forecast.parameters[1]
    ways, chances = np.array([[y * size + x]]), np.ones(1)
    for step in range(steps - 1):
        right, left, down, up = forecast.moves(step)
        y_now, x_now = np.divmod(ways[-1], size)
        across = np.stack([left[x_now], 1.0 - right[x_now] - left[x_now], right[x_now]])
        along = np.stack([up[y_now], 1.0 - down[y_now] - up[y_now], down[y_now]])
        onward = chances * along[:, None] * across  # [down, across, way]
        dy, dx, way = onward.nonzero()
        if len(way) > FEW:
            return None
        cells = ways[-1, way] + (dy - 1) * size + dx - 1
        ways, chances = np.vstack([ways[:, way], cells]), onward[dy, dx, way]
    return Trajectories(ways, chances)


def sampled_trajectories(forecast: ProbabilityMatrix, steps: int, count: int) -> Trajectories:
    """Independent ways of a person over some steps, all equally likely."""
    size = forecast.grid_size
    start_x, start_y = forecast.parameters[1]
    x, y = np.full(count, start_x), np.full(count, start_y)
    cells = np.empty((steps, count), np.int64)
    key = stream_keys(0)[0]
    for step in range(steps):
        cells[step] = y * size + x
        right, left, down, up = forecast.moves(step)
        places = np.arange(2 * step * count, 2 * (step + 1) * count, dtype=np.uint64)
        u, v = numbers(key, places).reshape(2, count)
        x, y = _moved(x, u, right, left), _moved(y, v, down, up)
    return Trajectories(cells, np.full(count, 1 / count))


def _moved(place: Ints, number: Floats, higher: Floats, lower: Floats) -> Ints:
    rises = higher[place]
    moved: Ints = place + (number < rises) - ((number >= rises) & (number < rises + lower[place]))
    return moved


def chernoff_limit(mean: float, count: int, confidence: float) -> float:
    """A limit on the expectation of a quantity in [0, 1], given the mean of a sample.

    The largest p with count * kl(mean, p) <= -ln(1 - confidence), kl being the relative
    entropy of two coins (Chernoff 1952; Hoeffding, Journal of the American Statistical
    Association 58:13, 1963).

    Args:
        mean: of the sample.
        count: independent draws in it.
        confidence: that the limit holds.
    """
    if mean >= 1.0:
        return 1.0
    allowed = -math.log1p(-confidence) / count
    low, high = max(mean, 0.0), 1.0
    for _ in range(60):
        p = (low + high) / 2
        entropy = (1 - mean) * math.log((1 - mean) / (1 - p)) if p < 1.0 else math.inf
        if mean > 0.0:
            entropy += mean * math.log(mean / p)
        low, high = (p, high) if entropy <= allowed else (low, p)
    return high


# The two objectives.


class AlongTrajectories:
    """E[g(s)] over ways, g joining 1 - (1 - q)^s at whole s by straight lines.

    At corners the method of Frank and Wolfe would stagnate. Hence tangents and steps are
    those of g with its corners rounded off, less and less; each tangent is then moved up
    until it lies above g itself.

    Args:
        ways: of the person.
        grid_size: cells along each side, N.
        detection: the probability of detection, q.
    """

    def __init__(self, ways: Trajectories, grid_size: int, detection: float) -> None:
        self._cells, self._chances = ways.cells, ways.chances
        self._size, self._q = grid_size, detection
        self._effort = np.zeros(len(ways.cells) * grid_size**2)
        self._sums = np.zeros(len(ways.chances))
        self._corners = np.arange(self._most() + 2.0)
        self._kept = (1.0 - detection) ** self._corners
        self._slopes = detection * self._kept
        self._approaches = 0

    @property
    def _softness(self) -> float:
        widest, narrowest = SOFTNESS
        return max(widest / (1.0 + self._approaches / SOFTENING), narrowest)

    def _most(self) -> int:
        """From so many searches on there is nothing to gain that a double would notice."""
        if self._q >= 1.0:
            return 1
        if self._q <= 0.0:
            return 0
        return min(math.ceil(-36.0 / math.log1p(-self._q)), len(self._cells))

    def _along(self, effort: Floats) -> Floats:
        """The sum of effort along each way."""
        sums, here = np.zeros(len(self._chances)), np.empty(len(self._chances))
        per_step = effort.reshape(len(self._cells), -1)
        for cells, amounts in zip(self._cells, per_step, strict=True):
            if amounts.any():
                # mode="clip" spares NumPy a copy of what it writes.
                amounts.take(cells, out=here, mode="clip")
                sums += here
        return sums

    def _found(self, sums: Floats) -> Floats:
        found: Floats = np.interp(sums, self._corners, 1.0 - self._kept)
        return found

    def value(self) -> float:
        return self._mean(self._found(self._sums))

    def tangent(self) -> tuple[float, Floats]:
        corner, turned = self._nearest(self._sums)
        slope = (1.0 - turned) * self._slopes[corner - 1] + turned * self._slopes[corner]
        intercept = self._mean(1.0 - self._kept[corner] - slope * corner)
        weights, cells = self._chances * slope, self._size**2
        gains = np.empty((len(self._cells), cells))
        for row, at in zip(gains, self._cells, strict=True):
            row[:] = np.bincount(at, weights, cells)
        return intercept, gains.reshape(-1, self._size, self._size)

    def approach(self, target: Effort) -> None:
        there = np.zeros(len(self._effort))
        np.add.at(there, target.places, target.amounts)
        ahead = self._along(there) - self._sums
        step = best_step(lambda part: self._mean(self._softly_found(self._sums + part * ahead)))
        self._sums += step * ahead
        self._effort += step * (there - self._effort)
        self._approaches += 1

    def _mean(self, values: Floats) -> float:
        """The expectation; summed by NumPy alone, so that no thread takes part in it."""
        return float((self._chances * values).sum())

    def _nearest(self, sums: Floats) -> tuple[Ints, Floats]:
        """The nearest corner of g, and how far the slope has turned from its left to its right."""
        corner = np.minimum(np.rint(sums), self._corners[-1]).astype(np.int64)
        turned = np.clip((sums - corner) / (2 * self._softness) + 0.5, 0.0, 1.0)
        turned[corner == 0] = 1.0
        return corner, turned

    def _softly_found(self, sums: Floats) -> Floats:
        """The function g with its corners rounded off."""
        corner, turned = self._nearest(sums)
        left, right = self._slopes[corner - 1], self._slopes[corner]
        # The integral of the turning slope falls short of g by this much.
        short = self._softness * (left - right) * np.minimum(turned, 1.0 - turned) ** 2
        found: Floats = self._found(sums) - short
        return found


class AlongChain:
    """E[1 - exp(-sum of rate times effort)], exactly, by two passes over the chain.

    Args:
        chain: of the person.
        first: where the person is at step 0: float64, shape (N, N).
        rate: detections per unit of effort: a number or float64, shape (N, N).
        effort: where the point is: float64, shape (T * N * N,); moved in place.
    """

    def __init__(self, chain: Chain, first: Floats, rate: float | Floats, effort: Floats) -> None:
        size = len(first)
        self._chain, self._first, self._rate = chain, first, rate
        self._effort = effort.reshape(-1, size, size)

    def _kept(self, effort: Floats) -> Floats:
        kept: Floats = np.exp(-self._rate * effort)
        return kept

    def _left(self, effort: Floats) -> list[Floats]:
        """Who has not been found: before each step, and at last after the last search."""
        mass, kept = self._first, self._kept(effort)
        left = [mass]
        for step, share in enumerate(kept):
            mass = mass * share
            if step + 1 < len(kept):
                mass = self._chain.forward(mass, step)
            left.append(mass)
        return left

    def value(self) -> float:
        return float(1.0 - self._left(self._effort)[-1].sum())

    def tangent(self) -> tuple[float, Floats]:
        left, kept = self._left(self._effort), self._kept(self._effort)
        gains = np.empty_like(self._effort)
        later = np.ones_like(self._first)  # the chance to stay unfound from here on
        for step in range(len(kept) - 1, -1, -1):
            later = later * kept[step]
            gains[step] = self._rate * left[step] * later
            if step:
                later = self._chain.backward(later, step - 1)
        found = 1.0 - left[-1].sum()
        return float(found - np.vdot(gains, self._effort)), gains

    def approach(self, target: Effort) -> None:
        there = np.zeros(self._effort.size)
        np.add.at(there, target.places, target.amounts)
        ahead = there.reshape(self._effort.shape) - self._effort
        step = best_step(lambda part: -float(self._left(self._effort + part * ahead)[-1].sum()))
        self._effort += step * ahead


def best_step(value: Callable[[float], float]) -> float:
    """Where in [0, 1] a concave function of one number is largest, to a few percent.

    The search runs over powers: late steps of the method are small.
    """
    golden = (math.sqrt(5) - 1) / 2
    low, high = math.log(1e-4), 0.0
    a, b = high - golden * (high - low), low + golden * (high - low)
    at_a, at_b = value(math.exp(a)), value(math.exp(b))
    for _ in range(9):
        if at_a > at_b:
            high, b, at_b = b, a, at_a
            a = high - golden * (high - low)
            at_a = value(math.exp(a))
        else:
            low, a, at_a = a, b, at_b
            b = low + golden * (high - low)
            at_b = value(math.exp(b))
    return math.exp((low + high) / 2)


# The bound of a search.


@dataclass(frozen=True)
class SuccessBound:
    """A limit on the chance of every policy to find all persons of a search.

    Attributes:
        by_time: the limit for each number of completed steps, 0 to the episode's limit:
            float64, shape (L + 1,), never falling.
        relaxed: the chance that mixtures of flights reach in the relaxation by step L,
            for the person whose bound is the smallest.
        gap: the duality gap at step L, which `by_time` contains.
        confidence: that `by_time` holds at all steps together; 1 where expectations are
            exact.
    """

    by_time: Floats
    relaxed: float
    gap: float
    confidence: float

    @property
    def by_limit(self) -> float:
        """The limit by the episode's last step."""
        return float(self.by_time[-1])


def success_bound(
    scenario: Scenario,
    drones_positions: object,
    *,
    sample: int = SAMPLE,
    gap: float = 0.008,
    horizons: int = HORIZONS,
    report: Callable[[float], None] = lambda share: None,
) -> SuccessBound:
    """A certified limit on what any policy can reach in a search.

    Args:
        scenario: the search.
        drones_positions: every drone's cell (x, y) at the beginning.
        sample: ways of each person to draw where they are too many to enumerate.
        gap: the duality gap at which to stop, as a share of the bound.
        horizons: numbers of steps for which to solve the relaxation.
        report: told now and then which share of the work is done.

    Returns:
        The limit for every number of steps, and how certain it is.

    Raises:
        TypeError: an argument is of the wrong type.
        ValueError: an argument is out of its limits.
    """
    limit = scenario.timestep_limit
    starts = scenario.drone_cells(drones_positions)
    checks.integer("sample", sample, 1)
    checks.integer("horizons", horizons, 1)
    checks.real("gap", gap, 0)
    ends = sorted({math.ceil(limit * k / horizons) for k in range(1, horizons + 1)})
    forecasts = zip(
        scenario.person_initial_position, scenario.detections, scenario.forecasts(), strict=True
    )
    kinds = {(cell, detection): forecast for cell, detection, forecast in forecasts}
    persons = [
        _PersonBound(forecast, detection, starts, limit, gap)
        for (_, detection), forecast in sorted(kinds.items())
    ]
    # The union bound: each of the sampled limits may fail with the same small probability.
    statements = len(ends) * sum(person.sampled for person in persons)
    risk = (1.0 - CONFIDENCE) / max(1, statements)
    bounds = []
    for number, person in enumerate(persons):

        def told(share: float, number: int = number) -> None:
            report((number + share) / len(persons))

        bounds.append(person.solve(ends, sample, 1.0 - risk, told))
    hardest = min(bounds, key=lambda bound: bound.by_limit)
    by_time = np.min([bound.by_time for bound in bounds], axis=0)
    confidence = CONFIDENCE if statements else 1.0
    return SuccessBound(by_time, hardest.relaxed, hardest.gap, confidence)


class _PersonBound:
    """The bound for one person."""

    def __init__(
        self,
        forecast: ProbabilityMatrix,
        detection: float,
        starts: Sequence[int],
        limit: int,
        gap: float,
    ) -> None:
        self._forecast, self._limit = forecast, limit
        self._detection, self._gap = detection, gap
        self._chain, self._first = Chain(forecast, detection, 0, limit), forecast.exact(0)
        self._every_way = enumerated_trajectories(forecast, limit)
        self._oracle = flights(starts)

    @property
    def sampled(self) -> bool:
        """Whether the person's ways are too many to enumerate."""
        return self._every_way is None

    def solve(
        self, ends: Sequence[int], sample: int, confidence: float, report: Callable[[float], None]
    ) -> SuccessBound:
        """The bound for every number of steps.

        Args:
            ends: numbers of steps for which to solve the relaxation; the last is the limit.
            sample: ways to draw if they are not enumerated.
            confidence: that the limit holds, for each of `ends`, if ways are drawn.
            report: told which share is done.
        """
        limit, ways = self._limit, self._every_way
        if ways is None:
            ways = sampled_trajectories(self._forecast, limit, sample)
        by_time = np.full(limit + 1, np.inf)
        by_time[0] = 0.0
        for end in ends:
            reached = self._relaxed(ways.until(end))
            by_time[end] = reached.limit
            if self.sampled:
                by_time[end] = chernoff_limit(reached.limit, sample, confidence)
            if 0.0 < self._detection < 1.0:
                by_time[end] = min(by_time[end], self._exactly(end, by_time[end]))
            report(end * (end + 1) / (limit * (limit + 1)))
        # More time never hurts, so that a limit for later steps holds for earlier ones.
        by_time = np.minimum.accumulate(by_time[::-1])[::-1]
        return SuccessBound(
            by_time, reached.value, reached.gap, confidence if self.sampled else 1.0
        )

    def _relaxed(self, ways: Trajectories) -> Relaxed:
        """Solve the relaxation over some steps."""
        steps = len(ways.cells)
        objective = AlongTrajectories(ways, self._forecast.grid_size, self._detection)
        iterations = ITERATIONS if steps == self._limit else ITERATIONS_BEFORE
        return frank_wolfe(objective, self._oracle, gap=self._gap, iterations=iterations, most=1.0)

    def _exactly(self, steps: int, known: float) -> float:
        """The bound by the larger function, which needs no sample."""
        cells = self._forecast.grid_size**2
        rate, effort = -math.log1p(-self._detection), np.zeros(steps * cells)
        objective = AlongChain(self._chain, self._first, rate, effort)
        return frank_wolfe(
            objective, self._oracle, gap=self._gap, iterations=ITERATIONS_BEFORE, most=known
        ).limit
