"""Conditional success: against exact values, enumerated paths, and shares of found episodes."""

from __future__ import annotations

import itertools
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers import data_of

from DroneSwarmSearch import Action, Drift, Person, Scenario
from DroneSwarmSearch.evaluation import (
    Evaluation,
    NamedSearch,
    View,
    compare,
    evaluate,
    save_csv,
)
from DroneSwarmSearch.evaluation.rollout import play
from DroneSwarmSearch.evaluation.statistics import Estimate, difference
from DroneSwarmSearch.evaluation.tables import figure, signed
from DroneSwarmSearch.policies import make
from DroneSwarmSearch.vector import SearchBatch

PERSONS = {
    "known": Person(Drift((2, 3), vector=(0.2, -0.1), diffusion=0.3)),
    "missed": Person(Drift((4, 1), vector=(-0.1, 0.3), diffusion=0.2), 0.4),
    "hypotheses": Person(
        [
            Drift((1, 1), start_sd=0.6, vector=(0.3, 0.1), vector_sd=0.05, diffusion=0.1),
            Drift((3, 4), vector=(0.1, -0.2), diffusion=0.2, weight=2),
        ],
        0.8,
    ),
}
LIMIT = 14


def named(*persons: str, drones: Any = ((1, 3), (4, 2)), **changes: Any) -> NamedSearch:
    """A small search for some of `PERSONS`."""
    changes = {"timestep_limit": LIMIT, **changes}
    scenario = Scenario(6, n_drones=len(drones), persons=[PERSONS[p] for p in persons], **changes)
    return NamedSearch("small", "For tests.", scenario, drones)


class Mixed:
    """Tosses a coin before every episode, and plays as one of two deterministic policies."""

    NAMES = ("greedy-posterior", "greedy-matrix")

    def __init__(self, scenario: Scenario) -> None:
        self._policies = [make(name, scenario) for name in self.NAMES]

    @staticmethod
    def coin(seed: int) -> int:
        return int(np.random.default_rng([7, seed]).integers(2))

    def reset(self, seed: Any = None, rows: Any = None) -> None:
        self._coins = np.array([self.coin(each) for each in seed])
        for policy in self._policies:
            policy.reset(seed)

    def __call__(self, shown: Any) -> Any:
        actions = [policy(shown) for policy in self._policies]
        return np.where(self._coins[shown["row"], None] == 0, *actions)


class Tosses:
    """Searches or moves on, by the toss of a coin in every step; one drone, in any view."""

    def __init__(self, view: str = "swarm") -> None:
        self._view = view

    @staticmethod
    def tosses(seed: int) -> np.ndarray:
        return np.random.default_rng([3, seed]).integers(2, size=LIMIT)

    def reset(self, seed: Any = None, rows: Any = None) -> None:
        seeds = seed if isinstance(seed, list) else [seed]
        self._tosses, self._step = np.array([self.tosses(each) for each in seeds]), 0
        self._rows = np.arange(len(seeds))

    def __call__(self, shown: Any) -> Any:
        rows = shown["row"] if self._view == "swarm" else self._rows
        moves = Action.RIGHT if self._step % 2 == 0 else Action.LEFT
        chosen = np.where(self._tosses[rows, self._step], int(Action.SEARCH), int(moves))
        # A search leaves the drone where it is, so the other move may be the possible one.
        x = {"swarm": lambda: shown["positions"][:, 0, 0], "drone": lambda: shown["position"][:, 0]}
        at = (
            x[self._view]() if self._view in x else np.array([shown["drone0"]["observation"][0][0]])
        )
        chosen = np.where((chosen == Action.LEFT) & (at == 0), int(Action.RIGHT), chosen)
        self._step += 1
        if self._view == "parallel":
            return {"drone0": int(chosen[0])}
        return chosen[:, None] if self._view == "swarm" else chosen


def actions_of(tosses: Any, x: int = 0) -> list[int]:
    """The actions of `Tosses`."""
    actions = []
    for step, toss in enumerate(tosses):
        move = Action.RIGHT if step % 2 == 0 or x == 0 else Action.LEFT
        actions.append(int(Action.SEARCH if toss else move))
        x += 0 if toss else {Action.RIGHT: 1, Action.LEFT: -1}[move]
    return actions


