"""Persons who drift together: their beliefs against enumeration, in engines and in policies."""

import numpy as np
import pytest
from sea import IDLE, SEARCH, WEIGHTS, Enumeration, moves_apart, person, wreck
from twins import Twins, play

from DroneSwarmSearch import Drift, DroneSwarmSearch, Person, RewardScheme, Scenario, Tracks
from DroneSwarmSearch.bound import success_bound
from DroneSwarmSearch.evaluation import evaluate
from DroneSwarmSearch.planning import plan_paths
from DroneSwarmSearch.policies.belief_tracker import BeliefTracker
from DroneSwarmSearch.vector import SearchBatch


@pytest.mark.parametrize("persons", [2, 3])
def test_the_matrix_is_that_of_enumeration(persons):
    scenario = wreck(persons)
    env = DroneSwarmSearch(scenario=scenario)
    finds = 0
    for seed in range(12 if persons == 2 else 5):
        positions = [(1, 1), (2, 1)]
        env.reset(seed=seed, drones_positions=positions)
        exact = Enumeration(scenario)
        rng = np.random.default_rng(seed)
        for step in range(12):
            cells = env.snapshot().cells
            before = env.frame().found
            actions = moves_apart(rng, np.array([positions]), 4)[0]
            observations, _, _, _, _ = env.step(
                {f"drone{drone}": int(action) for drone, action in enumerate(actions)}
            )
            frame = env.frame()
            positions = list(frame.drones)
            searched = [cells[drone] for drone in range(2) if actions[drone] == SEARCH]
            new = [who for who in range(persons) if frame.found[who] and not before[who]]
            found = {who: frame.persons[who][1] * 4 + frame.persons[who][0] for who in new}
            if searched:
                exact.search(searched, found)
            finds += len(found)
            exact.drift(step)
            if not env.agents:
                break
            matrix = observations["drone0"]["observation"][1].reshape(-1)
            assert matrix == pytest.approx(exact.matrix, abs=1e-6)
            for weights in frame.hypotheses:
                assert weights == pytest.approx(exact.hypotheses, abs=1e-9)
    assert finds > 4


SCENARIOS = {
    "posterior": {},
    "expected": {"reward_scheme": RewardScheme.expected()},
    "coverage": {"mission": "coverage"},
    "forecast": {"bayesian_update": False},
    "given misses": {"reward_scheme": RewardScheme.expected(given_misses=True)},
    "expected, forecast": {"bayesian_update": False, "reward_scheme": RewardScheme.expected()},
}


@pytest.mark.thorough
@pytest.mark.parametrize("changes", SCENARIOS.values(), ids=SCENARIOS)
def test_batches_are_the_same_bit_for_bit(changes):
    scenario = wreck(3, size=7, n_drones=3, **changes)
    twins = Twins(5, {"scenario": scenario, "drones_positions": [(1, 1), (3, 1), (2, 3)]})
    twins.reset(range(5))
    play(twins, 60)
    assert max(twins.episodes) > 0


def test_situations_may_have_different_hypotheses():
    two = [Drift((1, 2), vector=(0.2, 0.1), diffusion=0.1), Drift((3, 2), diffusion=0.3, weight=3)]
    situations = [
        [person((1, 1)), person((2, 1), slow=0.5)],
        [Person(two, 0.6), Person(two[::1], 0.9)],
        [Person(Drift((2, 2), diffusion=0.2), 0.5), Person(Drift((1, 3)), 0.5)],
    ]
    parameters = {"grid_size": 6, "n_drones": 2, "timestep_limit": 15, "bayesian_update": True}
    twins = Twins(6, {**parameters, "situations": situations, "shared_drift": True})
    twins.reset(range(6))
    play(twins, 50)
    twins.reset(range(6), given={"situations": situations[1:]})
    play(twins, 20)


