"""Exact success: against dense Markov chains, the environment, and samples."""

from __future__ import annotations

import json
from collections import Counter
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers import data_of

from DroneSwarmSearch import Action, Drift, DroneSwarmSearch, Person, Scenario
from DroneSwarmSearch.drift import ProbabilityMatrix
from DroneSwarmSearch.evaluation import (
    SUITE,
    Evaluation,
    NamedSearch,
    View,
    compare,
    evaluate,
    save_csv,
)
from DroneSwarmSearch.evaluation.rollout import play
from DroneSwarmSearch.evaluation.statistics import ExactValue
from DroneSwarmSearch.evaluation.tables import figure, percent, signed
from DroneSwarmSearch.policies import POLICIES, SwarmPolicy, make

LINE = np.zeros((6, 6))
LINE[4, 1:5] = 1

PERSONS = {
    "known": Person(Drift((2, 3), vector=(0.2, -0.1), diffusion=0.3)),
    "missed": Person(Drift((4, 1), vector=(-0.1, 0.3), diffusion=0.2), 0.4),
    "hypotheses": Person(
        [
            Drift((1, 1), start_sd=0.6, vector=(0.3, 0.1), vector_sd=0.05, diffusion=0.1),
            Drift(LINE, vector=(0.1, -0.2), diffusion=0.2, weight=2),
        ],
        0.8,
    ),
}


def named(*persons: str, drones: Any = ((1, 3), (4, 2)), **changes: Any) -> NamedSearch:
    """A small search for some of `PERSONS`."""
    changes = {"timestep_limit": 14, **changes}
    scenario = Scenario(6, n_drones=len(drones), persons=[PERSONS[p] for p in persons], **changes)
    return NamedSearch("small", "For tests.", scenario, drones)


class Climber(SwarmPolicy):
    """Climbs to likely cells that were seldom searched; after many searches drones may collide."""

    def begin(self) -> Any:
        return Counter()

    def choose(self, memory: Any, cells: Any, matrix: Any) -> list[int]:
        actions, taken = [], {*cells} if sum(memory.values()) < 16 else set()
        for x, y in cells:
            ways = {(x, y): Action.SEARCH, (x + 1, y): Action.RIGHT, (x - 1, y): Action.LEFT}
            ways |= {(x, y + 1): Action.DOWN, (x, y - 1): Action.UP}
            free = [
                cell for cell in ways if {*cell} <= {*range(6)} and cell not in taken - {(x, y)}
            ]
            best = max(free, key=lambda cell: matrix[cell[::-1]] * 0.4 ** memory[cell])
            memory[best] += ways[best] == Action.SEARCH
            taken |= {best} if taken else set()
            actions.append(int(ways[best]))
        return actions


# The chain of one person, written without the package's own: dense matrices, step by step.


@lru_cache(maxsize=64)
def exact_curve(policy: Any, search: NamedSearch, view: View | str = "swarm") -> np.ndarray:
    curves = play(policy, search, [0], View.of(view)).curves
    assert curves is not None
    return curves[0]


def dense(forecast: ProbabilityMatrix, step: int) -> np.ndarray:
    """The transition matrices of a step over cells, [hypothesis, from, to]."""
    size = forecast.grid_size
    matrices = []
    for right, left, down, up in zip(*forecast.moves(step), strict=True):
        along = []
        for higher, lower in ((right, left), (down, up)):
            axis = np.zeros((size, size))
            for k in range(size):
                axis[k, k] = 1 - higher[k] - lower[k]
                if k + 1 < size:
                    axis[k, k + 1] = higher[k]
                if k > 0:
                    axis[k, k - 1] = lower[k]
            along.append(axis)
        matrices.append(np.kron(along[1], along[0]))  # cells are y * N + x
    return np.array(matrices)


