"""The environment in directed scenes: the order of a step, endings, several persons."""

from __future__ import annotations

import numpy as np
import pytest

from DroneSwarmSearch import DroneSwarmSearch, Ending

LEFT, RIGHT, UP, DOWN, SEARCH, IDLE = range(6)


def play(env: DroneSwarmSearch, *actions: int) -> tuple:
    """One step; an action for each drone."""
    return env.step(dict(zip(env.agents, actions, strict=True)))


def drone_cells(observations: dict) -> list[tuple[int, int]]:
    return [seen["observation"][0] for seen in observations.values()]


def test_searches_precede_the_drift_and_observations_follow_it() -> None:
    env = DroneSwarmSearch(grid_size=9, vector=(1, 0), disperse_constant=0)
    env.reset(seed=0)
    observations, rewards, _, _, infos = play(env, SEARCH)
    assert infos["Found"] and rewards == {"drone0": 20_000.0}
    matrix = observations["drone0"]["observation"][1]
    assert matrix[0, 1] == 1.0, "the new state is shown, drifted by one cell"
    frame = env.frame()
    assert frame.persons == ((0, 0),), "the frame shows where the person was found"
    assert frame.found_by == (0,) and frame.ending is Ending.FOUND


@pytest.mark.parametrize(
    ("starts", "actions", "cells", "points", "ending"),
    [
        pytest.param(
            [(1, 1), (2, 1)], [RIGHT, LEFT], [(2, 1), (1, 1)], [1, 1], None, id="exchange"
        ),
        pytest.param(
            [(1, 1), (3, 1)],
            [RIGHT, LEFT],
            [(2, 1), (2, 1)],
            [-100_000, -100_000],
            Ending.COLLISION,
            id="meet",
        ),
        pytest.param(
            [(0, 1), (1, 1)],
            [LEFT, LEFT],
            [(0, 1), (0, 1)],
            [-100_000, 1],
            Ending.LEFT_GRID,
            id="a drone that leaves does not collide",
        ),
    ],
)
def test_crashes(
    starts: list, actions: list, cells: list, points: list, ending: Ending | None
) -> None:
    env = DroneSwarmSearch(grid_size=5, n_drones=2, person_initial_position=(4, 4))
    env.reset(seed=0, drones_positions=starts)
    observations, rewards, terminations, truncations, _ = play(env, *actions)
    assert drone_cells(observations) == cells
    assert list(rewards.values()) == points
    ended = ending is not None
    assert set(terminations.values()) == set(truncations.values()) == {ended}
    assert env.agents == ([] if ended else ["drone0", "drone1"])
    assert env.frame().ending is ending


def test_a_search_succeeds_even_if_another_drone_collides_with_the_searcher() -> None:
    env = DroneSwarmSearch(grid_size=5, n_drones=2, person_initial_position=(1, 0))
    env.reset(seed=0)
    _, rewards, _, _, infos = play(env, RIGHT, SEARCH)
    assert rewards == {"drone0": -100_000.0, "drone1": -100_000.0}
    assert infos["Found"] and env.frame().found == (True,)


def test_persons_are_found_one_after_another() -> None:
    env = DroneSwarmSearch(
        grid_size=6,
        n_drones=2,
        vector=(0, 0),
        disperse_constant=0,
        person_initial_position=[(1, 0), (3, 0), (3, 0)],
    )
    observations, _ = env.reset(seed=0)
    matrix = observations["drone0"]["observation"][1]
    np.testing.assert_allclose(matrix[0, [1, 3]], [1 / 3, 2 / 3], rtol=1e-6)
    observations, rewards, _, _, infos = play(env, IDLE, SEARCH)
    assert list(rewards.values()) == [1, 20_000] and infos["Found"]
    assert observations["drone0"]["observation"][1][0, 3] == 1.0, "the mean over those missing"
    assert env.state()[2].sum() == 2
    play(env, IDLE, RIGHT)
    play(env, IDLE, RIGHT)
    observations, rewards, terminations, _, _ = play(env, SEARCH, SEARCH)
    # One search finds all persons in the cell.
    assert list(rewards.values()) == [-100, 10_000 + 10_000 * (1 - 3 / 100)]
    assert all(terminations.values()) and env.frame().found == (True, True, True)
    matrix = observations["drone0"]["observation"][1]
    np.testing.assert_allclose(matrix[0, [1, 3]], [1 / 3, 2 / 3], rtol=1e-6)
    assert env.state()[2].sum() == 0


@pytest.mark.parametrize("limit", [1, 33])
def test_the_limit_is_the_number_of_steps(limit: int) -> None:
    env = DroneSwarmSearch(grid_size=5, timestep_limit=limit, probability_of_detection=0)
    env.reset(seed=0)
    total = 0.0
    for step in range(1, limit + 1):
        _, rewards, terminations, truncations, infos = play(env, SEARCH if step % 3 else IDLE)
        total += rewards["drone0"]
        assert terminations == truncations == {"drone0": step == limit}
    assert total == -100_000 and not infos["Found"]
    assert env.frame().ending is Ending.TIME_LIMIT


def test_frames_keep_the_cell_and_the_finder_of_every_find() -> None:
    env = DroneSwarmSearch(
        grid_size=9,
        n_drones=2,
        vector=(1, 0),
        person_initial_position=[(1, 1), (4, 4)],
        disperse_constant=0,
    )
    env.reset(seed=0, drones_positions=[(8, 8), (1, 1)])
    assert env.frame().found_by == (None, None)
    play(env, IDLE, SEARCH)
    for step in range(1, 4):
        frame = env.frame()
        assert frame.persons == ((1, 1), (4 + step, 4))
        assert frame.found_by == (1, None) and frame.found == (True, False)
        play(env, IDLE, RIGHT)
    env.reset()
    assert env.frame().found_by == (None, None)
