"""The table and the curves of the benchmark are those of its CSV files."""

import numpy as np
import pytest
from benchmark_runs import CURVES, RESULTS, RUNS, algorithms

from DroneSwarmSearch.training import TASKS


def test_the_table_shows_the_results():
    page = algorithms.PAGE.read_text("utf-8")
    assert page == algorithms.page(), "run python benchmarks/algorithms.py report"


def test_no_run_is_counted_twice():
    assert len(RUNS) == len(RESULTS)
    names = {*algorithms.BASELINES, algorithms.YARDSTICK, *algorithms.ALGORITHMS}
    assert {(name, task) for name, task, _ in RUNS} <= {(n, t) for n in names for t in TASKS}


def test_the_yardstick_is_the_mean_of_its_plans():
    plans = algorithms.rows_of(algorithms.PLANS)
    searches = [(row["task"], int(row["search"])) for row in plans]
    assert len(set(searches)) == len(searches)
    for (policy, task, _), run in RUNS.items():
        if policy == algorithms.YARDSTICK:
            planned = "wreck" if task == "radio" else task
            found = [float(row["success"]) for row in plans if row["task"] == planned]
            assert len(found) == len(TASKS[task].held_out())
            assert float(run["success"]) == pytest.approx(np.mean(found), abs=1e-5)


def test_radio_has_the_searches_of_wreck():
    """So they share a yardstick, which needs no radio."""
    radio, wreck = (TASKS[name].held_out() for name in ("radio", "wreck"))
    assert all(
        one.scenario.replace(radio_range=None) == other.scenario
        for one, other in zip(radio[::100], wreck[::100], strict=True)
    )


def test_every_trained_policy_has_a_curve_and_nothing_else_does():
    trained = {key for key in RUNS if key[0] in algorithms.ALGORITHMS}
    last = {tuple(row[name] for name in algorithms.KEY): float(row["steps"]) for row in CURVES}
    assert last.keys() == trained
    for key, steps in last.items():
        assert float(RUNS[key]["steps"]) <= steps < 1.03 * float(RUNS[key]["steps"])


def test_all_algorithms_try_equally_many_settings():
    """One of them the first, the others near it."""
    for name in algorithms.ALGORITHMS:
        first, *others = algorithms.candidates(name)
        assert first == algorithms.FIRST[name]
        assert len(others) == 7
        assert all(sum(other[key] != first[key] for key in first) == 1 for other in others)


def test_the_best_setting_is_used():
    """That with the best mean of both tasks, once all have been tried."""
    rows = algorithms.rows_of(algorithms.TUNING)
    for name in algorithms.ALGORITHMS:
        means = []
        for number in range(8):
            tried = [
                row for row in rows if (row["algorithm"], row["setting"]) == (name, str(number))
            ]
            found = {row["task"]: float(row["success"]) for row in tried}
            is_whole = found.keys() == set(algorithms.TUNED_ON)
            means.append(np.mean(list(found.values())) if is_whole else 0.0)
        assert algorithms.TUNED[name] == [*algorithms.candidates(name)][int(np.argmax(means))]


def test_the_interquartile_mean_leaves_a_quarter_out_on_each_side():
    runs = np.array([9.0, 1.0, 2.0, 4.0, 100.0])
    mean, low, high = algorithms.interval([runs])
    assert mean == 5.0
    assert 1.0 < low < mean < high <= 100.0
    assert algorithms.interval([runs[:3]])[0] == 4.0


def test_the_interval_draws_runs_within_each_task():
    """Two tasks with equal runs each have no error, although they differ."""
    mean, low, high = algorithms.interval([np.full(4, 0.2), np.full(4, 0.6)])
    assert mean == pytest.approx(low) == pytest.approx(high) == pytest.approx(0.4)