class Chain:
    """The mass of a person who has not been found: float64, [hypothesis, cell]."""

    def __init__(self, scenario: Scenario, person: int, mass: Any = None, step: int = 0) -> None:
        self.forecast = scenario.forecasts()[person]
        self.detection = scenario.detections[person]
        start = self.forecast.joint(0).reshape(-1, scenario.grid_size**2)
        self.mass, self.step = (start if mass is None else mass), step

    def after(self, searched: list[int]) -> np.ndarray:
        """The mass left after some searches, and the drift of the step."""
        kept = np.ones(self.mass.shape[1])
        kept[searched] = 1 - self.detection
        left = self.mass * kept
        return np.einsum("mi,mij->mj", left, dense(self.forecast, self.step))


def curve_of(search: NamedSearch, actions: list[list[int]]) -> np.ndarray:
    """The success of recorded actions, one person."""
    chain = Chain(search.scenario, 0)
    cells = [x + y * search.scenario.grid_size for x, y in search.drones]
    moves = {0: -1, 1: 1, 2: -search.scenario.grid_size, 3: search.scenario.grid_size}
    success = [0.0]
    for chosen in actions:
        searched = [cell for cell, action in zip(cells, chosen, strict=True) if action == 4]
        chain.mass = chain.after(searched)
        chain.step += 1
        success.append(1 - chain.mass.sum())
        cells = [cell + moves.get(action, 0) for cell, action in zip(cells, chosen, strict=True)]
    ended = search.scenario.timestep_limit + 1 - len(success)
    return np.array([*success, *success[-1:] * ended])


class Recorder:
    """A policy that notes what it sees and does in each search."""

    def __init__(self, policy: Any) -> None:
        self.policy = policy
        self.histories: list[list[Any]] = []
        self.actions: list[list[Any]] = []

    def reset(self, seed: Any = None, rows: Any = None) -> None:
        self.policy.reset(seed=seed)
        self.first = len(self.histories)
        number = len(seed) if isinstance(seed, list) else 1
        self.histories += [[] for _ in range(number)]
        self.actions += [[] for _ in range(number)]

    def __call__(self, shown: Any) -> Any:
        chosen = self.policy(shown)
        if "row" not in shown:
            seen = [(each["observation"][0], each["observation"][1]) for each in shown.values()]
            self.histories[-1].append((tuple(cell for cell, _ in seen), seen[0][1].tobytes()))
            self.actions[-1].append([int(action) for action in chosen.values()])
            return chosen
        for place, row in enumerate(shown["row"].tolist()):
            cells = tuple(map(tuple, shown["positions"][place].tolist()))
            matrix = shown["probability_matrix"][place].tobytes()
            self.histories[self.first + row].append((cells, matrix))
            self.actions[self.first + row].append(chosen[place].tolist())
        return chosen


@pytest.mark.parametrize("name", sorted({*POLICIES} - {"random"}))
@pytest.mark.parametrize("person", PERSONS)
def test_packaged_policies_agree_with_a_dense_chain(name: str, person: str) -> None:
    search = named(person)
    policy = Recorder(make(name, search.scenario))
    success = exact_curve(policy, search)
    np.testing.assert_allclose(success, curve_of(search, policy.actions[0]), rtol=0, atol=1e-12)
    assert success[0] == 0.0
    assert (np.diff(success) >= 0.0).all()
    assert 0.02 < success[-1] <= 1.0


@pytest.mark.parametrize("name", ["pond", "harbour"])
def test_the_suite_agrees_with_a_dense_chain(name: str) -> None:
    search = SUITE[name]
    scenario = search.scenario.replace(timestep_limit=min(search.scenario.timestep_limit, 25))
    search = NamedSearch(name, "", scenario, search.drones)
    policy = Recorder(make("greedy-posterior", search.scenario))
    success = exact_curve(policy, search)
    np.testing.assert_allclose(success, curve_of(search, policy.actions[0]), rtol=0, atol=1e-12)


