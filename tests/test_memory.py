"""Drones that remember their last actions: best paths and credits, against every path."""

from __future__ import annotations

from functools import cache
from itertools import pairwise, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from DroneSwarmSearch.planning.memory import MOVES, Histories, RememberingDrones
from DroneSwarmSearch.planning.paths import Path
from DroneSwarmSearch.planning.trajectories import Trajectories

Floats = np.ndarray
Case = tuple[Trajectories, float, int, np.random.Generator]

SIZE, STEPS = 3, 4


@cache
def every_path(start: int) -> list[Path]:
    """Every path without idling that stays in the grid."""
    paths = []
    for actions in product(range(5), repeat=STEPS):
        cells, searches = [start], []
        for action in actions:
            y, x = divmod(cells[-1], SIZE)
            dx, dy = (*MOVES, (0, 0))[action]
            if not (0 <= x + dx < SIZE and 0 <= y + dy < SIZE):
                break
            cells.append((y + dy) * SIZE + x + dx)
            searches.append(action == 4)
        else:
            paths.append(Path(np.array(cells), np.array(searches)))
    return paths


def looks(path: Path, cells: Floats) -> Floats:
    """Whether a path searches each trajectory in each step: shape (T, M)."""
    steps = len(path.searches)
    return path.searches[:, None] & (path.cells[:steps, None] == cells[:steps])


def collected_by_hand(path: Path, cells: Floats, detection: float, memory: int) -> Floats:
    """The credits and searches along each trajectory, from their definition."""
    total, each = np.zeros((2, cells.shape[1])), looks(path, cells)
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
def test_no_path_gains_more_than_the_best_one(case: Case) -> None:
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
    gained, paths = drones(weights)
    assert most <= gained <= most * (1 + 1e-5) + 1e-12
    assert [path.cells[0] for path in paths] == starts
    assert (weights * drones.collected(paths)).sum() == pytest.approx(most, rel=1e-5)


@settings(max_examples=25, derandomize=True)
@given(cases())
def test_paths_collect_credits_and_searches(case: Case) -> None:
    trajectories, detection, memory, rng = case
    drones = RememberingDrones(trajectories, SIZE, detection, [4], memory)
    paths = [every_path(4)[i] for i in rng.integers(0, len(every_path(4)), 20)]
    shares = rng.random(20)
    by_hand = [collected_by_hand(path, trajectories.cells, detection, memory) for path in paths]
    np.testing.assert_allclose(drones.collected(paths), np.sum(by_hand, axis=0), atol=1e-12)
    np.testing.assert_allclose(
        drones.collected(paths, shares), np.tensordot(shares, by_hand, axes=1), atol=1e-12
    )
    shorter = [Path(path.cells[: STEPS - 1], path.searches[: STEPS - 2]) for path in paths]
    by_hand = [collected_by_hand(path, trajectories.cells, detection, memory) for path in shorter]
    until = drones.until(STEPS - 2).collected(shorter)
    np.testing.assert_allclose(until, np.sum(by_hand, axis=0), atol=1e-12)


@settings(max_examples=25, derandomize=True)
@given(cases())
def test_credits_are_at_least_the_probability_of_finding(case: Case) -> None:
    """More memory means less credit; with all of it, credits are the probability itself."""
    trajectories, detection, _, rng = case
    path = every_path(4)[rng.integers(len(every_path(4)))]
    found = 1 - (1 - detection) ** looks(path, trajectories.cells).sum(axis=0)
    credits = [
        RememberingDrones(trajectories, SIZE, detection, [4], memory).collected([path])[0]
        for memory in range(STEPS)
    ]
    for more, less in pairwise(credits):
        assert (more >= less - 1e-12).all()
    np.testing.assert_allclose(credits[-1], found, atol=1e-12)


def test_histories_are_few() -> None:
    counts = [len(Histories(memory).all) for memory in range(6)]
    assert counts == [1, 2, 7, 25, 88, 309]