def test_all_persons_have_one_hypothesis_as_often_as_it_weighs():
    """Without diffusion, the displacement of each person says which hypothesis is theirs."""
    vectors = [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0)]
    persons = [
        Person(
            [
                Drift((8, 8), vector=vector, diffusion=0, weight=weight, start_sd=1.0)
                for vector, weight in zip(vectors, WEIGHTS, strict=True)
            ]
        )
        for _ in range(3)
    ]
    scenario = Scenario(21, persons=persons, shared_drift=True, timestep_limit=20)
    batch = SearchBatch(3000, scenario)
    batch.reset(seeds=range(3000))
    starts = batch.person_cells
    for _ in range(4):
        batch.step(np.full((3000, 1), IDLE))
    moved = batch.person_cells - starts
    assert (moved == moved[:, :1]).all(), "all persons of a row drift alike"
    shares = [np.mean(moved[:, 0] == step) for step in (4, 4 * 21, -4)]
    assert shares == pytest.approx(WEIGHTS, abs=0.03)
    apart = (starts[:, 0] != starts[:, 1]).mean()
    assert apart > 0.8, "but they start on their own"


def test_the_probability_of_success_counts_persons_found():
    env = DroneSwarmSearch(scenario=wreck(2, n_drones=1))
    for seed in range(20):
        env.reset(seed=seed, drones_positions=[(1, 1)])
        success = 0.0
        while env.agents:
            _, _, _, _, infos = env.step({"drone0": SEARCH})
            found = sum(infos["persons_found"])
            assert infos["probability_of_success"] >= max(found / 2, 0.0) - 1e-12
            assert infos["probability_of_success"] >= success - 1e-12 or found
            success = infos["probability_of_success"]
        if infos["is_success"]:
            assert success == 1.0


def test_expected_rewards_of_a_coverage_mission_add_up_to_the_probability_of_success():
    scenario = wreck(3, n_drones=1, mission="coverage", reward_scheme=RewardScheme.expected())
    env = DroneSwarmSearch(scenario=scenario)
    env.reset(seed=0, drones_positions=[(1, 1)])
    total = 0.0
    rng = np.random.default_rng(0)
    while env.agents:
        position = env.frame().drones
        action = int(moves_apart(rng, np.array([position]), 4)[0, 0])
        _, rewards, _, _, infos = env.step({"drone0": action})
        total += rewards["drone0"]
    assert total == pytest.approx(infos["probability_of_success"], abs=1e-9)
    assert total > 0.3


@pytest.mark.parametrize("shared_drift", [True, False])
def test_expected_rewards_given_misses_have_the_mean_of_the_share_found(shared_drift):
    """And less variance."""
    scheme = RewardScheme.expected(given_misses=True)
    scenario = wreck(3, crash="block", reward_scheme=scheme).replace(shared_drift=shared_drift)
    batch = SearchBatch(4000, scenario=scenario)
    batch.reset(list(range(4000)))
    paid = np.zeros(4000)
    shares = np.zeros(4000)
    rng = np.random.default_rng(0)
    for _ in range(scenario.timestep_limit):
        actions = rng.integers(0, 6, (4000, 2))
        actions[:, 1] = np.where(rng.random(4000) < 0.5, 4, actions[:, 1])
        going = ~batch.ended
        missing = batch.missing.mean(axis=1)
        batch.step(actions)
        paid[going] += batch.rewards[going].sum(axis=1)
        shares[going] += (missing - batch.missing.mean(axis=1))[going]
    assert 0.2 < shares.mean() < 0.95
    difference = paid - shares
    assert abs(difference.mean()) < 4.0 * difference.std() / np.sqrt(4000)
    assert paid.var() < shares.var()


