"""Survival: the curve in cold water, and finds that count as much as the person is alive."""

import csv
import itertools
import json
import math
import pickle
import random
from dataclasses import replace
from statistics import NormalDist
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from random_persons import check_search, random_search
from small_searches import observations, paths_of, search

from DroneSwarmSearch import (
    Action,
    Drift,
    DroneSwarmSearch,
    Person,
    RewardScheme,
    Scale,
    Scenario,
    survival,
)
from DroneSwarmSearch.cli import main
from DroneSwarmSearch.evaluation import NamedSearch, evaluate, save_csv
from DroneSwarmSearch.policies import BeliefTracker, SwarmPolicy, make

MINUTE = Scale(100, 60)
FALLING = (1.0, 0.9, 0.6, 0.2)


# Minutes by the formula of Hayward, Eckerson and Collis, worked out by hand.
@pytest.mark.parametrize(
    ("celsius", "minutes"), [(0, 106.72), (5, 132.07), (10, 176.80), (15, 276.82), (20, 700.71)]
)
def test_published_survival_times(celsius, minutes):
    assert survival.hayward(celsius) / 60 == pytest.approx(minutes, abs=0.005)


@pytest.mark.parametrize(
    ("sigma", "share", "times"),
    [(0.5, 0.025, math.exp(0.98)), (0.5, 0.5, 1), (0.5, 0.975, math.exp(-0.98)), (1, 0.5, 1)],
)
def test_the_survival_time_is_lognormal(sigma, share, times):
    median = 1000 * 60
    alive = survival.curve(median, scale=MINUTE, steps=3000, sigma=sigma)
    assert alive.shape == (3001,) and alive[0] == 1
    assert np.interp(1000 * times, np.arange(3001), alive) == pytest.approx(share, abs=1e-5)
    step = 777
    expected = 1 - NormalDist().cdf(math.log(step / 1000) / sigma)
    assert alive[step] == pytest.approx(expected, abs=1e-12)


@given(
    st.floats(-2, 20), st.integers(0, 300), st.floats(0.05, 3), st.integers(0, 60), st.floats(1, 90)
)
def test_time_in_the_water_moves_along_the_curve(celsius, steps, sigma, before, seconds):
    median = survival.hayward(celsius)
    scale = Scale(100, seconds)
    whole = survival.curve(median, scale=scale, steps=steps + before, sigma=sigma)
    start = before * scale.seconds_per_step
    later = survival.curve(median, scale=scale, steps=steps, in_water=start, sigma=sigma)
    np.testing.assert_allclose(later, whole[before:], atol=1e-12)
    assert (np.diff(whole) <= 0).all() and whole.min() >= 0 and whole.max() <= 1
    Person(Drift((0, 0)), survival=whole)


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        ({"median": 0}, ValueError, "median must be a finite number above 0, got 0"),
        ({"scale": 60}, TypeError, "scale must be a Scale, got 60"),
        ({"steps": 1.5}, TypeError, "steps must be an integer of at least 0, got 1.5"),
        ({"in_water": -1}, ValueError, "in_water must be .* at least 0, got -1"),
        ({"sigma": 0}, ValueError, "sigma must be a finite number above 0, got 0"),
    ],
)
def test_bad_curves_are_rejected(change, error, message):
    with pytest.raises(error, match=message):
        survival.curve(**{"median": 60, "scale": MINUTE, "steps": 9, **change})


@pytest.mark.parametrize("celsius", [-2.1, 20.1, math.nan])
def test_only_cold_water_is_accepted(celsius):
    with pytest.raises(ValueError, match=r"temperature must be .* at least -2 and at most 20"):
        survival.hayward(celsius)


def test_entries_are_by_completed_steps_and_the_last_one_lasts():
    person = Person(Drift((0, 0)), survival=FALLING)
    assert [person.alive(step) for step in range(6)] == [1.0, 0.9, 0.6, 0.2, 0.2, 0.2]
    assert Person(Drift((0, 0))).alive(10**9) == 1