@pytest.mark.parametrize("bayesian_update", [False, True])
@pytest.mark.parametrize("persons", [("known",), ("hypotheses",)])
@pytest.mark.parametrize("view", ["swarm", "parallel"])
def test_a_policy_sees_what_it_would_see_in_the_environment(
    view: str, persons: tuple[str, ...], bayesian_update: bool
) -> None:
    """Bit for bit: the history of every sampled episode begins one of the exact computation."""
    search = named(*persons, bayesian_update=bayesian_update)
    exact = Recorder(Climber(search.scenario))
    exact_curve(exact, search, view)
    known = {tuple(history[:n]) for history in exact.histories for n in range(len(history) + 1)}
    sampled = Recorder(Climber(search.scenario))
    episodes = play(sampled, search, range(60), View(), False)
    assert len(sampled.histories) == 60
    for history in sampled.histories:
        assert tuple(history) in known
    assert len({tuple(history) for history in sampled.histories}) > 5
    assert len({*episodes.endings.tolist()}) > 1


@pytest.mark.parametrize(
    ("view", "observation"),
    [("swarm", "flat"), ("swarm", "planes"), ("drone", "dict"), ("drone", "top-cells"),
     ("drone", "crops")],
)  # fmt: skip
def test_every_layout_is_shown_as_in_the_environment(view: str, observation: str) -> None:
    search = named("known", bayesian_update=True)

    def seen_by(run_with: Any) -> list[list[bytes]]:
        seen: list[list[bytes]] = []

        def stay(shown: Any) -> Any:
            parts = shown.values() if isinstance(shown, dict) else [shown]
            seen.append([part[:1].tobytes() for part in parts])
            number = len(next(iter(parts)))
            return np.full((number, 2) if view == "swarm" else number, int(Action.SEARCH))

        run_with(stay)
        return seen

    exact = seen_by(lambda policy: exact_curve(policy, search, View(view, observation)))
    sampled = seen_by(lambda policy: play(policy, search, range(1), View(view, observation), False))
    assert sampled
    assert exact[: len(sampled)] == sampled


def searching(shown: Any) -> Any:
    return np.full(shown["positions"].shape[:2], int(Action.SEARCH))


def test_random_actions_that_all_episodes_share_are_noticed() -> None:
    rng = np.random.default_rng(0)

    def shared(shown: Any) -> Any:
        actions = [int(Action.SEARCH), int(Action.IDLE)]
        return np.full(shown["positions"].shape[:2], rng.choice(actions))

    scenario = Scenario(5, person_initial_position=(0, 0), vector=(0, 0), timestep_limit=20)
    with pytest.raises(ValueError, match="deterministic must be False"):
        evaluate(shared, scenario, deterministic=True, episodes=5, progress=False)


def test_a_crash_ends_the_search() -> None:
    """Two drones search, then meet; a find in the step of the crash counts."""

    class Meets:
        def reset(self, seed: Any = None, rows: Any = None) -> None:
            self.step = 0

        def __call__(self, shown: Any) -> Any:
            self.step += 1
            crash = [Action.SEARCH, Action.LEFT]
            return [crash if self.step == 3 else [Action.SEARCH] * 2 for _ in shown["row"]]

    person = Person(Drift((2, 2)), 0.5)
    scenario = Scenario(6, n_drones=2, persons=person, timestep_limit=8)
    search = NamedSearch("meeting", "", scenario, ((2, 2), (3, 2)))
    got = evaluate(Meets(), search, deterministic=True, episodes=400, progress=False)
    assert got.exact == pytest.approx(np.array([0, 0.5, 0.75, *[0.875] * 6]))
    assert (got.found_by > 0).mean() == pytest.approx(0.875, abs=4 * np.sqrt(0.875 / 8 / 400))
    assert got.time.value == pytest.approx(1 + 0.5 + 0.25 + 5 * 0.125)


