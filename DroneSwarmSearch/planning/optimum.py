"""The best plan of a search, with a proof: branch and bound over the drones' flows.

Drones that may share cells are a flow of whole drones through cells and steps; z[t, c] of them look
at cell c in step t. The probability that the person is not found is

    f(z) = sum over trajectories w of p(w) r^N(w),    N(w) = sum of z along w,

with r = 1 - the probability of detection. N is whole, and r^N lies on or above the straight line
through its values at two neighbouring whole numbers n and n + 1. So whatever whole number n(w) is
chosen for each trajectory, for all flows

    f(z) >= sum over w of p(w) r^n(w) (1 - (1 - r) (N(w) - n(w))).

A linear program over the flows has such cuts. Where its solution is fractional, n(w) is the whole
part of N(w), which is carried along the trajectories in a forward and a backward pass over the
drift model, in steps of 1/24; this is nearly the tangent of the largest convex function that is at
most f at whole numbers of looks along each trajectory. Many drones who each see little are rounded
too much: the tangent of f itself, with which J. O. Royset and H. Sato (Naval Research Logistics
57:422, 2010) cut, and the cuts at solutions rounded to whole numbers are better for these. Then the
search branches on whether at most k drones look at a cell in a step, or more.

The linear programs: HiGHS (Q. Huangfu, J. A. J. Hall, Mathematical Programming Computation 10:119,
2018), of the extra "optimum".
"""

from __future__ import annotations

import heapq
import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.arrays import Floats, Ints
from DroneSwarmSearch._internal.extras import needed
from DroneSwarmSearch.core.grid import Grid
from DroneSwarmSearch.core.rules import PASS
from DroneSwarmSearch.core.scenario import Scenario, checked_scenario
from DroneSwarmSearch.drift.model import DriftModel
from DroneSwarmSearch.paths.best_paths import DronePath, cells_looked_at
from DroneSwarmSearch.planning.plan_paths import plan_paths

SECONDS = 900.0
PLANNING = 0.5  # seconds of work for the plan to begin with

PROVEN = 2e-6  # the difference between a plan and the bound at which the plan is the best

PARTS = 24  # of a look, in which numbers of looks are carried along trajectories
MOST_LOOKS = 12  # at a trajectory that are told apart
MOST_STATES = 4e7  # entries of all transition matrices

ROUNDED_UP = (0.2, 0.35, 0.5, 0.65, 0.8)  # parts from which a solution's numbers are rounded up
CUTS = 3  # that are added at once
ROUNDS = 8  # of cuts at a node
ROOT_ROUNDS = 400
WORTH_A_CUT = 0.1  # of the gap; smaller violations are left
ROOT_VIOLATION = 1e-5
WHOLE = 1e-6  # how far from a whole number a count may be

SLACK = 1e-7
FORGOTTEN = 40  # linear programs in a row in which a cut is slack, before it is forgotten


@dataclass(frozen=True)
class Optimum:
    """The best plan that was found, and a bound on all plans.

    Attributes:
        success: the probability of success (POS) of the plan.
        bound: no plan has a higher one.
        paths: the drones' paths.
        nodes: of the search tree.
    """

    success: float
    bound: float
    paths: tuple[DronePath, ...]
    nodes: int

    @property
    def is_proven(self) -> bool:
        """Whether no plan is better, up to a difference of a few millionths."""
        return self.bound - self.success <= 2 * PROVEN