@pytest.mark.parametrize("form", [list, tuple, np.array, lambda given: np.float32(given)])
def test_forms_copies_and_files_are_equal(form):
    given = (1, 0.5, 0.25, 0)
    person = Person(Drift((1, 2)), 0.3, survival=form(given))
    assert person == Person(Drift((1, 2)), 0.3, survival=given)
    assert (
        person != Person(Drift((1, 2)), 0.3) and person.drift.key == Person(Drift((1, 2))).drift.key
    )
    scenario = Scenario(persons=[person, Person(Drift((0, 0)))])
    data = json.loads(json.dumps(scenario.to_dict()))
    for copied in (
        pickle.loads(pickle.dumps(person)),
        Person.from_dict(json.loads(json.dumps(person.to_dict()))),
        Scenario.from_dict(data).persons_to_find[0],
    ):
        assert copied == person and hash(copied) == hash(person)
    # Files and fingerprints of searches without survival stay as they were.
    assert ["survival" in each for each in data["persons"]] == [True, False]


@pytest.mark.parametrize(
    ("given", "error", "message"),
    [
        (0.5, ValueError, r"got an array of shape \(\)"),
        ([], ValueError, r"got an array of shape \(0,\)"),
        ([[1, 0.5]], ValueError, r"got an array of shape \(1, 2\)"),
        ([1.0, 1.5], ValueError, "from 0 to 1, none above the one before, got 1.5 at step 1"),
        ([1.2, 1.1], ValueError, "got 1.2 at step 0"),
        ([1.0, -0.1], ValueError, "got -0.1 at step 1"),
        ([math.nan], ValueError, "got nan at step 0"),
        ([0.5, 0.4, 0.45], ValueError, "got 0.45 at step 2"),
        ("alive", TypeError, "got 'alive'"),
        ([1, None], TypeError, r"got \[1, None\]"),
    ],
)
def test_bad_survival_is_rejected(given, error, message):
    with pytest.raises(error, match=rf"survival must be one or more probabilities.*{message}"):
        Person(Drift((0, 0)), survival=given)


def test_expected_rewards_are_weighted_by_survival():
    first = Person(Drift((0, 0), diffusion=0.2), 0.5, survival=FALLING)
    second = Person(Drift((1, 0), diffusion=0.3), 0.8, survival=[0.7, 0.5])
    scheme = RewardScheme.expected(find=100)
    plain = {"grid_size": 3, "n_drones": 2, "timestep_limit": 6, "mission": "coverage"}
    alone = [
        DroneSwarmSearch(**plain, persons=[replace(each, survival=None)], reward_scheme=scheme)
        for each in (first, second)
    ]
    both = DroneSwarmSearch(**plain, persons=[first, second], reward_scheme=scheme)
    for env in (both, *alone):
        env.reset(seed=0)
    for step in range(6):
        action = dict.fromkeys(both.agents, Action.SEARCH if step % 3 < 2 else Action.IDLE)
        got, *each = (env.step(action)[1] for env in (both, *alone))
        for drone in action:
            pay = [
                person.alive(step) * rewards[drone]
                for person, rewards in zip((first, second), each, strict=True)
            ]
            assert got[drone] == pytest.approx(sum(pay) / 2, rel=1e-12)


@pytest.mark.thorough
def test_batches_and_single_environments_are_equal_with_survival():
    for number in range(100, 118):
        case = random_search(random.Random(number))
        rng = random.Random(number)

        def mortal(person: Person, rng: random.Random = rng) -> Person:
            curve = sorted((rng.random() for _ in range(rng.randint(1, 20))), reverse=True)
            return replace(person, survival=rng.choice([curve, None]))

        parameters = {**case.parameters, "reward_scheme": RewardScheme.expected(3.0)}
        if "situations" in parameters:
            parameters["situations"] = [[*map(mortal, all_)] for all_ in parameters["situations"]]
        if "persons" in parameters:
            parameters["persons"] = [*map(mortal, parameters["persons"])]
        check_search(replace(case, parameters=parameters))


