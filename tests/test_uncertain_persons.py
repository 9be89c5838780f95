"""Persons whose start and drift are uncertain, in the environment."""

from typing import Any

import numpy as np
import pytest
from helpers import plain

from DroneSwarmSearch import (
    Action,
    Drift,
    DroneSwarmSearch,
    Ending,
    Person,
    RewardScheme,
    Scenario,
    priors,
)
from DroneSwarmSearch.vector import SwarmVectorEnv

SIZE = 12
DIAGONAL = priors.line(SIZE, [(2, 9), (9, 2)])
TWO_SIDES = Person(
    [
        Drift((4, 5), start_sd=1, vector=(0.1, 0.1), vector_sd=0.03, diffusion=0.1, weight=2),
        Drift((8, 7), start_sd=0.5, vector=(-0.1, 0), diffusion=0.05, adrift=5),
    ],
    0.8,
)
ON_A_LINE = Person(Drift(DIAGONAL, vector=(0.1, 0), diffusion=0.2), 0.6)
KNOWN = Person(Drift((6, 6), vector=(0.2, -0.1), diffusion=0.3))
IN_A_TIDE = Person(
    [
        Drift((4, 6), start_sd=1, vector={0: (0.4, 0), 20: (-0.4, 0.1)}, diffusion=0.1, adrift=4),
        Drift((6, 6), vector=(0.3, 0.1), vector_sd=[(0.1, 0)] * 9 + [(-0.1, 0.1)], diffusion=0.2),
    ],
    0.7,
)
SITUATIONS = {
    "a tide": [IN_A_TIDE],
    "two sides": [TWO_SIDES],
    "an array": [ON_A_LINE],
    "three persons": [TWO_SIDES, ON_A_LINE, KNOWN],
}


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


def environment(**changes: Any) -> DroneSwarmSearch:
    values = {"grid_size": SIZE, "n_drones": 2, "timestep_limit": 60, "persons": [TWO_SIDES]}
    return DroneSwarmSearch(**{**values, **changes})


def actions_of(rng: np.random.Generator, env: DroneSwarmSearch) -> dict[str, int]:
    """Random actions that keep drones on the grid."""
    chosen = {}
    for name, (x, y) in zip(env.agents, env.frame().drones, strict=True):
        inside = x > 0, x < SIZE - 1, y > 0, y < SIZE - 1, True, True
        chosen[name] = int(rng.choice(np.flatnonzero(inside)))
    return chosen


def play(env: DroneSwarmSearch, seed: int, **options: Any) -> list[Any]:
    """An episode of random actions as plain data."""
    rng = np.random.default_rng(seed)
    observations, infos = env.reset(seed=seed, **options)
    history = [plain([observations, infos])]
    while env.agents:
        *results, infos = env.step(actions_of(rng, env))
        looked_up = [infos.get(name) for name in ("ending", "step", "probability_of_success")]
        history.append(plain([*results, infos, looked_up, env.frame().persons]))
    return history


@pytest.mark.thorough
@pytest.mark.parametrize("person", [TWO_SIDES, ON_A_LINE])
def test_missing_persons_are_distributed_as_the_posterior(person):
    """Searches learn about cells and hypotheses, and the POS is the share of finds."""
    env = environment(persons=[person], bayesian_update=True, n_drones=4)
    cells = [(5, 5), (6, 6), (7, 7), (5, 6)]
    counts = np.zeros((SIZE, SIZE))
    episodes = 1000
    env.reset(seed=8)
    for _ in range(episodes):
        env.reset(drones_positions=cells)
        for step in range(12):
            action = Action.SEARCH if step % 3 else Action.IDLE
            *_, infos = env.step(dict.fromkeys(env.agents, action))
            if not env.agents:
                break
        else:
            ((x, y),) = env.frame().persons
            counts[y, x] += 1
            posterior = env.state()[0]
            success = infos["probability_of_success"]
            assert infos["drone0"]["probability_of_success"] == success
            (weights,) = env.frame().hypotheses
    finds = episodes - counts.sum()
    assert abs(finds - episodes * success) < 4 * (episodes * success * (1 - success)) ** 0.5
    found, limit = distance(counts, posterior)
    assert found <= limit
    assert sum(weights) == pytest.approx(1)
    if len(weights) > 1:
        assert weights != pytest.approx(person.drift.weights)


def test_persons_for_one_episode():
    env = environment()
    env.reset(seed=0, options={"persons": [KNOWN, ON_A_LINE]})
    assert env.scenario.persons == (KNOWN, ON_A_LINE)
    assert len(env.frame().persons) == 2
    env.reset()
    assert env.scenario.persons == (TWO_SIDES,)
    env = environment(persons=None, vector=(0.1, 0.1))
    env.reset(options={"persons": KNOWN})
    assert env.scenario.persons == (KNOWN,)
    assert env.vector == (0.1, 0.1)
    env.reset(vector=(0.2, 0.2))
    assert env.vector == (0.2, 0.2)
    with pytest.raises(ValueError, match="vector cannot be given together with persons"):
        env.reset(options={"persons": KNOWN}, vector=(0.3, 0.3))
    assert env.vector == (0.2, 0.2)


