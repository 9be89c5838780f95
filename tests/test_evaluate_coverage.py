"""Evaluations of coverage missions: episodes, estimates, comparisons, stored entries and files."""

from __future__ import annotations

import csv
import json
from typing import Any

import numpy as np
import pytest
from helpers import data_of

from DroneSwarmSearch import Action, Drift, DroneSwarmSearch, Ending, Person, Scenario
from DroneSwarmSearch.evaluation import (
    Evaluation,
    NamedSearch,
    compare,
    evaluate,
    save_csv,
    save_episodes,
    save_json,
)
from DroneSwarmSearch.evaluation.statistics import bounded_mean, wilson
from DroneSwarmSearch.planning import success_bound
from DroneSwarmSearch.vector import SwarmVectorEnv

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
def test_metrics_are_those_of_the_single_environment(bayesian_update: bool) -> None:
    """The POS after every step, the cells searched and searched again, counted by hand."""
    search = mission(bayesian_update=bayesian_update)
    got = evaluated(Wanderer(), search)
    assert got.coverage is not None
    env = DroneSwarmSearch(scenario=search.scenario)
    kinds, rates = set(), []
    for seed in range(30):
        policy = Wanderer()
        policy.reset(seed)
        shown, _ = env.reset(seed, drones_positions=DRONES)
        success, searches = [0.0], []
        while env.agents:
            actions = policy(shown)
            cells = [each["observation"][0] for each in shown.values()]
            pairs = zip(cells, actions.values(), strict=True)
            searches += [cell for cell, action in pairs if action == Action.SEARCH]
            shown, _, _, _, infos = env.step(actions)
            success.append(infos["probability_of_success"])
        success += success[-1:] * (LIMIT + 1 - len(success))
        np.testing.assert_allclose(got.curves[seed], success, rtol=0, atol=1e-15)
        assert got.coverage.searches[seed] == len(searches)
        assert got.coverage.cells_searched[seed] == len(set(searches))
        assert got.episodes.endings[seed] == env.frame().ending
        rates.append([len(set(searches)) / 49, (len(searches) - len(set(searches))) / 49])
        kinds.add(env.frame().ending)
    assert len(kinds) > 1
    assert got.coverage_rate is not None
    assert got.repetition_rate is not None
    means = got.coverage_rate.value, got.repetition_rate.value
    assert means == pytest.approx(np.mean(rates, axis=0))


def test_two_drones_that_stay_where_they_are() -> None:
    """Figures by hand: one searches a person's cell until the mission is complete."""
    got = evaluated(still, mission(persons=Person(Drift((4, 3)), 0.8)), episodes=2)
    assert got.coverage is not None
    curve = [0.0, 0.8, 0.96, *[0.992] * (LIMIT - 2)]
    assert got.curves == pytest.approx(np.array([curve, curve]))
    assert got.endings[Ending.COVERED] == 2
    assert got.episodes.steps.tolist() == [3, 3]
    assert got.coverage.searches.tolist() == [6, 6]
    assert got.coverage.cells_searched.tolist() == [2, 2]
    unseen = wilson(0, 2).at(()).high  # the largest share of other paths
    limits = 0.992 * (1 - unseen), 0.992 + 0.008 * unseen
    assert got.success == pytest.approx((0.992, *limits))
    assert got.coverage_rate == pytest.approx((2 / 49, 2 / 49, 2 / 49))
    assert got.repetition_rate == pytest.approx((4 / 49, 4 / 49, 4 / 49))
    assert got.time.value == pytest.approx(1 + 0.2 + 0.04 + 0.008 * (LIMIT - 3))


def test_success_is_the_mean_probability_of_success() -> None:
    got = evaluated(Wanderer(), mission())
    assert got.coverage is not None
    curves = got.curves
    assert got.success == pytest.approx(bounded_mean(curves[:, -1]))
    assert got.success.low < got.success.value < got.success.high
    assert got.success_by_time.value.shape == (LIMIT + 1,)
    assert got.success_by_time.value[0] == 0.0
    for step in (0, 4, LIMIT):
        assert got.success_by_time.at(step) == pytest.approx(bounded_mean(curves[:, step]))
    assert got.time == bounded_mean((1 - curves[:, :-1]).sum(axis=1), most=LIMIT)
    assert "POS" in repr(got)
    assert not got.episodes.found_at.any()
    assert not got.reliability.searches.any()