def success_of(search: NamedSearch, actions: list[int]) -> list[float]:
    """The success of one drone's path by a forward pass over the mass that is left."""
    forecast, size = search.scenario.forecasts()[0], search.scenario.grid_size
    mass, (x, y) = forecast.joint(0), search.drones[0]
    success = [0.0]
    for step, action in enumerate(actions):
        if action == Action.SEARCH:
            mass[:, y, x] *= 1 - search.scenario.detections[0]
        right, left, down, up = forecast.moves(step)
        after = np.zeros_like(mass)
        for h, j, i in np.ndindex(*mass.shape):
            along_x = {1: right[h, i], -1: left[h, i], 0: 1 - right[h, i] - left[h, i]}
            along_y = {1: down[h, j], -1: up[h, j], 0: 1 - down[h, j] - up[h, j]}
            for (dx, p), (dy, q) in itertools.product(along_x.items(), along_y.items()):
                if p * q > 0:
                    after[h, (j + dy) % size, (i + dx) % size] += mass[h, j, i] * p * q
        mass = after
        success.append(1 - mass.sum())
        x += {Action.RIGHT: 1, Action.LEFT: -1}.get(Action(action), 0)
    return success


def evaluated(policy: Any, search: NamedSearch, **options: Any) -> Evaluation:
    return evaluate(policy, search, **{"episodes": 60, "progress": False, **options})


# The values.


@pytest.mark.parametrize("person", PERSONS)
@pytest.mark.parametrize("bayesian_update", [False, True])
def test_a_mixture_of_two_policies(person: str, bayesian_update: bool) -> None:
    """Every episode has the exact success of the policy that the coin chose."""
    search = named(person, bayesian_update=bayesian_update)
    got = evaluated(Mixed, search)
    assert got.method == "conditional"
    exact = [evaluated(name, search).curves[0] for name in Mixed.NAMES]
    for seed, curve in enumerate(got.curves):
        np.testing.assert_allclose(curve, exact[Mixed.coin(seed)], rtol=0, atol=1e-12)
    mean = np.mean(exact, axis=0)
    assert got.success.low <= mean[-1] <= got.success.high
    assert got.time.low <= (1 - mean[:-1]).sum() <= got.time.high
    assert got.success.value == got.success_by_time.value[-1]


@pytest.mark.parametrize("person", ["missed", "hypotheses"])
def test_tosses_in_every_step(person: str) -> None:
    """Against a forward pass for every path, and the mean over all paths."""
    search = named(person, drones=((0, 1),), timestep_limit=6)
    got = evaluated(Tosses(), search, episodes=200)
    curves = {
        tosses: success_of(search, actions_of(tosses))
        for tosses in itertools.product((0, 1), repeat=6)
    }
    for seed, curve in enumerate(got.curves):
        expected = curves[tuple(Tosses.tosses(seed)[:6].tolist())]
        np.testing.assert_allclose(curve, expected, rtol=0, atol=1e-12)
    mean = np.mean([*curves.values()], axis=0)
    assert got.success.low <= mean[-1] <= got.success.high
    assert 0.0 < got.success.low < got.success.high < 1.0
    assert got.time.low <= (1 - mean[:-1]).sum() <= got.time.high


@pytest.mark.parametrize(
    "persons", [("known", "missed"), ("missed", "hypotheses"), ("known", "missed", "hypotheses")]
)
def test_several_persons(persons: tuple[str, ...]) -> None:
    """Sampled until one person is missing."""
    search, n = named(*persons, timestep_limit=30), 300
    got = evaluated("parallel-sweep", search, episodes=n, deterministic=False)
    assert got.sampled_success is not None
    last_but_one = np.sort(np.where(got.episodes.found_at > 0, got.episodes.found_at, 99))[:, -2]
    for step, curve in zip(last_but_one.tolist(), got.curves, strict=True):
        assert not curve[:step].any()
        assert step > 25 or curve[-1] > 0.0
    final = got.curves[:, -1]
    share = got.sampled_success.value
    assert final.var() < 0.6 * share * (1 - share)
    assert got.times.var() < np.where(got.found_by, got.found_by, 30).var()
    error = np.sqrt(share * (1 - share) / n)
    assert abs(final.mean() - share) < 4 * error