@pytest.mark.parametrize("persons", [("known",), ("hypotheses",)])
@pytest.mark.parametrize("name", ["greedy-posterior", "greedy-matrix", "planner"])
def test_samples_agree(name: str, persons: tuple[str, ...]) -> None:
    count, search = 250, named(*persons)
    got = evaluate(name, search, episodes=count, progress=False)
    sampled = evaluate(name, search, episodes=count, deterministic=False, progress=False)
    assert got.is_exact
    assert not sampled.is_exact
    assert got.sampled_success == sampled.sampled_success
    share = got.success.value
    assert abs(share - sampled.success.value) < 4 * np.sqrt(share * (1 - share) / count) + 1e-9
    off = got.time.value - sampled.time.value
    assert abs(off) < 4 * sampled.times.std() / np.sqrt(count) + 1e-9
    assert data_of(got) == data_of(sampled)


# Which evaluations are exact.


def test_the_policy_or_the_caller_states_that_it_is_deterministic() -> None:
    search = named("known")

    def is_exact(policy: Any, **options: Any) -> bool:
        return evaluate(policy, search, episodes=2, progress=False, **options).is_exact

    assert is_exact(Climber)
    assert is_exact(Climber(search.scenario))
    assert not is_exact(Climber, deterministic=False)
    assert not is_exact(searching)
    assert is_exact(searching, deterministic=True)
    assert not is_exact("random")
    for name in {*POLICIES} - {"random"}:
        assert is_exact(name), name
    with pytest.raises(TypeError, match="deterministic must be True or False, got 'yes'"):
        is_exact(searching, deterministic="yes")


@pytest.mark.parametrize("mission", ["rescue", "coverage"])
@pytest.mark.parametrize("view", ["swarm", "parallel"])
def test_a_policy_that_is_not_deterministic_is_refused(view: str, mission: str) -> None:
    rng = np.random.default_rng(0)

    def drawn(shown: Any) -> Any:
        if view == "parallel":
            return {name: int(rng.integers(4, 6)) for name in shown}
        return rng.integers(4, 6, shown["positions"].shape[:2])

    search = named("known", mission=mission)
    message = "deterministic must be False for a policy that acts differently after the same"
    with pytest.raises(ValueError, match=message):
        evaluate(drawn, search, view=view, episodes=4, deterministic=True, progress=False)


def test_the_random_policy_is_refused() -> None:
    """With the same seeds it would act in the same way again."""
    with pytest.raises(ValueError, match="deterministic must be False"):
        evaluate("random", named("known"), episodes=4, deterministic=True, progress=False)


def test_every_view_gives_the_same_values() -> None:
    search = named("missed", bayesian_update=True)

    def in_parallel(shown: Any) -> dict[str, int]:
        return dict.fromkeys(shown, int(Action.SEARCH))

    def in_drones(shown: Any) -> Any:
        return np.full(len(shown["position"]), int(Action.SEARCH))

    curves = [
        evaluate(policy, search, view=view, episodes=1, deterministic=True, progress=False).exact
        for policy, view in (
            (searching, "swarm"), (in_drones, "drone"), (in_parallel, "parallel")
        )
    ]  # fmt: skip
    assert curves[0] is not None
    for curve in curves[1:]:
        np.testing.assert_array_equal(curve, curves[0])


def test_coverage_missions_are_exact_for_any_number_of_persons() -> None:
    search = named("known", "missed", "hypotheses", mission="coverage")
    got = evaluate(Climber, search, episodes=4, progress=False)
    assert got.coverage is not None
    assert isinstance(got.success, ExactValue)
    assert got.success.value == got.curves[0, -1]
    assert got.time.value == pytest.approx(got.times.mean())
    assert got.sampled_success is None
    rates = got.coverage_rate, got.repetition_rate, got.mean_return
    assert all(each is not None and each.is_exact for each in rates)
    assert got.mean_return.value == pytest.approx(got.episodes.returns.mean())


