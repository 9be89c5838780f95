"""Exact success: against dense Markov chains, the environment, and samples."""

from collections import Counter
from typing import Any

import numpy as np
import pytest

from DroneSwarmSearch import Action, Drift, Person, Scenario
from DroneSwarmSearch.drift import ProbabilityMatrix
from DroneSwarmSearch.evaluation import Evaluation, NamedSearch, View, compare, evaluate
from DroneSwarmSearch.evaluation.rollout import play
from DroneSwarmSearch.evaluation.statistics import Estimate
from DroneSwarmSearch.evaluation.text_tables import figure, percent, signed
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
        actions = []
        taken = {*cells} if sum(memory.values()) < 16 else set()
        for x, y in cells:
            ways = {(x, y): Action.SEARCH, (x + 1, y): Action.RIGHT, (x - 1, y): Action.LEFT}
            ways |= {(x, y + 1): Action.DOWN, (x, y - 1): Action.UP}
            inside = [cell for cell in ways if {*cell} <= {*range(6)}]
            free = [cell for cell in inside if cell not in taken - {(x, y)}]
            best = max(free, key=lambda cell: matrix[cell[::-1]] * 0.4 ** memory[cell])
            memory[best] += ways[best] == Action.SEARCH
            taken |= {best} if taken else set()
            actions.append(int(ways[best]))
        return actions


def dense(forecast: ProbabilityMatrix, step: int) -> np.ndarray:
    """The transition matrices of a step over cells, [hypothesis, from, to]."""
    matrices = []
    for right, left, down, up in zip(*forecast.moves(step), strict=True):
        along = [
            np.diag(1 - higher - lower) + np.diag(higher[:-1], 1) + np.diag(lower[1:], -1)
            for higher, lower in ((right, left), (down, up))
        ]
        matrices.append(np.kron(along[1], along[0]))  # cells are y * N + x
    return np.array(matrices)


def curve_of(search: NamedSearch, actions: list[list[int]]) -> np.ndarray:
    """The success of recorded actions, one person."""
    forecast = search.scenario.forecasts()[0]
    kept = 1 - search.scenario.detections[0]
    mass = forecast.joint(0).reshape(-1, search.scenario.grid_size**2)
    cells = [x + y * search.scenario.grid_size for x, y in search.drones]
    moves = {0: -1, 1: 1, 2: -search.scenario.grid_size, 3: search.scenario.grid_size}
    success = [0.0]
    for step, chosen in enumerate(actions):
        searched = {cell for cell, action in zip(cells, chosen, strict=True) if action == 4}
        mass[:, [*searched]] *= kept
        mass = np.einsum("mi,mij->mj", mass, dense(forecast, step))
        success.append(1 - mass.sum())
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
        self.histories += [[] for _ in np.atleast_1d(seed)]
        self.actions += [[] for _ in np.atleast_1d(seed)]

    def __call__(self, shown: Any) -> Any:
        chosen = self.policy(shown)
        if "row" not in shown:  # the view "parallel"
            self.actions[-1].append([*chosen.values()])
            return chosen
        for place, row in enumerate(shown["row"].tolist()):
            cells = tuple(map(tuple, shown["positions"][place].tolist()))
            matrix = shown["probability_matrix"][place].tobytes()
            self.histories[row].append((cells, matrix))
            self.actions[row].append(chosen[place].tolist())
        return chosen


@pytest.mark.parametrize("name", sorted({*POLICIES} - {"random"}))
@pytest.mark.parametrize("person", PERSONS)
def test_packaged_policies_agree_with_a_dense_chain(name, person):
    search = named(person)
    policy = Recorder(make(name, search.scenario))
    (success,) = play(policy, search, [0], View("swarm")).curves
    np.testing.assert_allclose(success, curve_of(search, policy.actions[0]), rtol=0, atol=1e-12)
    assert success[0] == 0.0
    assert (np.diff(success) >= 0.0).all()
    assert 0.02 < success[-1] <= 1.0