def test_all_persons_found_in_one_step() -> None:
    """Two persons who never move in one cell: the first search finds both."""
    person = Person(Drift((2, 2)))
    scenario = Scenario(5, timestep_limit=4, persons=[person, person])
    search = NamedSearch("both", "For tests.", scenario, ((2, 2),))
    still = lambda shown: np.full((len(shown["row"]), 1), 4)  # noqa: E731
    curves = play(still, search, [1, 2], View()).curves
    assert curves is not None
    assert curves.tolist() == [[0.0, 1.0, 1.0, 1.0, 1.0]] * 2


def test_variance_is_below_that_of_finds() -> None:
    search = named("hypotheses", timestep_limit=30)
    got = evaluated("random", search, episodes=300)
    assert got.sampled_success is not None
    share = got.success.value
    assert got.curves[:, -1].var() < 0.25 * share * (1 - share)
    assert got.success.high - got.success.low < 0.6 * (
        got.sampled_success.high - got.sampled_success.low
    )
    assert got.sampled_success.low < share < got.sampled_success.high
    assert got.time.high - got.time.low < 0.6 * 4 * np.where(
        got.found_by, got.found_by, 30
    ).std() / np.sqrt(300)


def test_crashes_end_the_search() -> None:
    """Nothing is found after a drone has left the grid."""
    search = named("known", drones=((2, 3),))

    class Leaves:
        """Searches once, then flies to the right until it has left the grid."""

        def reset(self, seed: Any = None, rows: Any = None) -> None:
            self._step = 0

        def __call__(self, shown: Any) -> Any:
            self._step += 1
            return np.full(
                (len(shown["row"]), 1), int([Action.RIGHT, Action.SEARCH][self._step == 1])
            )

    got = evaluated(Leaves(), search, episodes=3)
    first = float(search.scenario.forecasts()[0].exact(0)[3, 2])
    assert got.curves == pytest.approx(np.array([[0.0, *[first] * LIMIT]] * 3))


def test_every_view_gives_the_same_curves() -> None:
    search = named("missed", drones=((0, 1),), bayesian_update=True)
    curves = [
        play(Tosses(view), search, range(5, 9), View(view)).curves
        for view in ("swarm", "drone", "parallel")
    ]
    assert len({each.tobytes() for each in curves}) == 1
    assert np.ptp(curves[0][:, -1]) > 0.0


# The batch in which the last person is not found.


@pytest.mark.parametrize("persons", [("missed",), ("missed", "hypotheses", "known")])
def test_the_last_person_is_never_found(persons: tuple[str, ...]) -> None:
    scenario = named(*persons, bayesian_update=True, timestep_limit=60).scenario
    batch = SearchBatch(30, scenario=scenario, finds_last=False, drones_positions=[(2, 2), (4, 2)])
    batch.reset([*range(30)])
    policy, rows = make("greedy-posterior", scenario), np.arange(30)
    for _ in range(59):
        is_last, before = batch.missing.sum(axis=1) == 1, batch.probability_of_failure
        shown = {"positions": batch.positions, "probability_matrix": batch.matrices_of(rows)}
        batch.step(policy(shown))
        assert (batch.missing[is_last].sum(axis=1) == 1).all()
        assert not batch.ended[is_last].any()
        after = batch.probability_of_failure
        assert before is not None
        assert after is not None
        assert (after[is_last] <= before[is_last]).all()
    assert is_last.sum() > 20
    assert np.median(after[is_last].min(axis=1)) < 0.3


def test_the_probability_of_failure() -> None:
    """Of one person, it is what is missing to the probability of success."""
    scenario = named("missed", bayesian_update=True).scenario
    batch = SearchBatch(2, scenario=scenario, drones_positions=[(4, 1), (2, 2)])
    batch.reset([0, 1])
    batch.step([[4, 4], [5, 5]])
    assert batch.probability_of_failure is not None
    assert batch.probability_of_failure.shape == (2, 1)
    assert batch.probability_of_failure[:, 0] == pytest.approx([0.6, 1.0])
    success = batch.probability_of_success
    np.testing.assert_array_equal(1.0 - batch.probability_of_failure[:, 0], success)
    batch = SearchBatch(2, scenario=scenario.replace(bayesian_update=False))
    assert batch.probability_of_failure is None
    with pytest.raises(TypeError, match="finds_last must be True or False, got 1"):
        SearchBatch(2, scenario=scenario, finds_last=1)  # type: ignore[arg-type]