def test_the_environment_finds_the_exact_share() -> None:
    """Not the batch: one environment, episode after episode."""
    search = named("known", timestep_limit=8)
    success = exact_curve(make("greedy-posterior", search.scenario), search)
    env, found = DroneSwarmSearch(scenario=search.scenario), 0
    policy = make("greedy-posterior", search.scenario)
    for seed in range(300):
        shown, _ = env.reset(seed, drones_positions=search.drones)
        policy.reset()
        while env.agents:
            shown, *_ = env.step(policy(shown))
        found += env.frame().found[0]
    assert 0.1 < success[-1] < 0.9
    assert abs(found / 300 - success[-1]) < 4 * np.sqrt(success[-1] * (1 - success[-1]) / 300)


# Results, comparisons, files.


def evaluated(policy: Any, **options: Any) -> Evaluation:
    return evaluate(policy, named("known"), episodes=30, progress=False, **options)


def test_exact_values_have_no_interval() -> None:
    got = evaluated(Climber)
    assert got.exact is not None
    value = float(got.exact[-1])
    assert got.success == (value, value, value)
    assert got.success.is_exact
    assert got.success.scaled(100.0).is_exact
    assert got.time.is_exact
    assert got.time.value == pytest.approx((1 - got.exact[:-1]).sum())
    for curve in got.success_by_time:
        np.testing.assert_array_equal(curve, got.exact)
    assert figure(got.time) == f"{got.time.value:.1f}"
    assert percent(got.success) == f"{100 * value:.1f}"
    assert "(exact)" in repr(got)
    assert "exact" not in repr(evaluated(searching))
    assert not got.mean_return.is_exact


def test_differences_of_exact_values_are_exact() -> None:
    one, other = evaluated(Climber), evaluated("greedy-posterior", seed=5)
    got = compare(one, other)  # of different episodes
    assert got.success.is_exact
    assert got.time.is_exact
    assert got.success.value == one.success.value - other.success.value
    assert got.time.value == one.time.value - other.time.value
    assert signed(got.time) == f"{got.time.value:+.1f}"
    same = compare(one, evaluated(Climber, seed=9))
    assert same.success == same.time == ExactValue.of(0.0)


def test_an_exact_value_against_a_sample_has_the_interval_of_the_sample() -> None:
    exact, sampled = evaluated(Climber), evaluated(searching)
    got = compare(exact, sampled)
    for ours, theirs, difference in (
        (exact.success, sampled.success, got.success),
        (exact.time, sampled.time, got.time),
    ):
        expected = [ours.value - each for each in (theirs.value, theirs.high, theirs.low)]
        assert difference == pytest.approx(expected)
        assert not difference.is_exact
    with pytest.raises(ValueError, match="30 from seed 1, got 30 from seed 0"):
        compare(evaluated(Climber, seed=1), sampled)


def test_files_mark_exact_values(tmp_path: Path) -> None:
    exact, sampled = evaluated(Climber), evaluated(searching)
    for each in (exact, sampled):
        data = json.loads(json.dumps(each.data))
        assert data["success"] == {**each.success._asdict(), "exact": each.is_exact}
        assert data["restricted_mean_time"]["exact"] == each.is_exact
        assert data["mean_return"]["exact"] is False
        assert each.sampled_success is not None
        assert data["sampled_success"]["low"] == each.sampled_success.low
        assert data["sampled_success"]["exact"] is False
    save_csv(tmp_path / "both.csv", [exact, sampled])
    lines = [line.split(",") for line in (tmp_path / "both.csv").read_text().splitlines()]
    rows = [dict(zip(lines[0], line, strict=True)) for line in lines[1:]]
    assert [row["method"] for row in rows] == ["exact", "conditional"]
    assert float(rows[0]["success"]) == float(rows[0]["success_low"]) == exact.success.value
    assert float(rows[0]["sampled_success_low"]) < float(rows[0]["sampled_success_high"])


# The store, and workers.
