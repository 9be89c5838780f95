"""Thousands of episodes agree in distribution with the matrix and the posterior."""

from __future__ import annotations

import numpy as np
import pytest

from DroneSwarmSearch import DroneSwarmSearch

IDLE, SEARCH = 5, 4
EPISODES = 1200


def distance(counts: np.ndarray, matrix: np.ndarray) -> tuple[float, float]:
    """Return the total variation between frequencies and a matrix, and its limit.

    The limit is the mean distance of samples of the same size from the matrix, plus four
    standard deviations.
    """
    forecast = matrix.astype(float).ravel() / matrix.sum(dtype=float)
    n = int(counts.sum())
    rng = np.random.default_rng(0)
    samples = rng.multinomial(n, forecast, size=200) / n
    floors = np.abs(samples - forecast).sum(axis=1) / 2
    found = np.abs(counts.ravel() / n - forecast).sum() / 2
    return found, float(floors.mean() + 4 * floors.std())


@pytest.mark.parametrize(
    ("vector", "constant", "start", "t"),
    [
        ((0, 0), 10, (10, 10), 20),
        ((0.5, 0.5), 3, (3, 4), 15),
        ((1, 1), 0.5, (2, 2), 12),
        ((3.5, -0.5), 10, (5, 15), 25),
        ((-0.5, -0.5), 10, (0, 0), 20),
        ((0.3, -0.2), 100, (10, 1), 30),
        ((0.5, 0), 0, (1, 1), 9),
    ],
)
def test_matrix(
    vector: tuple[float, float], constant: float, start: tuple[int, int], t: int
) -> None:
    env = DroneSwarmSearch(
        grid_size=20, vector=vector, disperse_constant=constant, person_initial_position=start
    )
    counts = np.zeros((20, 20))
    env.reset(seed=11)
    for _ in range(EPISODES):
        env.reset()
        for _ in range(t):
            env.step({"drone0": IDLE})
        ((x, y),) = env.frame().persons
        counts[y, x] += 1
    found, limit = distance(counts, env.state()[0])
    assert found <= limit


@pytest.mark.parametrize(
    ("vector", "constant", "detection"),
    [((0.2, 0.1), 10, 0.6), ((-0.4, 0.3), 3, 1.0), ((0, 0), 100, 0.3), ((0.5, -2), 1, 0.8)],
)
def test_posterior(vector: tuple[float, float], constant: float, detection: float) -> None:
    """Three drones search three cells around the person's start in every other step."""
    size, t = 9, 10
    env = DroneSwarmSearch(
        grid_size=size,
        n_drones=3,
        vector=vector,
        person_initial_position=(4, 4),
        disperse_constant=constant,
        probability_of_detection=detection,
        bayesian_update=True,
    )
    counts = np.zeros((size, size))
    chance_not_found = 1.0
    env.reset(seed=5)
    posterior = np.zeros((size, size))
    for _ in range(EPISODES):
        observations, _ = env.reset(drones_positions=[(4, 4), (5, 4), (4, 3)])
        chance = 1.0
        for step in range(t):
            matrix = observations["drone0"]["observation"][1]
            searching = step % 2 == 1
            if searching:
                chance *= 1 - detection * float(matrix[4, 4] + matrix[4, 5] + matrix[3, 4])
            action = SEARCH if searching else IDLE
            observations, *_ = env.step(dict.fromkeys(env.agents, action))
            if not env.agents:
                break
        else:
            ((x, y),) = env.frame().persons
            counts[y, x] += 1
            posterior, chance_not_found = env.state()[0], chance
    survived = counts.sum()
    assert 100 < survived < EPISODES
    spread = (EPISODES * chance_not_found * (1 - chance_not_found)) ** 0.5
    assert abs(survived - EPISODES * chance_not_found) < 4 * spread
    found, limit = distance(counts, posterior)
    assert found <= limit


def test_detections_follow_their_probability() -> None:
    env = DroneSwarmSearch(
        grid_size=3,
        disperse_constant=0,
        vector=(0, 0),
        person_initial_position=[(0, 0), (0, 0), (0, 0)],
        probability_of_detection=[0.25, 0.5, 0.9],
    )
    env.reset(seed=2)
    counts = np.zeros(3)
    for _ in range(EPISODES):
        env.reset()
        env.step({"drone0": SEARCH})
        counts += env.frame().found
    expected = np.array([0.25, 0.5, 0.9])
    spread = np.sqrt(expected * (1 - expected) / EPISODES)
    assert (np.abs(counts / EPISODES - expected) < 4 * spread).all()