def two_persons(*curves: Any) -> Scenario:
    """Still persons at the left and at the right end of a row, two cells from the drone."""
    cells = [(0, 2), (4, 2)]
    persons = [Person(Drift(c), 0.9, survival=s) for c, s in zip(cells, curves, strict=True)]
    return Scenario(5, persons=persons, timestep_limit=12, bayesian_update=True)


@pytest.mark.parametrize(
    ("policy", "curves", "move"),
    [
        ("greedy-posterior", (None, None), Action.LEFT),
        ("greedy-posterior", ([0.5], [0.6]), Action.RIGHT),
        ("greedy-forecast", ([0.6], [0.5]), Action.LEFT),
        # Only one of them is likely to be alive on arrival.
        ("greedy-posterior", ([1, 1, 0.1], [0.9]), Action.LEFT),
        ("greedy-forecast", ([1, 1, 0.1], [0.9]), Action.RIGHT),
    ],
)
def test_the_order_of_two_persons(policy, curves, move):
    scenario = two_persons(*curves)
    matrix = BeliefTracker(scenario).matrix()
    (action,) = make(policy, scenario)(observations([(2, 2)], matrix)).values()
    assert action == move


def test_success_is_the_mean_of_finding_alive():
    tracker = BeliefTracker(two_persons(FALLING, [0.5]))
    ahead = tracker.success_ahead(4)
    assert ahead[:, 2, 0] == pytest.approx(0.9 / 2 * np.array([1, 0.9, 0.6, 0.2, 0.2]))
    assert ahead[:, 2, 4] == pytest.approx([0.9 / 2 * 0.5] * 5)
    assert np.count_nonzero(ahead) == 10


def found_alive(of: NamedSearch, positions: Any, searching: Any) -> float:
    """The value of one drone's path for a still person, from each cell's probability of a find."""
    (person,) = of.scenario.persons_to_find
    chance = {
        drift.start: w for drift, w in zip(person.drift.drifts, person.drift.weights, strict=True)
    }
    value = 0.0
    for step, (cell, searches) in enumerate(zip(positions, searching, strict=False)):
        if searches and cell in chance:
            value += person.alive(step) * person.probability_of_detection * chance[cell]
            chance[cell] *= 1 - person.probability_of_detection
    return value