def test_the_probability_of_success_is_absent_without_beliefs():
    env = environment()
    *_, infos = env.reset(seed=0), env.step(dict.fromkeys(env.possible_agents, Action.SEARCH))[-1]
    assert "probability_of_success" not in infos
    assert infos.get("probability_of_success", -1) == -1
    with pytest.raises(KeyError):
        infos["probability_of_success"]
    assert "probability_of_success" not in infos["drone0"]


@pytest.mark.parametrize("shown", [False, True])
@pytest.mark.parametrize("name", SITUATIONS)
def test_expected_rewards_add_up_to_the_probability_of_success(name, shown):
    env = environment(
        persons=SITUATIONS[name], bayesian_update=shown, reward_scheme=RewardScheme.expected(10)
    )
    prior = environment(persons=SITUATIONS[name])
    for seed in range(5):
        rng = np.random.default_rng(seed)
        env.reset(seed=seed, drones_positions=[(5, 5), (6, 6)])
        prior.reset(seed=seed)
        total = 0.0
        while env.agents:
            _, rewards, *_, infos = env.step(actions_of(rng, env))
            total += rewards["total_reward"]
            if prior.agents:
                prior.step(dict.fromkeys(prior.agents, Action.IDLE))
            if not shown and env.agents and prior.agents and not any(env.frame().found):
                np.testing.assert_array_equal(env.state()[0], prior.state()[0])
        # Both drones are in different cells, or the episode has ended by a collision.
        if infos["ending"] is not Ending.COLLISION:
            assert total == pytest.approx(10 * infos["probability_of_success"])


def test_the_probability_of_success_never_falls():
    """Not even by rounding, in searches that cannot find; in both engines."""
    for seed in range(10):
        cells = np.random.default_rng(seed).random((SIZE, SIZE))
        blind = Person(Drift(cells, vector=(0.3, -0.2), diffusion=0.3), 0.0)
        env = environment(persons=[blind], bayesian_update=True, n_drones=1)
        batch = SwarmVectorEnv(1, scenario=env.scenario)
        env.reset(seed=seed), batch.reset(seed=seed)
        while env.agents:
            *_, infos = env.step({"drone0": Action.SEARCH})
            *_, batch_infos = batch.step(np.full(batch.action_space.shape, Action.SEARCH))
            assert infos["probability_of_success"] == batch_infos["probability_of_success"][0]
            assert 0.0 <= infos["probability_of_success"] < 1e-14


def test_coverage_ends_when_little_is_left_to_find():
    env = environment(persons=[KNOWN], mission="coverage", n_drones=1)
    assert env.scenario.reward_scheme == RewardScheme.expected()
    env.reset(seed=0, drones_positions=[(6, 6)])
    assert not env.state()[2].any() and env.frame().persons == ()
    _, rewards, terminations, _, infos = env.step({"drone0": Action.SEARCH})
    assert rewards == {"drone0": 1.0} and terminations == {"drone0": True}
    assert infos["ending"] is Ending.COVERED and infos["probability_of_success"] == 1.0
    assert not infos["Found"] and infos["persons_found"] == (False,)


def test_replacing_persons():
    usual = Scenario(SIZE, vector=(1, 1), disperse_constant=3, probability_of_detection=0.5)
    scenario = usual.replace(persons=TWO_SIDES)
    assert scenario == Scenario(SIZE, persons=[TWO_SIDES])
    assert scenario.detections == (0.8,)
    assert scenario.mean_vector == pytest.approx((0.1 / 3, 0.2 / 3))
    back = scenario.replace(persons=None, vector=(0, 1))
    assert back == Scenario(SIZE, vector=(0, 1))
    assert Scenario(SIZE, n_drones=2, persons=[KNOWN]).replace(n_drones=3).persons == (KNOWN,)


def test_mass_beyond_the_grid_is_that_of_the_worst_person():
    scenario = Scenario(SIZE, persons=[KNOWN, TWO_SIDES])
    for step in (0, 10, 60):
        each = [person.drift.mass_beyond(SIZE, step) for person in (KNOWN, TWO_SIDES)]
        assert scenario.mass_beyond_grid(step) == max(each)
    assert Scenario().mass_beyond_grid(100) > 0.99
    assert Scenario(61, person_initial_position=(30, 30)).mass_beyond_grid(1) < 1e-6


OUTSIDE = Person(Drift((SIZE, 0)))
WRONG_SHAPE = Person(Drift(np.ones((5, 5))))


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"persons": []}, ValueError, r"persons must hold at least one Person, got \[\]"),
        ({"persons": [Drift((1, 1))]}, TypeError, r"persons\[0\] must be a Person, got Drift"),
        ({"persons": [KNOWN, OUTSIDE]}, ValueError, r"persons\[1\]\.drifts\[0\]\.start.*0 to 11"),
        ({"persons": WRONG_SHAPE}, ValueError, r"persons\[0\]\.drifts\[0\]\.start.*\(12, 12\)"),
        ({"vector": (1, 0)}, ValueError, r"vector cannot be given together with persons, got \(1"),
    ],
)
def test_bad_arguments(arguments, error, message):
    with pytest.raises(error, match=message):
        DroneSwarmSearch(**{"grid_size": SIZE, "persons": [KNOWN], **arguments})