@pytest.mark.parametrize("bayesian", [True, False])
def test_a_swarm_knows_what_the_matrix_shows(bayesian):
    """The tracker of policies infers from the matrix who was found, and where."""
    scenario = wreck(3, size=8, bayesian_update=bayesian)
    env = DroneSwarmSearch(scenario=scenario)
    finds = 0
    for seed in range(15):
        positions = [(1, 1), (5, 1)]
        observations, _ = env.reset(seed=seed, drones_positions=positions)
        tracker = BeliefTracker(scenario)
        rng = np.random.default_rng(seed)
        while env.agents:
            matrix = observations["drone0"]["observation"][1]
            tracker.observe(matrix)
            assert np.array_equal(tracker.matrix(), matrix)
            actions = moves_apart(rng, np.array([positions]), 8)[0]
            tracker.update(positions, actions.tolist())
            observations, _, _, _, infos = env.step(
                {f"drone{drone}": int(action) for drone, action in enumerate(actions)}
            )
            positions = list(env.frame().drones)
        finds += sum(infos["persons_found"])
    assert finds > 5


REFUSED = {
    "weights": [person((1, 1)), Person([Drift((1, 1)), Drift((1, 2)), Drift((2, 1))])],
    "counts": [person((1, 1)), Person(Drift((1, 1)))],
    "tracks": [Person(Tracks([[(1.0, 1.0), (1.2, 1.0)], [(1.0, 1.0), (1.0, 1.4)]]))],
}


@pytest.mark.parametrize("persons", REFUSED.values(), ids=REFUSED)
def test_persons_who_cannot_share_a_hypothesis_are_refused(persons):
    with pytest.raises(ValueError, match=r"^shared_drift needs persons "):
        Scenario(5, persons=persons, shared_drift=True, timestep_limit=1)


def test_a_shared_search_survives_its_data():
    scenario = wreck()
    assert Scenario.from_dict(scenario.to_dict()) == scenario
    assert scenario.replace(shared_drift=False) != scenario


@pytest.mark.thorough
def test_no_policy_exceeds_the_mean_of_the_bounds_for_each_hypothesis():
    scenario = wreck(2, size=5, timestep_limit=12)
    positions = [(0, 0), (1, 0)]
    quick = {"horizons": 1, "memory": 2, "sample": 2**13}
    shared = success_bound(scenario, positions, **quick)
    alone = [
        (weight, success_bound(known, positions, **quick))
        for weight, known in scenario.by_hypothesis()
    ]
    assert [weight for weight, _ in alone] == pytest.approx(WEIGHTS)
    mean = sum(weight * bound.by_limit for weight, bound in alone)
    # All hypotheses' samples must hold together, so each counts as a little less certain.
    assert mean <= shared.by_limit == pytest.approx(mean, abs=0.005)
    found = evaluate("greedy-posterior", scenario, episodes=100, progress=False)
    assert 0.05 < found.success.value < shared.by_limit


def test_plans_for_persons_who_drift_together_find_them_as_often_as_they_say():
    scenario = wreck(2, size=6, timestep_limit=14)
    positions = [(1, 1), (3, 2)]
    planned = plan_paths(scenario, positions, seconds=1)
    rows = 6000
    batch = SearchBatch(rows, scenario, drones_positions=positions)
    batch.reset(seeds=range(rows))
    found = np.zeros(rows, np.bool_)
    moves = {-1: 0, 1: 1, -6: 2, 6: 3}
    for step in range(14):
        actions = [
            SEARCH
            if path.searches[step]
            else moves.get(path.cells[step + 1] - path.cells[step], IDLE)
            for path in planned.paths
        ]
        batch.step(np.tile(actions, (rows, 1)))
        found |= batch.endings == 1
    assert found.mean() == pytest.approx(planned.by_time[-1], abs=0.02)


def test_pictures_show_the_hypotheses_of_all_persons_once():
    env = DroneSwarmSearch(scenario=wreck(3), render_mode="ansi")
    env.reset(seed=0)
    text = env.render()
    assert text.count("hypotheses") == 1
    assert "hypotheses of all persons: 50% 30% 20%" in text
    batch = SearchBatch(1, wreck(3))
    batch.reset(seeds=[0])
    assert batch.frame(0).shared_drift and batch.frame(0).uncertain_persons == (0,)
    alone = DroneSwarmSearch(scenario=wreck(3).replace(shared_drift=False), render_mode="ansi")
    alone.reset(seed=0)
    assert alone.render().count("hypotheses of person") == 3