# Results, comparisons, files.


def test_which_evaluations_are_conditional() -> None:
    one, three = named("known"), named(*PERSONS)
    assert evaluated("random", one).method == "conditional"
    assert evaluated("random", three).method == "conditional"
    assert evaluated("greedy-matrix", three).method == "conditional"
    assert evaluated("greedy-matrix", one).method == "exact"
    coverage = evaluated("random", named("known", mission="coverage"))
    assert coverage.method == "conditional"
    assert coverage.coverage is not None


def test_returns_and_endings_are_those_of_the_episodes() -> None:
    search = named("known", timestep_limit=30)
    got = evaluated("greedy-matrix", search, deterministic=False)
    exact = evaluated("greedy-matrix", search)
    assert data_of(got) == data_of(exact)
    assert got.mean_return == exact.mean_return
    assert got.endings == exact.endings
    assert got.success.value == pytest.approx(exact.success.value, abs=1e-12)
    assert not got.success.is_exact


def test_differences() -> None:
    search = named("hypotheses")
    tossed, other = evaluated(Mixed, search), evaluated("random", search)
    exact = evaluated("greedy-posterior", search)
    got = compare(tossed, other)
    assert got.success.value == pytest.approx(tossed.success.value - other.success.value)
    assert got.time.value == pytest.approx(tossed.time.value - other.time.value)
    assert got.success.low < got.success.value < got.success.high
    assert compare(exact, other).success == difference(exact.success, other.success)
    assert compare(exact, other).time == difference(exact.time, other.time)
    with pytest.raises(ValueError, match="60 from seed 1, got 60 from seed 0"):
        compare(evaluated("random", search, seed=1), other)


def test_differences_are_paired() -> None:
    """The coins are the same, so the interval is narrower than that of independent samples."""
    first, second = (
        evaluated(Tosses(), named("hypotheses", drones=((x, 1),)), name=f"from {x}") for x in (0, 1)
    )
    second = replace(first, episodes=second.episodes, policy="other")
    got = compare(first, second)
    apart = difference(first.success, second.success)
    assert got.success.value == pytest.approx(apart.value)
    assert got.success.high - got.success.low < 0.9 * (apart.high - apart.low)


@pytest.mark.parametrize(
    ("estimate", "unsigned", "with_sign"),
    [
        (Estimate(12.34, 11.0, 13.9), "12.3 (11.0-13.9)", "+12.3 (+11.0 to +13.9)"),
        (Estimate(0.8912, 0.8771, 0.9053), "0.89 (0.88-0.91)", "+0.89 (+0.88 to +0.91)"),
        (Estimate(1e-9, 0.0, 2e-9), "0.0000 (0.0000-0.0000)", "+0.0000 (+0.0000 to +0.0000)"),
        (Estimate(2.0, 2.0, 2.0), "2.0 (2.0-2.0)", "+2.0 (+2.0 to +2.0)"),
    ],
)
def test_tables_have_enough_decimals_for_the_interval(
    estimate: Estimate, unsigned: str, with_sign: str
) -> None:
    assert figure(estimate) == unsigned
    assert signed(estimate) == with_sign


def test_files_name_the_method(tmp_path: Path) -> None:
    search = named("known")
    exact, conditional = evaluated("greedy-matrix", search), evaluated("random", search)
    methods = ["exact", "conditional"]
    save_csv(tmp_path / "all.csv", [exact, conditional])
    header, *lines = (tmp_path / "all.csv").read_text().splitlines()
    column = header.split(",").index("method")
    assert [line.split(",")[column] for line in lines] == methods
    for each, method in zip((exact, conditional), methods, strict=True):
        assert json.loads(json.dumps(each.data))["method"] == each.method == method
        assert each.data["success"]["exact"] == (method == "exact")
