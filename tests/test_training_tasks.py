"""The tasks of the benchmark."""

import hashlib
import pickle

import numpy as np
import pytest
from benchmark_runs import RUNS

from DroneSwarmSearch import Person, training
from DroneSwarmSearch.core import NamedSearch
from DroneSwarmSearch.evaluation import compare, evaluate
from DroneSwarmSearch.persons import Drift
from DroneSwarmSearch.policies import PlannerPolicy, PosteriorGreedyPolicy
from DroneSwarmSearch.training import TASKS, TRAINING_TASK, Task, tasks
from DroneSwarmSearch.vector import SwarmVectorEnv

# A task whose searches change is another one: give the suite a new version, and run all rows of the
# benchmark again.
FINGERPRINTS = {
    "drift": "0359696527a3df83",
    "wreck": "4b7c92a873c877ac",
    "radio": "d28c4a0a72456cf6",
    "fleet": "00b500bcd9f1a6ef",
}


def a_wreck(rng):
    """A small search for three persons, two of whose three hypotheses are far apart."""
    start = rng.integers(3, 5, 2)
    currents = [(0.5, 0.0), (-0.5, 0.0), (0.0, 0.0)]
    drifts = [Drift(start, start_sd=0.5, vector=vector, adrift=4) for vector in currents]
    return {"persons": [Person(drifts, probability_of_detection=0.9)] * 3}


SMALL = {"grid_size": 8, "n_drones": 2, "timestep_limit": 12, "crash": "block"}
WRECK = Task(
    {**SMALL, "bayesian_update": True, "shared_drift": True, **a_wreck(np.random.default_rng(0))},
    a_wreck,
)


@pytest.fixture
def few(monkeypatch):
    """Rounds of 20 episodes in place of 500."""
    monkeypatch.setattr(tasks, "EPISODES", 20)


@pytest.mark.thorough
@pytest.mark.parametrize("name", TASKS)
def test_the_held_out_searches_stay_as_they_are(name):
    searches = TASKS[name].held_out()
    digest = hashlib.sha256("".join(each.fingerprint for each in searches).encode())
    assert digest.hexdigest()[:16] == FINGERPRINTS[name]
    assert len({each.fingerprint for each in searches}) == 500


@pytest.mark.thorough
@pytest.mark.parametrize("name", TASKS)
def test_trainings_draw_other_searches(name):
    task = TASKS[name]
    parameters = {**task.training, "sampler": pickle.loads(pickle.dumps(task.sampler))}
    envs = SwarmVectorEnv(4, **parameters)
    envs.reset(seed=3)
    drawn = {envs.batch.scenario_of(row).persons_to_find for row in range(4)}
    assert len(drawn) > 1
    assert not drawn & {each.scenario.persons_to_find for each in task.held_out()}


def test_trainings_pay_for_what_counts():
    assert TASKS["drift"].training["mission"] == "coverage"
    assert TASKS["wreck"].training["reward_scheme"].find == 1.0
    assert "mission" not in TASKS["wreck"].training


def test_the_drones_of_the_radio_task_have_their_own_maps():
    same = TASKS["wreck"].parameters | {"radio_range": 4}
    assert TASKS["radio"].parameters == same


def test_all_held_out_searches_are_evaluated_together(few):
    task = TASKS["drift"]
    together = task.evaluate("greedy-matrix", name="greedy")
    assert (together.policy, len(together.episodes)) == ("greedy", 20)
    alone = [evaluate("greedy-matrix", each, episodes=1) for each in task.held_out()[:3]]
    expected = np.array([each.success.value for each in alone])
    assert together.curves[: len(alone), -1] == pytest.approx(expected, abs=1e-6)
    assert together.success.is_exact and together.time.is_exact
    assert compare(together, together).success == (0.0, 0.0, 0.0)


@pytest.mark.thorough
def test_a_policy_that_draws_flies_rounds_until_its_success_is_known(monkeypatch):
    """As the zero of the score; its interval is that of the draws over the given searches."""
    monkeypatch.setattr(tasks, "EPISODES", 100)
    monkeypatch.setattr(tasks, "PRECISION", 0.002)
    found = TASKS["drift"].evaluate("random")
    _, low, high = found.success
    assert 0.0 < high - low <= 0.004
    assert len(found.episodes) % 100 == 0
    assert 200 <= len(found.episodes) < 4000
    lead = compare(TASKS["drift"].evaluate("greedy-matrix"), found).success
    assert lead.high - lead.low == pytest.approx(high - low)


@pytest.mark.slow
@pytest.mark.parametrize("policy", ["random", "greedy-matrix"])
@pytest.mark.parametrize("name", TASKS)
def test_baselines_reach_what_is_published(policy, name):
    published = float(RUNS[policy, name, ""]["success"])
    assert TASKS[name].evaluate(policy).success.value == pytest.approx(published, abs=2e-3)


