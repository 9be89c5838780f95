"""Drones that remember their last actions: best paths and credits, against every path."""

from functools import cache
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from DroneSwarmSearch.bound import RememberingDrones, Trajectories
from DroneSwarmSearch.core import MOVES
from DroneSwarmSearch.planning import DronePath

Floats = np.ndarray
Case = tuple[Trajectories, float, int, np.random.Generator]

SIZE = 3
STEPS = 4


@cache
def every_path(start: int) -> list[DronePath]:
    """Every path without idling that stays in the grid."""
    paths = []
    for actions in product(range(5), repeat=STEPS):
        cells = [start]
        searches = []
        for action in actions:
            y, x = divmod(cells[-1], SIZE)
            dx, dy = (*MOVES, (0, 0))[action]
            if not (0 <= x + dx < SIZE and 0 <= y + dy < SIZE):
                break
            cells.append((y + dy) * SIZE + x + dx)
            searches.append(action == 4)
        else:
            paths.append(DronePath(np.array(cells), np.array(searches)))
    return paths


def looks(path: DronePath, cells: Floats) -> Floats:
    """Whether a path searches each trajectory in each step: shape (T, M)."""
    steps = len(path.searches)
    return path.searches[:, None] & (path.cells[:steps, None] == cells[:steps])


def collected_by_hand(path: DronePath, cells: Floats, detection: float, memory: int) -> Floats:
    """The credits and searches along each trajectory, from their definition."""
    total = np.zeros((2, cells.shape[1]))
    each = looks(path, cells)
    for step, now in enumerate(each):
        earlier = each[max(step - memory, 0) : step].sum(axis=0)
        total += now * [detection * (1 - detection) ** earlier, np.ones(cells.shape[1])]
    return total


@st.composite
def cases(draw: st.DrawFn) -> Case:
    """Trajectories of random moves, a probability of detection, a memory, and random draws."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    count = draw(st.integers(1, 12))
    still = draw(st.sampled_from([0.1, 0.6, 0.95]))
    places = rng.integers(0, SIZE, (2, count))
    cells = []
    for _ in range(STEPS):
        cells.append(places[1] * SIZE + places[0])
        moves = rng.integers(-1, 2, places.shape) * (rng.random(places.shape) > still)
        places = np.clip(places + moves, 0, SIZE - 1)
    probabilities = rng.dirichlet(np.ones(count))
    detection = draw(st.sampled_from([1.0, 0.7, 0.4]))
    return Trajectories(np.array(cells), probabilities), detection, draw(st.integers(0, 5)), rng


@settings(max_examples=15, derandomize=True)
@given(cases())
def test_no_path_gains_more_than_the_best_one(case):
    trajectories, detection, memory, rng = case
    starts = [0, 4]
    drones = RememberingDrones(trajectories, SIZE, detection, starts, memory)
    weights = rng.random((2, len(trajectories.probabilities))) * trajectories.probabilities
    weights[1] *= rng.integers(0, 2)
    most = sum(
        max(
            float((weights * collected_by_hand(path, trajectories.cells, detection, memory)).sum())
            for path in every_path(start)
        )
        for start in starts
    )
    assert most <= drones.most(drones.sums(weights)) <= most * (1 + 1e-5) + 1e-12


@settings(max_examples=15, derandomize=True)
@given(cases())
def test_a_soft_flow_is_a_mixture_of_all_paths(case):
    """A path's share is proportional to exp(what it gains); the flow collects the mean."""
    trajectories, detection, memory, rng = case
    count = len(trajectories.probabilities)
    starts = [0, 4]
    drones = RememberingDrones(trajectories, SIZE, detection, starts, memory)
    weights = rng.random((2, count))
    part = slice(count // 3, None)
    sums = drones.sums(weights[:, part], part)
    weights[:, : count // 3] = 0.0
    mean = np.zeros((2, count))
    for start in starts:
        each = np.array(
            [
                collected_by_hand(path, trajectories.cells, detection, memory)
                for path in every_path(start)
            ]
        )
        shares = np.exp((weights * each).sum(axis=(1, 2)))
        mean += np.tensordot(shares / shares.sum(), each, axes=1)
    flow = drones.soft_flow(sums)
    np.testing.assert_allclose(drones.collected(flow), mean, rtol=1e-4, atol=1e-6)
    np.testing.assert_allclose(drones.collected(flow, part), mean[:, part], rtol=1e-4, atol=1e-6)


@settings(max_examples=15, derandomize=True)
@given(cases())
def test_fewer_steps_are_those_of_fewer_cells(case):
    (cells, probabilities), detection, memory, rng = case
    starts = [0, 4]
    weights = rng.random((2, len(probabilities)))
    whole = RememberingDrones(Trajectories(cells, probabilities), SIZE, detection, starts, memory)
    short = Trajectories(cells[: STEPS - 2], probabilities)
    fewer = RememberingDrones(short, SIZE, detection, starts, memory)
    sums = whole.sums(weights)
    until = whole.until(STEPS - 2)
    assert until.most(sums) == pytest.approx(fewer.most(fewer.sums(weights)), rel=1e-6)
    flows = until.soft_flow(sums), fewer.soft_flow(fewer.sums(weights))
    collected = until.collected(flows[0]), fewer.collected(flows[1])
    np.testing.assert_allclose(*collected, rtol=1e-4)