@pytest.mark.parametrize("bayesian_update", [False, True])
@pytest.mark.parametrize("person", ["known", "hypotheses"])
def test_a_policy_sees_what_it_would_see_in_the_environment(person, bayesian_update):
    """Bit for bit: the history of every sampled episode begins one of the exact computation."""
    search = named(person, bayesian_update=bayesian_update)
    exact = Recorder(Climber(search.scenario))
    play(exact, search, [0], View("swarm"))
    known = {tuple(history[:n]) for history in exact.histories for n in range(len(history) + 1)}
    sampled = Recorder(Climber(search.scenario))
    episodes = play(sampled, search, range(60), View("swarm"), False)
    assert len(sampled.histories) == 60
    for history in sampled.histories:
        assert tuple(history) in known
    assert len({tuple(history) for history in sampled.histories}) > 5
    assert len({*episodes.endings.tolist()}) > 1


def searching(shown: Any) -> Any:
    return np.full(shown["positions"].shape[:2], int(Action.SEARCH))


def test_a_crash_ends_the_search():
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
    assert got.success_by_time == pytest.approx(np.array([0, 0.5, 0.75, *[0.875] * 6]))
    within = 4 * np.sqrt(0.875 / 8 / 400)
    assert (got.episodes.found_at > 0).mean() == pytest.approx(0.875, abs=within)
    assert got.time.value == pytest.approx(1 + 0.5 + 0.25 + 5 * 0.125)


def test_the_policy_or_the_caller_states_that_it_is_deterministic():
    search = named("known")

    def is_exact(policy: Any, **options: Any) -> bool:
        return evaluate(policy, search, episodes=2, progress=False, **options).is_exact

    assert is_exact(Climber)
    assert is_exact(Climber(search.scenario))
    assert not is_exact(Climber, deterministic=False)
    assert not is_exact(searching)
    assert is_exact(searching, deterministic=True)
    assert not is_exact("random")
    assert not evaluate(Climber, named("known", "missed"), episodes=2, progress=False).is_exact
    for name in {*POLICIES} - {"random"}:
        assert is_exact(name), name
    with pytest.raises(TypeError, match="deterministic must be True or False, got 'yes'"):
        is_exact(searching, deterministic="yes")


@pytest.mark.parametrize("mission", ["rescue", "coverage"])
@pytest.mark.parametrize("view", ["swarm", "parallel"])
def test_a_policy_that_is_not_deterministic_is_refused(view, mission):
    rng = np.random.default_rng(0)

    def drawn(shown: Any) -> Any:
        if view == "parallel":
            return {name: int(rng.integers(4, 6)) for name in shown}
        return rng.integers(4, 6, shown["positions"].shape[:2])

    search = named("known", mission=mission)
    message = "deterministic must be False for a policy that acts differently after the same"
    with pytest.raises(ValueError, match=message):
        evaluate(drawn, search, view=view, episodes=4, deterministic=True, progress=False)


def evaluated(policy: Any, **options: Any) -> Evaluation:
    return evaluate(policy, named("known"), episodes=30, progress=False, **options)


def test_exact_values_have_no_interval():
    got = evaluated(Climber)
    value = float(got.success_by_time[-1])
    assert got.success == (value, value, value)
    assert got.success.scaled(100.0).is_exact and got.time.is_exact
    assert got.time.value == pytest.approx((1 - got.success_by_time[:-1]).sum())
    assert figure(got.time) == f"{got.time.value:.1f}"
    assert percent(got.success) == f"{100 * value:.1f}"
    assert "(exact)" in repr(got) and "exact" not in repr(evaluated(searching))


def test_differences_of_exact_values_are_exact():
    one = evaluated(Climber)
    other = evaluated("greedy-posterior", seed=5)
    got = compare(one, other)  # of different episodes
    for name in ("success", "time"):
        value = getattr(one, name).value - getattr(other, name).value
        assert getattr(got, name) == Estimate.exact(value)
    assert signed(got.time) == f"{got.time.value:+.1f}"
    same = compare(one, evaluated(Climber, seed=9))
    assert same.success == same.time == Estimate.exact(0.0)