def test_with_several_persons_the_share_found_counts(few):
    found = WRECK.evaluate("greedy-matrix")
    assert len(found.episodes) == 4 * 20
    at = found.episodes.found_at
    assert 0 < np.count_nonzero(at) < at.size
    assert found.success.value == pytest.approx(np.mean(at > 0))
    assert found.success.low < found.success.value < found.success.high
    assert found.success_by_time[6] == pytest.approx(np.mean((at > 0) & (at <= 6)))
    assert found.time.value == pytest.approx(np.where(at > 0, at, 12.0).mean())
    assert len(WRECK.evaluate("greedy-matrix", rounds=2).episodes) == 40
    with pytest.raises(ValueError, match="rounds must be an integer of at least 1, got 0"):
        WRECK.evaluate("greedy-matrix", rounds=0)


def test_policies_that_read_the_persons_are_made_for_each_search(few):
    made = []

    class Noting(PosteriorGreedyPolicy):
        def __init__(self, scenario):
            super().__init__(scenario)
            made.append(scenario.persons_to_find)

    found = WRECK.evaluate(Noting, rounds=1)
    searches = WRECK.held_out()
    # The first one is made once more, to ask for its view.
    assert set(made) == {each.scenario.persons_to_find for each in searches}
    first = evaluate("greedy-posterior", searches[0], episodes=1, seed=tasks.SEED)
    assert found.episodes.found_at[0].tolist() == first.episodes.found_at[0].tolist()
    with pytest.raises(TypeError, match="policy must be a name or a class, because one is made"):
        WRECK.evaluate(PosteriorGreedyPolicy(searches[0].scenario))


@pytest.mark.thorough
def test_the_yardstick_knows_the_drift(few):
    """Its plan in one of the cases, of which the search does not say which it is."""
    search = WRECK.held_out()[3]
    reached = []
    for _, scenario in search.scenario.by_hypothesis():
        alone = scenario.replace(persons=scenario.persons_to_find[:1], mission="coverage")
        known = NamedSearch("known", "", alone)
        plan = PlannerPolicy(alone, seconds=tasks.PLANNING)
        reached.append(evaluate(plan, known, episodes=1).success.value)
    yardstick = WRECK.yardstick([3])
    assert yardstick[0] in [pytest.approx(each) for each in reached]
    assert yardstick[0] > WRECK.evaluate("greedy-matrix").success.value


def test_the_yardstick_of_one_person_is_the_plan(few):
    task = Task({**SMALL, "person_initial_position": (4, 4), "bayesian_update": True})
    [search] = task.held_out()
    plan = PlannerPolicy(search.scenario, seconds=tasks.PLANNING)
    best = evaluate(plan, search, episodes=1).success.value
    assert task.yardstick() == pytest.approx([best])
    assert best >= task.evaluate("greedy-matrix").success.value


def test_stated_policies_are_exact():
    def search_always(shown):
        return np.full(shown["positions"].shape[:2], 4)

    drawn = Task(TRAINING_TASK).evaluate(search_always)
    stated = Task(TRAINING_TASK).evaluate(search_always, deterministic=True)
    assert not drawn.is_exact and stated.is_exact
    assert stated.success.value == pytest.approx(drawn.success.value)
    assert stated.success.is_exact


@pytest.mark.thorough
@pytest.mark.parametrize("task", [Task(TRAINING_TASK), TASKS["drift"]])
def test_a_policy_that_draws_is_not_deterministic(task):
    rng = np.random.default_rng(0)

    def draw(shown):
        return rng.integers(4, 6, shown["positions"].shape[:2])

    with pytest.raises(ValueError, match="deterministic must be False for a policy that acts"):
        task.evaluate(draw, deterministic=True)


@pytest.mark.thorough
def test_a_policy_is_compared_with_the_baselines_of_a_task(tmp_path, capsys, few):
    pytest.importorskip("imageio_ffmpeg")
    size = {"grid_size": 6, "n_drones": 2, "timestep_limit": 9}
    task = Task(size, lambda rng: {"person_initial_position": rng.integers(6, size=2)})
    every = training.compare_with_baselines("greedy-matrix", task, name="mine", folder=tmp_path)
    assert [each.policy for each in every] == ["mine", "random", "greedy-matrix"]
    assert every[0].success.value == every[2].success.value > every[1].success.value
    assert "Means over the 20 held-out searches; 95% intervals" in capsys.readouterr().out
    assert {each.name for each in tmp_path.iterdir()} == {
        "evaluation.csv",
        "search.json",
        "video.gif",
    }


def test_policies_that_remember_see_all_searches_in_every_step(few):
    """Even those that have ended, so that what they remember stays with its search."""

    class Noting:
        def __init__(self, remembers):
            self.remembers = remembers

        def __call__(self, shown):
            seen.add(len(shown["positions"]))
            return np.full(shown["positions"].shape[:2], 4)

    size = {"grid_size": 6, "n_drones": 1, "timestep_limit": 5, "vector": (0, 0)}
    task = Task(
        {**size, "disperse_constant": 0.1, "bayesian_update": True},
        lambda rng: {"person_initial_position": [(0, 0), (5, 5)][rng.integers(2)]},
    )
    for remembers in (True, False):
        seen = set()
        task.evaluate(Noting(remembers), rounds=1, view="swarm")
        assert (seen == {20}) == remembers
