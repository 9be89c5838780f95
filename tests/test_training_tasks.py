"""The tasks of the benchmark."""

import hashlib
import pickle

import numpy as np
import pytest
from benchmark_runs import RUNS

from DroneSwarmSearch import Scenario, training
from DroneSwarmSearch.evaluation import compare, evaluate
from DroneSwarmSearch.training import TASKS, TRAINING_TASK, Task
from DroneSwarmSearch.vector import SwarmVectorEnv

# A task whose searches change is another one: give the suite a new version, and run all rows of the
# benchmark again.
FINGERPRINTS = {
    "small": "0a01e5f2af48a0eb",
    "medium": "2cf6f025b55f0aac",
    "large": "7bddc27e46d5c003",
}


@pytest.mark.parametrize("name", TASKS)
def test_the_held_out_searches_stay_as_they_are(name):
    searches = TASKS[name].held_out()
    digest = hashlib.sha256("".join(each.fingerprint for each in searches).encode())
    assert digest.hexdigest()[:16] == FINGERPRINTS[name]
    assert len({each.fingerprint for each in searches}) == (1 if name == "small" else 500)


def test_the_small_task_is_that_of_the_examples():
    [search] = TASKS["small"].held_out()
    assert search.scenario == Scenario(**TRAINING_TASK, mission="coverage")


@pytest.mark.parametrize("name", ["medium", "large"])
def test_trainings_draw_other_searches(name):
    task = TASKS[name]
    sampler = pickle.loads(pickle.dumps(task.sampler))  # workers of trainers get copies
    envs = SwarmVectorEnv(40, **task.parameters, sampler=sampler)
    envs.reset(seed=3)
    drawn = {envs.batch.scenario_of(row).vector for row in range(40)}
    assert len(drawn) > 30
    assert not drawn & {each.scenario.vector for each in task.held_out()}


@pytest.mark.parametrize("name", ["small", "medium"])
def test_all_held_out_searches_are_evaluated_together(name):
    task = TASKS[name]
    together = task.evaluate("greedy-matrix", name="greedy")
    assert (together.policy, len(together.episodes)) == ("greedy", 500)
    alone = [evaluate("greedy-matrix", each, episodes=1) for each in task.held_out()[:3]]
    expected = np.array([each.success.value for each in alone])
    assert together.curves[: len(alone), -1] == pytest.approx(expected, abs=1e-6)
    assert together.success.is_exact and together.time.is_exact
    published = float(RUNS["greedy-matrix", name, ""]["success"])
    assert together.success.value == pytest.approx(published, abs=1e-3)  # ties differ by NumPy


@pytest.mark.parametrize("name", ["small", pytest.param("medium", marks=pytest.mark.slow)])
def test_a_policy_that_draws_flies_rounds_until_its_success_is_known(name):
    """As the zero of the score; its interval is that of the draws over the given searches."""
    found = TASKS[name].evaluate("random")
    value, low, high = found.success
    assert 0.0 < high - low <= 0.002
    assert len(found.episodes) % 500 == 0 < len(found.episodes) - 500
    published = float(RUNS["random", name, ""]["success"])
    assert value == pytest.approx(published, abs=1e-3)
    lead = compare(TASKS[name].evaluate("greedy-matrix"), found).success
    assert lead.high - lead.low == pytest.approx(high - low)
    exact = TASKS[name].evaluate("greedy-matrix")
    assert compare(exact, exact).success == (0.0, 0.0, 0.0)


def test_stated_policies_are_exact():
    def search_always(shown):
        return np.full(shown["positions"].shape[:2], 4)

    drawn = TASKS["small"].evaluate(search_always)
    stated = TASKS["small"].evaluate(search_always, deterministic=True)
    assert not drawn.is_exact and stated.is_exact
    assert stated.success.value == pytest.approx(drawn.success.value)
    assert stated.success.is_exact


@pytest.mark.parametrize("name", ["small", "medium"])
def test_a_policy_that_draws_is_not_deterministic(name):
    rng = np.random.default_rng(0)

    def draw(shown):
        return rng.integers(4, 6, shown["positions"].shape[:2])

    with pytest.raises(ValueError, match="deterministic must be False for a policy that acts"):
        TASKS[name].evaluate(draw, deterministic=True)


def test_a_policy_is_compared_with_the_baselines_of_a_task(tmp_path, capsys):
    pytest.importorskip("imageio_ffmpeg")
    size = {"grid_size": 6, "n_drones": 2, "timestep_limit": 9}
    task = Task(size, lambda rng: {"person_initial_position": rng.integers(6, size=2)})
    every = training.compare_with_baselines("greedy-matrix", task, name="mine", folder=tmp_path)
    assert [each.policy for each in every] == ["mine", "random", "greedy-matrix"]
    assert every[0].success.value == every[2].success.value > every[1].success.value
    assert "Means over the 500 held-out searches; 95% intervals" in capsys.readouterr().out
    assert {each.name for each in tmp_path.iterdir()} == {
        *("evaluation.csv", "search.json", "video.gif")
    }
