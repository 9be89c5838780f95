"""Random searches for train_imitation.py: to train on, and held out to test on."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch import Drift, Person, Scenario
from DroneSwarmSearch.evaluation import NamedSearch, evaluate

__all__ = ["draw_searches", "held_out_searches", "mean_success"]

DRONES = 64
"""Drones in all searches drawn together; but there are 4 to 24 searches."""

HELD_OUT = 10**6
"""Seed of the held-out searches; training starts from smaller ones."""


def draw_searches(rng: np.random.Generator) -> tuple[list[Scenario], NDArray[np.int64]]:
    """Draw searches with one grid size, number of drones and time limit.

    Grids have 15 to 45 cells along each side, with one to 16 drones and up to 499 steps. One or
    two persons with one or two hypotheses drift by up to 1.6 cells per step. The probability of
    detection ranges from 0.3 to 1.

    Args:
        rng: the source of randomness.

    Returns:
        The scenarios, and every drone's start cell (x, y), int64, shape (searches, n, 2): the
        arguments of `ExpectedSearches`.
    """
    n_drones = int(rng.choice([1, 1, 1, 2, 2, 3, 4, 5, 6, 8, 10, 12, 16]))
    size = int(rng.integers(15, 46) if n_drones < 6 else rng.integers(25, 46))
    is_long = rng.random() < 0.35
    limit = int(rng.integers(120, 500) if is_long else rng.integers(2 * size, 4 * size))
    speed = rng.choice([0.0, rng.uniform(0.0, 0.7), rng.uniform(0.7, 1.6)], p=[0.1, 0.54, 0.36])
    persons = int(rng.choice([1, 1, 1, 2]))
    scenarios = []
    starts = []
    for _ in range(min(max(DRONES // n_drones, 4), 24)):
        pod = float(rng.choice([0.3, 0.4, 0.5, 0.7, 0.85, 1.0]))
        scenarios.append(
            Scenario(
                grid_size=size,
                n_drones=n_drones,
                timestep_limit=limit,
                persons=tuple(_draw_person(rng, size, speed, pod) for _ in range(persons)),
            )
        )
        # Start cells: a row of neighbours, or anywhere.
        first = int(rng.integers(0, size**2 - n_drones))
        in_line = np.arange(first, first + n_drones)
        cells = in_line if rng.random() < 0.5 else rng.permutation(size**2)[:n_drones]
        starts.append(np.stack([cells % size, cells // size], -1))
    return scenarios, np.array(starts)


def _draw_person(rng: np.random.Generator, grid_size: int, speed: float, pod: float) -> Person:
    """A person with one or two hypotheses; the faster the drift, the farther upwind the start."""
    known = rng.random() < 0.5
    drifts = []
    for _ in range(rng.choice([1, 1, 2])):
        angle = rng.uniform(0.0, 2 * np.pi)
        towards = np.array([np.cos(angle), np.sin(angle)])
        start = rng.uniform(0, grid_size, 2)
        if speed > 0.4:  # the person crosses the grid instead of waiting at its border
            middle = rng.normal(size=2) * grid_size / 8 + (grid_size - 1) / 2
            start = middle - towards * rng.uniform(0.0, 0.5) * grid_size
        start = start.clip(0, grid_size - 1).astype(int)
        drifts.append(
            Drift(
                (int(start[0]), int(start[1])),
                start_sd=0.0 if known else rng.uniform(0.5, grid_size / 8),
                vector=tuple(speed * towards),
                vector_sd=0.0 if known else rng.uniform(0.0, 0.08),
                diffusion=np.exp(rng.uniform(np.log(0.01), np.log(0.6))),
            )
        )
    return Person(tuple(drifts), pod)


def held_out_searches(count: int) -> list[NamedSearch]:
    """Searches as `draw_searches` draws them, each of its own size; always the same ones.

    They are coverage missions, and show the posterior.

    Args:
        count: the number of searches.
    """
    rng = np.random.default_rng(HELD_OUT)
    searches = []
    for number in range(count):
        scenarios, starts = draw_searches(rng)
        scenario = replace(scenarios[0], mission="coverage", bayesian_update=True)
        drones = tuple((int(x), int(y)) for x, y in starts[0])
        searches.append(NamedSearch(f"held-out-{number}", "Held out.", scenario, drones))
    return searches


def mean_success(
    policy_for: Callable[[Scenario], object], searches: Sequence[NamedSearch]
) -> float:
    """The mean probability of success of a deterministic policy, without sampling error.

    Args:
        policy_for: makes the policy for a scenario.
        searches: coverage missions: success is the mean over persons.
    """
    values = []
    for search in searches:
        result = evaluate(policy_for(search.scenario), search, episodes=1, name="policy")
        values.append(result.success.value)
    return float(np.mean(values))