def optimum(scenario: Scenario, drones_positions: object, *, seconds: float = SECONDS) -> Optimum:
    """Find the best paths of all drones, and prove that they are, within some time.

    For one person, or persons who are alike in a coverage mission, and for drones that may share
    cells.

    Args:
        scenario: the search, with ``crash="pass"``.
        drones_positions: every drone's start cell (x, y).
        seconds: the time after which the best plan and the bound so far are returned, besides that
            for a first plan.

    Raises:
        ImportError: the package highspy, of the extra "optimum", is missing.
        TypeError: an argument has the wrong type.
        ValueError: an argument is out of its limits, drones may not share cells, or there are
            several persons.
    """
    scenario = checked_scenario(scenario)
    starts = scenario.drone_cells(drones_positions)
    seconds = checks.positive("seconds", seconds)
    persons = set(scenario.persons_to_find)
    if scenario.crash != PASS:
        raise ValueError(f"scenario must have crash='pass', got {scenario.crash!r}")
    if len(persons) > 1 or (len(scenario.persons_to_find) > 1 and scenario.mission == "rescue"):
        raise ValueError(
            "scenario must have one person, or equal ones in a coverage mission, got "
            f"{len(scenario.persons_to_find)}"
        )
    plan = plan_paths(scenario, drones_positions, seconds=PLANNING)
    misses = _Misses(
        model=scenario.forecasts()[0],
        steps=scenario.timestep_limit,
        drones=scenario.n_drones,
        detection=scenario.detections[0],
    )
    flow = _Flow.of(scenario, starts, misses.is_possible)
    tree = _Tree(misses, flow, list(plan.paths), time.monotonic() + seconds)
    return tree.searched()


class _Cut(NamedTuple):
    """The probability of missing the person is at least `least` - slopes . looks, (T, N²)."""

    least: float
    slopes: Floats

    def at(self, looks: Floats) -> float:
        """Its value at numbers of looks."""
        return self.least - float((self.slopes * looks).sum())


class _Misses:
    """The probability of missing the person, for numbers of looks.

    Attributes:
        is_possible: where the person may be when drones look: bool, (T, N²).

    Raises:
        ValueError: the search is too large.
    """

    def __init__(self, model: DriftModel, steps: int, drones: int, detection: float) -> None:
        self._model = model
        self._missed = 1.0 - detection
        self._steps = steps
        self._states = int(np.prod(model.state_shape))
        if steps * self._states**2 > MOST_STATES:
            raise ValueError(
                "scenario must be small, because all transitions are kept, got "
                f"{self._states} states of the person and {steps} steps"
            )
        self._start = model.joint(0).ravel()
        self._moves = [self._transitions(step) for step in range(steps - 1)]
        maps = [model.exact(step).ravel() for step in range(steps)]
        self.is_possible = np.array(maps) > 0.0
        self._most = PARTS * min(drones + 2, MOST_LOOKS)
        whole = np.arange(self._most + 1) // PARTS
        # By 24ths of a look at a trajectory: r^n, and the line at no look, see the module.
        self._left = self._missed**whole
        self._at_none = self._left * (1.0 + detection * whole)

    def _transitions(self, step: int) -> Floats:
        """The probability of each move between states, from row to column: (S, S)."""
        unit = np.eye(self._states).reshape(-1, *self._model.state_shape)
        return np.array([self._model.forward(mass, step).ravel() for mass in unit])

    def _by_state(self, looks: Floats) -> Floats:
        """Numbers of looks by step and cell, (T, N²), by step and state: (T, S)."""
        size = self._model.grid_size
        lifted = self._model.lift(looks.reshape(-1, size, size))
        shape = (len(looks), *self._model.state_shape)
        return np.broadcast_to(lifted, shape).reshape(len(looks), -1)

    def _by_cell(self, parts: Floats) -> Floats:
        """Parts by step and state, (T, S), by step and cell: (T, N²)."""
        mass = parts.reshape(len(parts), *self._model.state_shape)
        return self._model.map(mass).reshape(len(parts), -1)

    def of(self, looks: Floats) -> float:
        """The probability f of numbers of looks, (T, N²)."""
        return float(self._unfound(looks)[-1].sum())

    def _unfound(self, looks: Floats) -> list[Floats]:
        """Where the unfound person is after the looks of each step: (S,) each."""
        mass = self._start
        found = []
        for step, now in enumerate(self._by_state(looks)):
            if step:
                mass = mass @ self._moves[step - 1]
            mass = mass * self._missed**now
            found.append(mass)
        return found

    def touching(self, looks: Floats) -> list[_Cut]:
        """The cuts that touch f at whole numbers of looks, (T, N²): n(w) is N(w), or one less."""
        slopes = [1.0 - self._missed]
        if self._missed:
            slopes.append(1.0 / self._missed - 1.0)
        return self._sloping(looks, slopes)

    def tangent(self, looks: Floats) -> list[_Cut]:
        """The tangent of f at numbers of looks, (T, N²); none if detection is certain."""
        return self._sloping(looks, [-math.log(self._missed)]) if self._missed else []

    def _sloping(self, looks: Floats, slopes: Sequence[float]) -> list[_Cut]:
        """The cuts at numbers of looks, (T, N²), with some slopes along each trajectory."""
        unfound = self._unfound(looks)
        missed = self._missed ** self._by_state(looks)
        parts = np.empty_like(missed)
        later = np.ones(self._states)
        for step in reversed(range(self._steps)):
            parts[step] = unfound[step] * later
            if step:
                later = self._moves[step - 1] @ (missed[step] * later)
        by_cell = self._by_cell(parts)
        least = float(unfound[-1].sum())
        along = float((by_cell * looks).sum())
        return [_Cut(least + slope * along, slope * by_cell) for slope in slopes]

    def lines(self, looks: Floats) -> _Cut:
        """The cut by a line for each trajectory, at numbers of looks, (T, N²)."""
        parts = np.rint(PARTS * self._by_state(looks)).astype(np.int64)
        masses = []
        mass = np.zeros((self._most + 1, self._states))  # by 24ths of a look so far
        mass[0] = self._start
        for step, now in enumerate(parts):
            if step:
                mass = mass @ self._moves[step - 1]
            masses.append(mass)
            mass = _looked(mass, now)
        least = float(mass.sum(axis=1) @ self._at_none)

        slopes = np.empty((self._steps, self._states))
        later = np.repeat(self._left[:, None], self._states, axis=1)
        for step in reversed(range(self._steps)):
            later = _expected(later, parts[step])
            slopes[step] = (masses[step] * later).sum(axis=0)
            if step:
                later = later @ self._moves[step - 1].T
        return _Cut(least, (1.0 - self._missed) * self._by_cell(slopes))