def test_coverage_is_the_exact_success_of_a_rescue_with_one_person() -> None:
    """The policy acts alike in both missions until the person is found."""
    scenario = mission(timestep_limit=8).scenario
    person = scenario.situation[0]
    for policy in ("planner", "parallel-sweep"):
        rescue, coverage = (
            evaluated(
                policy,
                mission(mission=name, timestep_limit=8, persons=person, bayesian_update=True),
                episodes=episodes,
            )
            for name, episodes in (("rescue", 2000), ("coverage", 2))
        )
        assert coverage.is_exact
        assert 0.2 < coverage.success.value < 0.99
        if policy == "planner":  # it plans for early finds in a rescue only
            assert rescue.success.value == pytest.approx(coverage.success.value, abs=0.02)
            continue
        assert rescue.exact == pytest.approx(coverage.exact, abs=1e-12)
        assert rescue.time.value == pytest.approx(coverage.time.value)


def test_comparisons_are_paired() -> None:
    first, second = (evaluated(each, mission()) for each in (Wanderer(), still))
    got = compare(first, second)
    assert first.coverage is not None
    assert second.coverage is not None
    one, other = (each.curves for each in (first, second))
    assert got.success == bounded_mean(one[:, -1] - other[:, -1], -1.0)
    assert got.time == bounded_mean(first.times - second.times, -LIMIT, LIMIT)
    same = compare(first, evaluated(Wanderer(), mission()))
    unseen = wilson(0, len(first.episodes)).at(()).high  # the largest share of other differences
    assert same.success == pytest.approx((0.0, -unseen, unseen))
    assert same.time == pytest.approx((0.0, -unseen * LIMIT, unseen * LIMIT))
    with pytest.raises(ValueError, match="second must be of the same search as first"):
        compare(first, evaluated(Wanderer(), mission(mission="rescue")))


def test_other_missions_have_no_coverage() -> None:
    got = evaluated(Wanderer(), mission(mission="rescue", bayesian_update=True))
    assert got.coverage is got.coverage_rate is got.repetition_rate is None
    assert "coverage" not in data_of(got)
    assert "coverage_rate" not in got.data
    assert "coverage_rate" not in got.summary


def test_share_of_the_bound() -> None:
    search = mission(timestep_limit=6)
    bound = success_bound(search.scenario, search.drones, sample=500, gap=0.1, horizons=1)
    got = evaluated("planner", search, episodes=2).with_bound(bound)
    assert got.share_of_bound is not None
    assert got.share_of_bound.value == pytest.approx(got.success.value / bound.by_limit)


def test_files_hold_the_measures_of_coverage(tmp_path: Any) -> None:
    got = evaluated(Wanderer(), mission(), episodes=5)
    rescue = evaluated(Wanderer(), mission(mission="rescue"), episodes=5)
    assert got.coverage is not None
    save_json(tmp_path / "one.json", got)
    data = json.loads((tmp_path / "one.json").read_text())
    assert data["success"] == got.success.data
    assert data["sampled_success"] is None
    assert data["coverage_rate"] == got.coverage_rate.data  # type: ignore[union-attr]
    assert data["repetition_rate"] == got.repetition_rate.data  # type: ignore[union-attr]
    assert data["calibration"] is None
    assert (
        Scenario.from_dict(
            {
                name: value
                for name, value in data["parameters"].items()
                if name != "drones_positions"
            }
        )
        == got.search.scenario
    )

    save_episodes(tmp_path / "episodes.csv", got)
    rows = [*csv.DictReader((tmp_path / "episodes.csv").read_text().splitlines())]
    assert [float(row["probability_of_success"]) for row in rows] == pytest.approx(
        got.curves[:, -1]
    )
    assert [int(row["searches"]) for row in rows] == got.coverage.searches.tolist()
    assert [int(row["cells_searched"]) for row in rows] == got.coverage.cells_searched.tolist()
    assert {"seed", "ending", "steps", "return"} < {*rows[0]}
    assert "success" not in rows[0]

    save_csv(tmp_path / "summary.csv", [rescue, got])
    first, second = csv.DictReader((tmp_path / "summary.csv").read_text().splitlines())
    assert first["coverage_rate"] == second["calibration_error"] == ""
    assert float(second["coverage_rate"]) == got.coverage_rate.value  # type: ignore[union-attr]
    assert float(second["success_low"]) == got.success.low


def test_the_infos_of_vector_environments_are_the_source() -> None:
    search = mission()
    envs = SwarmVectorEnv(3, autoreset_mode="Disabled", **search.parameters)
    envs.reset(seed=0)
    _, _, _, _, infos = envs.step(np.full((3, 2), int(Action.SEARCH)))
    got = evaluated(still, search, episodes=3)
    assert got.coverage is not None
    np.testing.assert_array_equal(got.curves[:, 1], infos["probability_of_success"])