def planned(of: NamedSearch) -> float:
    """The value of the planner's path."""
    (path,) = paths_of(make("planner", of.scenario), of)
    size = of.scenario.grid_size
    return found_alive(of, [(c % size, c // size) for c in path.cells.tolist()], path.searches)


def optimum(of: NamedSearch) -> float:
    """The best value of all paths."""
    moves = {Action.LEFT: (-1, 0), Action.RIGHT: (1, 0), Action.UP: (0, -1), Action.DOWN: (0, 1)}
    best = 0.0
    size = of.scenario.grid_size
    for actions in itertools.product(Action, repeat=of.scenario.timestep_limit):
        cells = [of.drones[0]]
        for action in actions:
            dx, dy = moves.get(action, (0, 0))
            cells.append((cells[-1][0] + dx, cells[-1][1] + dy))
        if all(0 <= coordinate < size for cell in cells for coordinate in cell):
            searching = [action == Action.SEARCH for action in actions]
            best = max(best, found_alive(of, cells, searching))
    return best


def one_of(weights: dict[tuple[int, int], float], curve: Any, **more: Any) -> NamedSearch:
    """A still person in one of some cells, and a drone in the middle of 5 x 5 cells."""
    drifts = [Drift(cell, weight=weight) for cell, weight in weights.items()]
    person = Person(drifts, more.pop("detection", 0.8), survival=curve)
    return search([(2, 2)], grid_size=5, persons=[person], **more)


@pytest.mark.thorough
@pytest.mark.good_plans
@pytest.mark.parametrize("seed", range(6))
def test_small_plans_are_optimal(seed):
    rng = random.Random(seed)
    cells = rng.sample([(x, y) for x in range(1, 4) for y in range(1, 4)], 4)
    weights = {cell: rng.uniform(0.2, 1) for cell in cells}
    curve = sorted((rng.random() for _ in range(6)), reverse=True)
    of = one_of(weights, curve, timestep_limit=5, detection=rng.choice([0.5, 1]))
    assert planned(of) == pytest.approx(optimum(of), rel=1e-9)


class Visits(SwarmPolicy):
    """Searches (1, 2) in steps 1 and 2, then flies on to (0, 2), and searches it."""

    def begin(self) -> list[Action]:
        return [Action.LEFT, Action.SEARCH, Action.SEARCH, Action.LEFT]

    def choose(self, memory: Any, cells: Any, matrix: Any) -> list[Action]:
        return [memory.pop(0) if memory else Action.SEARCH]


CURVE = [1.0, 0.9, 0.8, 0.5, 0.4, 0.3]
WEIGHTS = {(1, 2): 0.5, (0, 2): 0.3, (4, 4): 0.2}
ALIVE = 0.5 * (0.8 * 0.9 + 0.16 * 0.8) + 0.3 * (0.8 * 0.4 + 0.16 * 0.3)


@pytest.mark.parametrize("mission", ["rescue", "coverage"])
def test_success_alive_by_hand(mission, tmp_path):
    dying = one_of(WEIGHTS, CURVE, timestep_limit=6, mission=mission)
    result = evaluate(Visits, dying, episodes=3)
    assert result.success.value == pytest.approx(0.5 * 0.96 + 0.3 * 0.96)
    assert result.success_alive.is_exact and result.success_alive.value == pytest.approx(ALIVE)
    always = evaluate(Visits, one_of(WEIGHTS, None, timestep_limit=6, mission=mission), episodes=3)
    assert always.success == result.success and always.success_alive is None
    assert "success_alive" not in always.summary
    if mission == "coverage":  # its rewards add up to the same
        assert result.mean_return == pytest.approx(ALIVE)
    # The columns are there if one search has them, in any order.
    save_csv(tmp_path / "table.csv", [always, result])
    first, second = csv.DictReader((tmp_path / "table.csv").read_text().splitlines())
    assert first["success_alive"] == "" and float(second["success_alive"]) == pytest.approx(ALIVE)
    save_csv(tmp_path / "usual.csv", [always])
    assert "alive" not in (tmp_path / "usual.csv").read_text()


def test_sampled_success_alive_is_the_share_found_alive():
    dying = one_of(WEIGHTS, CURVE, timestep_limit=6)
    result = evaluate(Visits, dying, episodes=2000, deterministic=False)
    assert not result.success_alive.is_exact
    at = result.episodes.found_at[:, 0]
    alive = np.where(at > 0, np.array(CURVE)[np.maximum(at - 1, 0)], 0.0)
    assert alive.mean() == pytest.approx(ALIVE, abs=0.03)
    assert result.success_alive.low - 1e-9 <= ALIVE <= result.success_alive.high + 1e-9


def test_the_table_shows_it_for_searches_with_survival(capsys, tmp_path):
    files = []
    for name, curve in (("dying", CURVE), ("always", None)):
        files.append(str(tmp_path / f"{name}.json"))
        data = one_of(WEIGHTS, curve, timestep_limit=6).data
        (tmp_path / f"{name}.json").write_text(json.dumps(data))
    main(["evaluate", "greedy-forecast", *files, "--episodes", "2"])
    head, _, dying, always, *_ = capsys.readouterr().out.splitlines()
    assert "alive, %" in head
    assert dying.split()[3].replace(".", "").isdigit() and always.split()[3] == "-"
    main(["evaluate", "greedy-forecast", files[1], "--episodes", "2"])
    assert "alive" not in capsys.readouterr().out