def _looked(mass: Floats, parts: Ints) -> Floats:
    """Mass by the number of parts of a look, (K, S), after more in each state, (S,)."""
    after = mass.copy()
    last = len(mass) - 1
    for more in np.unique(parts[parts > 0]).tolist():
        states = parts == more
        begin = min(more, last)
        here = mass[:, states]
        moved = np.zeros_like(here)
        moved[begin:] = here[: last + 1 - begin]
        moved[last] += here[last + 1 - begin :].sum(axis=0)
        after[:, states] = moved
    return after


def _expected(values: Floats, parts: Ints) -> Floats:
    """Values by the number of parts of a look, (K, S), before more in each state, (S,)."""
    numbers = np.minimum(np.arange(len(values))[:, None] + parts, len(values) - 1)
    return np.take_along_axis(values, numbers, axis=0)


def _are_whole(counts: Floats) -> bool:
    """Whether counts are whole numbers, up to the solver's errors."""
    return bool(np.abs(counts - np.rint(counts)).max(initial=0.0) < WHOLE)


class _Arc(NamedTuple):
    """What drones in a cell may do in a step: where they are then, and whether they look."""

    step: int
    source: int
    target: int
    looks: bool


@dataclass(frozen=True)
class _Flow:
    """The flow of drones, in arrays.

    Attributes:
        arcs: what drones may do, in order of their steps.
        looks: the index, t N² + c, of each step and cell where the person may be and drones may
            look: int64, (K,).
        starts: every drone's first cell.
        shape: (T, N²).
        in_flight: whether drones look where they arrive.
    """

    arcs: list[_Arc]
    looks: Ints
    starts: Sequence[int]
    shape: tuple[int, int]
    in_flight: bool

    @classmethod
    def of(cls, scenario: Scenario, starts: Sequence[int], is_possible: Any) -> _Flow:
        """The flow of a search's drones, from their starts to wherever they can be."""
        neighbours = Grid.of(scenario.grid_size).neighbours
        in_flight = scenario.search_in_flight
        arcs = []
        here = set(starts)
        for step in range(scenario.timestep_limit):
            there = set()
            for source in sorted(here):
                moves = {target for target in neighbours[source][:4] if target >= 0}
                arcs.append(_Arc(step, source, source, looks=True))
                arcs += [_Arc(step, source, target, in_flight) for target in sorted(moves)]
                there |= moves | {source}
            here = there
        looked_at = {
            arc.step * scenario.grid_size**2 + (arc.target if in_flight else arc.source)
            for arc in arcs
            if arc.looks
        }
        looks = np.array(sorted(looked_at), np.int64)
        looks = looks[is_possible.ravel()[looks]]
        return cls(arcs, looks, starts, is_possible.shape, in_flight)

    def cell_looked_at(self, arc: _Arc) -> int:
        """The index, t N² + c, of what drones look at."""
        return arc.step * self.shape[1] + (arc.target if self.in_flight else arc.source)

    def spread(self, counts: Floats) -> Floats:
        """Numbers of looks by `looks`, (K,), as (T, N²)."""
        spread = np.zeros(self.shape[0] * self.shape[1])
        spread[self.looks] = np.maximum(counts, 0.0)  # without the solver's rounding errors
        return spread.reshape(self.shape)

    def paths(self, flows: Floats) -> tuple[DronePath, ...]:
        """The paths of the drones, given how many do what on each arc: (arcs,)."""
        left = np.rint(flows).astype(int).tolist()
        by_source: dict[tuple[int, int], list[int]] = {}
        for number, arc in enumerate(self.arcs):
            by_source.setdefault((arc.step, arc.source), []).append(number)
        paths = []
        for start in self.starts:
            cells = [start]
            searches = []
            for step in range(self.shape[0]):
                chosen = next(n for n in by_source[step, cells[-1]] if left[n])
                left[chosen] -= 1
                cells.append(self.arcs[chosen].target)
                searches.append(self.arcs[chosen].looks)
            paths.append(DronePath(np.array(cells, np.int64), np.array(searches, np.bool_)))
        return tuple(paths)


