"""Evaluations of coverage missions: episodes, estimates, comparisons, stored entries and files."""

import csv
from typing import Any

import numpy as np
import pytest

from DroneSwarmSearch import Action, Drift, DroneSwarmSearch, Ending, Person, Scenario
from DroneSwarmSearch.evaluation import Evaluation, NamedSearch, bounded_mean, evaluate, save_csv

DRONES = ((2, 2), (4, 3))
LIMIT = 15


def mission(**changes: Any) -> NamedSearch:
    """A small mission that two drones may complete, with an uncertain person and a still one."""
    line = np.zeros((7, 7))
    line[2, 1:4] = 1
    uncertain = Person(
        [
            Drift(line, vector=(0.1, 0), diffusion=0.05),
            Drift((3, 3), start_sd=0.6, vector=(0.2, -0.1), vector_sd=0.05, weight=2),
        ],
        0.9,
    )
    values = {
        "grid_size": 7,
        "n_drones": 2,
        "timestep_limit": LIMIT,
        "persons": [uncertain, Person(Drift((4, 3)), 0.9)],
        "mission": "coverage",
        **changes,
    }
    return NamedSearch("lane", "For tests.", Scenario(**values), DRONES[: values["n_drones"]])


class Wanderer:
    """Searches or flies at random, by the seeds of the episodes."""

    CHOICES = (*[int(Action.SEARCH)] * 6, *range(4))

    def reset(self, seed: Any = None, rows: Any = None) -> None:
        seeds = seed if isinstance(seed, list) else [seed]
        self.generators = [np.random.default_rng(each) for each in seeds]

    def __call__(self, shown: Any) -> Any:
        if "row" in shown:
            rows = shown["row"].tolist()
            return np.array([self.generators[row].choice(self.CHOICES, 2) for row in rows])
        return dict(zip(shown, self.generators[0].choice(self.CHOICES, 2).tolist(), strict=True))


def still(shown: Any) -> Any:
    """Search the start cells all the time."""
    return np.full(shown["positions"].shape[:2], int(Action.SEARCH))


def evaluated(policy: Any, search: NamedSearch, **options: Any) -> Evaluation:
    return evaluate(policy, search, progress=False, **{"episodes": 30, **options})


@pytest.mark.parametrize("bayesian_update", [False, True])
def test_metrics_are_those_of_the_single_environment(bayesian_update):
    """The POS after every step, the cells searched and searched again, counted by hand."""
    search = mission(bayesian_update=bayesian_update)
    got = evaluated(Wanderer(), search)
    env = DroneSwarmSearch(scenario=search.scenario)
    kinds = set()
    rates = []
    for seed in range(30):
        policy = Wanderer()
        policy.reset(seed)
        shown, _ = env.reset(seed, drones_positions=DRONES)
        success = [0.0]
        searches = []
        while env.agents:
            actions = policy(shown)
            cells = [each["observation"][0] for each in shown.values()]
            pairs = zip(cells, actions.values(), strict=True)
            searches += [cell for cell, action in pairs if action == Action.SEARCH]
            shown, _, _, _, infos = env.step(actions)
            success.append(infos["probability_of_success"])
        success += success[-1:] * (LIMIT + 1 - len(success))
        np.testing.assert_allclose(got.curves[seed], success, rtol=0, atol=1e-15)
        assert got.episodes.searches[seed] == len(searches)
        assert got.episodes.cells_searched[seed] == len(set(searches))
        assert got.episodes.endings[seed] == env.frame().ending
        rates.append([len(set(searches)) / 49, (len(searches) - len(set(searches))) / 49])
        kinds.add(env.frame().ending)
    assert len(kinds) > 1
    means = got.coverage_rate.value, got.repetition_rate.value
    assert means == pytest.approx(np.mean(rates, axis=0))


def test_two_drones_that_stay_where_they_are():
    """Figures by hand: one searches a person's cell until the mission is complete."""
    got = evaluated(still, mission(persons=Person(Drift((4, 3)), 0.8)), episodes=2)
    curve = [0.0, 0.8, 0.96, *[0.992] * (LIMIT - 2)]
    assert got.curves == pytest.approx(np.array([curve, curve]))
    assert got.endings[Ending.COVERED] == 2
    assert got.episodes.steps.tolist() == [3, 3]
    assert got.episodes.searches.tolist() == [6, 6]
    assert got.episodes.cells_searched.tolist() == [2, 2]
    unseen = bounded_mean([0.0] * 2).high  # the largest share of other paths
    limits = 0.992 * (1 - unseen), 0.992 + 0.008 * unseen
    assert got.success == pytest.approx((0.992, *limits))
    assert got.coverage_rate.value == pytest.approx(2 / 49)
    assert got.repetition_rate.value == pytest.approx(4 / 49)
    assert got.time.value == pytest.approx(1 + 0.2 + 0.04 + 0.008 * (LIMIT - 3))


def test_coverage_is_the_exact_success_of_a_rescue_with_one_person():
    """The policy acts alike in both missions until the person is found."""
    scenario = mission(timestep_limit=8).scenario
    person = scenario.persons_to_find[0]
    for policy in ("planner", "parallel-sweep"):
        rescue, coverage = (
            evaluated(
                policy,
                mission(mission=name, timestep_limit=8, persons=person, bayesian_update=True),
                episodes=episodes,
            )
            for name, episodes in (("rescue", 2), ("coverage", 2))
        )
        assert coverage.is_exact
        assert 0.2 < coverage.success.value < 0.99
        if policy == "planner":  # it plans for early finds in a rescue only
            assert rescue.success.value == pytest.approx(coverage.success.value, abs=0.02)
            continue
        assert rescue.success_by_time == pytest.approx(coverage.success_by_time, abs=1e-12)
        assert rescue.time.value == pytest.approx(coverage.time.value)


def test_files_hold_the_measures_of_coverage(tmp_path):
    got = evaluated(Wanderer(), mission(), episodes=5)
    rescue = evaluated(Wanderer(), mission(mission="rescue"), episodes=5)
    save_csv(tmp_path / "summary.csv", [rescue, got])
    first, second = csv.DictReader((tmp_path / "summary.csv").read_text().splitlines())
    assert (first["mission"], second["mission"]) == ("rescue", "coverage")
    assert first["coverage_rate"] == second["calibration_error"] == ""
    assert float(second["coverage_rate"]) == got.coverage_rate.value
    assert float(second["repetition_rate_high"]) == got.repetition_rate.high
