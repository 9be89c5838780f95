"""Exact success: against dense Markov chains, the environment, and samples."""

from collections import Counter
from typing import Any

import numpy as np
import pytest
from exact_searches import PERSONS, Recorder, curve_of, named

from DroneSwarmSearch import Action, Drift, Person, Scenario
from DroneSwarmSearch.evaluation import (
    Estimate,
    Evaluation,
    NamedSearch,
    View,
    compare,
    evaluate,
    roll_out,
)
from DroneSwarmSearch.evaluation.text_tables import figure, percent, signed
from DroneSwarmSearch.policies import POLICIES, SwarmPolicy, make


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


@pytest.mark.thorough
@pytest.mark.parametrize("name", sorted({*POLICIES} - {"random"}))
@pytest.mark.parametrize("person", PERSONS)
def test_packaged_policies_agree_with_a_dense_chain(name, person):
    search = named(person)
    policy = Recorder(make(name, search.scenario))
    (success,) = roll_out(policy, search, [0], View("swarm")).curves
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
    roll_out(exact, search, [0], View("swarm"))
    known = {tuple(history[:n]) for history in exact.histories for n in range(len(history) + 1)}
    sampled = Recorder(Climber(search.scenario))
    episodes = roll_out(sampled, search, range(60), View("swarm"), wants_curves=False)
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


@pytest.mark.thorough
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