class _Program:
    """The linear program: flows, numbers of looks, and the probability of missing the person.

    Its columns are the flow on each arc, the numbers of looks z, and the probability.
    """

    def __init__(self, flow: _Flow) -> None:
        highspy: Any = needed("highspy", "exact plans need the package highspy", "optimum")
        self._highspy = highspy
        self._solver = solver = highspy.Highs()
        solver.setOptionValue("output_flag", False)
        solver.setOptionValue("threads", 1)
        self._arcs = len(flow.arcs)
        self._count = len(flow.looks)
        drones = len(flow.starts)
        for _ in range(self._arcs + self._count):
            solver.addVar(0.0, drones)
        solver.addVar(0.0, 1.0)
        solver.changeColCost(self._arcs + self._count, 1.0)
        self.low = np.zeros(self._count)
        self.high = np.full(self._count, float(drones))
        self._conserve(flow)
        self._count_looks(flow)
        self._rows = solver.getNumRow()
        self._slack_for: list[int] = []  # linear programs, for each cut

    def _conserve(self, flow: _Flow) -> None:
        """As many drones leave each cell as have come there."""
        leaving: dict[tuple[int, int], list[int]] = {}
        coming: dict[tuple[int, int], list[int]] = {}
        for number, arc in enumerate(flow.arcs):
            leaving.setdefault((arc.step, arc.source), []).append(number)
            coming.setdefault((arc.step + 1, arc.target), []).append(number)
        for (step, cell), out in leaving.items():
            into = coming.get((step, cell), [])
            drones = float(flow.starts.count(cell)) if step == 0 else 0.0
            values = np.append(np.ones(len(out)), -np.ones(len(into)))
            self._add_row(drones, drones, np.array(out + into), values)

    def _count_looks(self, flow: _Flow) -> None:
        """A cell gets as many looks as there are drones that look at it."""
        looking: dict[int, list[int]] = {}
        for number, arc in enumerate(flow.arcs):
            if arc.looks:
                looking.setdefault(flow.cell_looked_at(arc), []).append(number)
        for column, look in enumerate(flow.looks.tolist(), self._arcs):
            arcs = looking[look]
            self._add_row(0.0, 0.0, np.append(arcs, column), np.append(np.ones(len(arcs)), -1.0))

    def _add_row(self, low: float, high: float, columns: Ints, values: Floats) -> None:
        self._solver.addRow(low, high, len(columns), columns.astype(np.int32), values)

    def add_cut(self, slopes: Floats, least: float) -> None:
        """Add that the probability is at least `least` - slopes . z."""
        used = np.nonzero(slopes)[0]
        columns = np.append(self._arcs + used, self._arcs + self._count)
        self._add_row(least, self._highspy.kHighsInf, columns, np.append(slopes[used], 1.0))
        self._slack_for.append(0)

    def limit(self, low: Floats, high: Floats) -> None:
        """Let the numbers of looks be within these limits from now on."""
        for number in np.nonzero((low != self.low) | (high != self.high))[0].tolist():
            column = self._arcs + number
            self._solver.changeColBounds(column, float(low[number]), float(high[number]))
        self.low = low.copy()
        self.high = high.copy()

    def solve(self) -> tuple[float, Floats, Floats] | None:
        """The least probability, the numbers of looks, and the flows; None without a solution."""
        self._solver.run()
        status = self._solver.getModelStatus()
        if status == self._highspy.HighsModelStatus.kInfeasible:
            return None
        if status != self._highspy.HighsModelStatus.kOptimal:
            raise RuntimeError(f"HiGHS stopped with the status {status}")
        solution = self._solver.getSolution()
        columns = np.array(solution.col_value)
        self._forget(np.array(solution.row_dual)[self._rows :])
        return columns[-1], columns[self._arcs : -1], columns[: self._arcs]

    def _forget(self, duals: Floats) -> None:
        """Delete the cuts that have been slack for long."""
        is_slack = np.abs(duals) < SLACK
        self._slack_for = [
            count + 1 if slack else 0
            for count, slack in zip(self._slack_for, is_slack.tolist(), strict=True)
        ]
        old = [n for n, count in enumerate(self._slack_for) if count >= FORGOTTEN]
        if old:
            rows = np.array(old, np.int32) + self._rows
            self._solver.deleteRows(len(old), rows)
            self._slack_for = [count for count in self._slack_for if count < FORGOTTEN]


class _Tree:
    """Branch and bound, with a plan to begin with, until a time."""

    def __init__(self, misses: _Misses, flow: _Flow, paths: list[DronePath], until: float) -> None:
        self._misses = misses
        self._flow = flow
        self._until = until
        self._program = _Program(flow)
        self._paths = tuple(paths)
        self._least = self._misses.of(self._looks_of(paths))
        self._nodes = 0

    def _looks_of(self, paths: Sequence[DronePath]) -> Floats:
        """How many drones look at each cell in each step: (T, N²)."""
        looks = np.zeros(self._flow.shape)
        for path in paths:
            cells = cells_looked_at(path.cells, self._flow.in_flight)
            np.add.at(looks, (path.searches.nonzero()[0], cells[path.searches]), 1.0)
        return looks

    def searched(self) -> Optimum:
        """Search the tree: the best plan, and the bound."""
        bound = self._root()
        low = self._program.low.copy()
        high = self._program.high.copy()
        waiting = [(bound, 0, low, high)]
        count = 1
        while waiting and waiting[0][0] < self._least - PROVEN and not self._is_late:
            bound, _, low, high = heapq.heappop(waiting)
            for other, lows, highs in self._descended(bound, low, high):
                heapq.heappush(waiting, (other, count, lows, highs))
                count += 1
        # What is left out may be better by PROVEN.
        bound = min([max(self._least - PROVEN, 0.0), *(node[0] for node in waiting)])
        return Optimum(
            success=1.0 - self._least,
            bound=1.0 - float(bound),
            paths=self._paths,
            nodes=self._nodes,
        )

    @property
    def _is_late(self) -> bool:
        return time.monotonic() > self._until

    def _root(self) -> float:
        """The bound without branches."""
        bound = 0.0
        for _ in range(ROOT_ROUNDS):
            solved = self._program.solve()
            assert solved is not None  # staying is always possible
            bound, looks, flows = solved
            if not self._cut_off(bound, looks, flows, ROOT_VIOLATION) or self._is_late:
                break
        return bound

    def _descended(
        self, bound: float, low: Floats, high: Floats
    ) -> list[tuple[float, Floats, Floats]]:
        """Follow the nearer branch of a node, and its own, as long as they may hold a better plan.

        Returns the other branches on the way: a bound, and the limits of the numbers of looks.
        """
        others: list[tuple[float, Floats, Floats]] = []
        while True:
            self._nodes += 1
            self._program.limit(low, high)
            solved = self._bounded()
            if solved is None:
                return others
            bound = max(bound, solved[0])
            looks = solved[1]
            if self._is_late:  # as it was
                return [*others, (bound, low, high)]
            branch = self._branch(looks)
            down = math.floor(looks[branch])
            lower = high.copy()
            lower[branch] = down
            upper = low.copy()
            upper[branch] = down + 1
            if looks[branch] - down > 0.5:
                others.append((bound, low, lower))
                low = upper
            else:
                others.append((bound, upper, high))
                high = lower

    def _bounded(self) -> tuple[float, Floats] | None:
        """The bound at a node, and its fractional looks; None if there is no better plan in it."""
        rounds = 0
        while True:
            solved = self._program.solve()
            if solved is None or solved[0] >= self._least - PROVEN:
                return None
            bound, looks, flows = solved
            is_whole = _are_whole(looks)
            violation = PROVEN / 2 if is_whole else WORTH_A_CUT * (self._least - bound)
            is_cut = self._cut_off(bound, looks, flows, max(violation, PROVEN / 2))
            if is_whole and not is_cut:  # its value is the bound
                return None
            rounds += 1
            if not is_whole and (not is_cut or rounds >= ROUNDS or self._is_late):
                return bound, looks

    def _branch(self, looks: Floats) -> int:
        """The fractional number of looks on which most depends."""
        slopes = self._misses.lines(self._flow.spread(looks)).slopes
        weights = slopes.ravel()[self._flow.looks] + WHOLE
        part = looks - np.floor(looks)
        unsure = np.minimum(part, 1.0 - part)
        return int(np.argmax(np.where(unsure > WHOLE, unsure * weights, 0.0)))

    def _cut_off(self, bound: float, looks: Floats, flows: Floats, violation: float) -> bool:
        """Add the cuts at a solution, if that violates them by enough.

        If its numbers are whole and its plan is better than the best one, that is the best one.
        """
        if _are_whole(looks):
            whole = np.rint(looks)
            least = self._misses.of(self._flow.spread(whole))
            if least < self._least:
                self._least = least
                self._paths = self._paths_of(whole, flows)
        spread = self._flow.spread(looks)
        cuts = [self._misses.lines(spread), *self._misses.tangent(spread)]
        for part in ROUNDED_UP:
            cuts += self._misses.touching(np.floor(spread + part))
        cuts.sort(key=lambda cut: cut.at(spread), reverse=True)
        violated = [cut for cut in cuts[:CUTS] if cut.at(spread) - bound > violation]
        for cut in violated:
            self._program.add_cut(cut.slopes.ravel()[self._flow.looks], cut.least)
        return bool(violated)

    def _paths_of(self, whole: Floats, flows: Floats) -> tuple[DronePath, ...]:
        """Paths with whole numbers of looks.

        With these fixed, the program is a network flow, whose corners are whole.
        """
        if not _are_whole(flows):
            low = self._program.low
            high = self._program.high
            self._program.limit(whole, whole)
            solved = self._program.solve()
            assert solved is not None
            flows = solved[2]
            self._program.limit(low, high)
        return self._flow.paths(flows)
