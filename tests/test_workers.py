"""Workers: equal results, clear errors, no process left."""

from __future__ import annotations

import importlib.util
import json
import os
import pickle
import runpy
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from DroneSwarmSearch import Action
from DroneSwarmSearch.evaluation import WorkerCrashed, evaluate, leaderboard, run, search
from DroneSwarmSearch.evaluation.store import Store
from DroneSwarmSearch.evaluation.workers import JOBLIB_HINT, RAY_HINT, Job
from DroneSwarmSearch.evaluation.workers import run as run_jobs

PATIENCE = 60.0
"""Seconds after which a test fails that waits for another process."""

# A search, also as a coverage mission, and a policy with a memory and random numbers of its own.
FICKLE = """
from dataclasses import replace
import numpy as np
from DroneSwarmSearch import RewardScheme
from DroneSwarmSearch.evaluation import NamedSearch
from DroneSwarmSearch.scenario import Scenario

SEARCH = NamedSearch("small", "For tests.", Scenario(
    grid_size=5, n_drones=2, vector=(0, 0), person_initial_position=[(2, 2), (1, 3)],
    disperse_constant=5, timestep_limit=15, probability_of_detection=1, bayesian_update=True,
    reward_scheme=RewardScheme(),
), ((2, 2), (2, 3)))
COVERAGE = replace(SEARCH, name="coverage", scenario=SEARCH.scenario.replace(mission="coverage"))

class Fickle:
    def __init__(self, scenario):
        self.n_drones = scenario.n_drones
        self.rng = np.random.default_rng(5)

    def __call__(self, shown):
        return self.rng.integers(4, 6, (len(shown["row"]), self.n_drones))
"""


def still(shown: Any) -> Any:
    return np.full(shown["positions"].shape[:2], int(Action.SEARCH))


class Dies:
    """Kills the process that plays a certain seed, if a file exists."""

    def __init__(self, seed: int, file: Path) -> None:
        self.seed, self.file = seed, file

    def reset(self, seed: list[int], rows: None = None) -> None:
        if self.seed in seed and self.file.exists():
            until(lambda: len(list(self.file.parent.glob("kept/*.json"))) >= 2)
            os._exit(3)

    def __call__(self, shown: Any) -> Any:
        return still(shown)


class Refuses:
    def __call__(self, shown: Any) -> Any:
        raise LookupError("no chart")


class Unsendable(Exception):  # noqa: N818
    def __init__(self, one: int, other: int) -> None:
        super().__init__(f"{one} and {other}")


def raises_unsendable(report: Any) -> None:
    raise Unsendable(1, 2)


def add(one: int, other: int, report: Any) -> int:
    report(0.5)
    return one + other


@pytest.fixture
def _small_portions(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run, "PORTION", 20)


@pytest.mark.usefixtures("_small_portions")
def test_results_do_not_depend_on_the_workers(tmp_path):
    """With a policy that cannot be imported: a local class that closes over a lambda."""
    (tmp_path / "fickle.py").write_text(FICKLE, "utf-8")
    defined = runpy.run_path(str(tmp_path / "fickle.py"))
    searches = defined["SEARCH"], defined["COVERAGE"]
    draw = lambda rng, shape: rng.integers(4, 6, shape)  # noqa: E731

    class Fickle:
        def __init__(self, scenario: Any) -> None:
            self.n_drones = scenario.n_drones
            self.rng = np.random.default_rng(5)

        def __call__(self, shown: Any) -> Any:
            return draw(self.rng, (len(shown["row"]), self.n_drones))

    by_one, by_two = (
        leaderboard(
            [], searches, added=[Fickle], episodes=90, bounds=False, workers=count, progress=False
        ).evaluations
        for count in (1, 2)
    )
    assert len(by_one) == 2
    for alone, shared in zip(by_one, by_two, strict=True):
        assert 0 < alone.success.value < 1
        assert shared.data == alone.data
        assert shared.episodes.data == alone.episodes.data


@pytest.mark.usefixtures("_small_portions")
def test_a_crash_names_the_job_and_finished_work_is_kept(tmp_path):
    fuse = tmp_path / "fuse"
    fuse.touch()
    arguments: dict[str, Any] = {
        "policy": Dies(45, fuse),
        "search": "pond",
        "episodes": 100,
        "store": tmp_path / "kept",
        "name": "dies",
        "workers": 2,
        "progress": False,
    }
    message = r"died \(EXIT\(3\)\) while it was running .*episodes 40 to 59 of dies on pond$"
    with pytest.raises(WorkerCrashed, match=message):
        evaluate(**arguments)
    kept = len(Store(tmp_path / "kept"))
    assert 2 <= kept < 2 * 5
    fuse.unlink()
    before = {path: path.stat().st_mtime_ns for path in (tmp_path / "kept").iterdir()}
    got = evaluate(**{**arguments, "workers": 1})
    assert len(Store(tmp_path / "kept")) == 2 * 5
    for path, written in before.items():  # none was played again
        assert path.stat().st_mtime_ns == written
    assert got.episodes.data == evaluate(still, "pond", episodes=100).episodes.data


def test_errors_in_workers_are_raised_in_the_caller():
    with pytest.raises(LookupError, match="no chart") as caught:
        evaluate(Refuses(), "pond", episodes=2, workers=2, progress=False)
    assert 'raise LookupError("no chart")' in str(caught.value.__cause__)
    with pytest.raises(RuntimeError, match=r"Unsendable\('1 and 2'\)"):
        run_jobs([Job("x", raises_unsendable)], workers=2)


def test_a_policy_that_cannot_be_sent_is_reported():
    lock = threading.Lock()

    def policy(shown: Any) -> Any:
        with lock:
            return still(shown)

    with pytest.raises(
        TypeError, match=r"the construction of policy for pond cannot be sent.*lock"
    ):
        evaluate(policy, "pond", episodes=2, workers=2, progress=False)


@pytest.mark.parametrize("workers", [1, 2])
def test_jobs_may_be_followed_by_others(workers):
    done: list[Any] = []
    reports: list[float] = []

    def then(result: int) -> list[Job]:
        done.append(result)
        if result >= 4:
            return []
        return [Job("more", add, (result, 2), 1.0, then), Job("last", add, (90, result), 1.0, then)]

    run_jobs([Job("first", add, (1, 1), 2.0, then)], workers=workers, progress=reports.append)
    assert sorted(done) == [2, 4, 92]
    assert reports == sorted(reports)
    assert reports[0] in (1.0, 2.0)
    assert reports[-1] == 4.0


def test_jobs_run_in_their_order_and_followers_first():
    done: list[int] = []

    def last(result: int) -> list[Job]:
        done.append(result)
        return []

    def first(result: int) -> list[Job]:
        done.append(result)
        return [Job("", add, (10, 0), then=last), Job("", add, (11, 0), then=last)]

    run_jobs([Job("", add, (1, 0), then=first), Job("", add, (2, 0), then=last)])
    assert done == [1, 10, 11, 2]


SCRIPT = """
import json, sys, time
from pathlib import Path
import numpy as np
from DroneSwarmSearch.evaluation import evaluate, run

run.PORTION = 5
home = Path(sys.argv[1])

class Slow:
    def reset(self, seed, rows=None):
        with (home / "played").open("a") as file:
            print(seed[0], file=file)
        self.waits = seed[0] >= 10 and not (home / "free").exists()

    def __call__(self, shown):
        while self.waits:
            time.sleep(0.05)  # short, since a signal just before a sleep waits for its end
        return np.full(shown["positions"].shape[:2], 4)

def main():
    got = evaluate(
        Slow(), "pond", episodes=20, workers=int(sys.argv[2]), store=home / "kept", name="slow"
    )
    print(json.dumps(got.episodes.data))
"""
GUARD = 'if __name__ == "__main__":\n    main()\n'


def begun(home: Path, workers: int, text: str = SCRIPT + GUARD) -> subprocess.Popen[str]:
    """Start a script that evaluates, in a new process group, as in a terminal."""
    (home / "script.py").write_text(text, "utf-8")
    return subprocess.Popen(
        [sys.executable, str(home / "script.py"), str(home), str(workers)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def until(happened: Callable[[], bool]) -> None:
    """Wait for other processes."""
    end = time.monotonic() + PATIENCE
    while not happened():
        assert time.monotonic() < end
        time.sleep(0.02)


def is_alive(group: int) -> bool:
    """Whether a process group has members."""
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return False
    return True


def lines_of(path: Path) -> list[str]:
    return path.read_text("utf-8").split() if path.exists() else []


@pytest.mark.skipif(not hasattr(os, "killpg"), reason="there are no process groups")
def test_ctrl_c_stops_the_workers_and_a_rerun_resumes(tmp_path, monkeypatch):
    process = begun(tmp_path, 2)
    stuck = {"10", "15"}
    until(lambda: stuck <= {*lines_of(tmp_path / "played")} and len(Store(tmp_path / "kept")) == 2)
    os.killpg(process.pid, signal.SIGINT)  # to all processes, as a terminal does
    _, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode != 0
    assert errors.rstrip().endswith("KeyboardInterrupt")
    assert errors.count("Traceback") == 1
    assert len(Store(tmp_path / "kept")) == 2
    until(lambda: not is_alive(process.pid))  # no process is left

    (tmp_path / "played").unlink()
    (tmp_path / "free").touch()
    printed, _ = begun(tmp_path, 1).communicate(timeout=PATIENCE)
    # Two portions, and the conditional success of all four.
    assert sorted(lines_of(tmp_path / "played")) == ["0", "10", "10", "15", "15", "5"]
    monkeypatch.setattr(run, "PORTION", 5)
    assert json.loads(printed) == evaluate(still, "pond", episodes=20).episodes.data


def test_a_script_needs_no_main_guard(tmp_path):
    (tmp_path / "free").touch()
    printed, errors = begun(tmp_path, 2, SCRIPT + "main()\n").communicate(timeout=PATIENCE)
    assert errors == ""
    assert len(json.loads(printed)["endings"]) == 20


def test_the_workers_end_when_the_program_is_killed(tmp_path):
    process = begun(tmp_path, 2)
    until(lambda: {"10", "15"} <= {*lines_of(tmp_path / "played")})
    process.kill()
    process.communicate(timeout=PATIENCE)  # the pipes close when the workers end
    until(lambda: not is_alive(process.pid))


def test_without_joblib_there_is_a_hint(monkeypatch):
    monkeypatch.setitem(sys.modules, "joblib.externals.loky", None)
    with pytest.raises(ImportError) as caught:
        evaluate(still, "pond", episodes=2, workers=2, progress=False)
    assert str(caught.value) == JOBLIB_HINT


# Ray.


def test_without_ray_there_is_a_hint(monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(ImportError) as caught:
        evaluate(still, "pond", episodes=2, ray="local", progress=False)
    assert str(caught.value) == RAY_HINT


CLUSTER = """
import sys
import ray
from ray.cluster_utils import Cluster
from DroneSwarmSearch.evaluation import WorkerCrashed, evaluate, run
from fickle import COVERAGE, SEARCH

run.PORTION = 20
path = sys.argv[1]
plain = [evaluate(f"{path}:Fickle", each, episodes=90) for each in (SEARCH, COVERAGE)]
cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1})
cluster.add_node(num_cpus=1)
for alone in plain:
    spread = evaluate(f"{path}:Fickle", alone.search, episodes=90, ray=cluster.address)
    assert spread.data == alone.data
    assert spread.episodes.data == alone.episodes.data
assert not ray.is_initialized()

ray.init(address=cluster.address, log_to_driver=False, logging_level="error")
assert ray.cluster_resources()["CPU"] == 2
assert len([node for node in ray.nodes() if node["Alive"]]) == 2
for name, kind, words in (
    ("dies", WorkerCrashed, "while it was running episodes 0 to 19 of"),
    ("refuses", LookupError, "no chart"),
):
    try:
        evaluate(f"{path}:{name}", "pond", episodes=20, ray=cluster.address)
    except kind as error:
        assert words in str(error), error
    else:
        raise AssertionError(name)
assert ray.is_initialized()  # started outside
ray.shutdown()
cluster.shutdown()
print("the same")
"""

DIES = """
import os

def dies(shown):
    os._exit(3)

def refuses(shown):
    raise LookupError("no chart")
"""


@pytest.mark.slow
@pytest.mark.skipif(importlib.util.find_spec("ray") is None, reason="Ray is not installed")
def test_results_are_the_same_on_a_cluster_of_two_nodes(tmp_path):
    """Two nodes of one processor each, on this machine."""
    (tmp_path / "fickle.py").write_text(FICKLE + DIES, "utf-8")
    (tmp_path / "cluster.py").write_text(CLUSTER, "utf-8")
    done = subprocess.run(
        [sys.executable, str(tmp_path / "cluster.py"), str(tmp_path / "fickle.py")],
        capture_output=True,
        text=True,
        timeout=5 * PATIENCE,
        check=False,
        env={**os.environ, "RAY_ENABLE_UV_RUN_RUNTIME_ENV": "0", "RAY_USAGE_STATS_ENABLED": "0"},
    )
    assert done.returncode == 0, done.stderr[-3000:]
    assert done.stdout.splitlines()[-1] == "the same"


def test_searches_can_be_pickled():
    """Workers receive the search itself."""
    again = pickle.loads(pickle.dumps(search("wreck")))
    assert again == search("wreck")
    assert again.fingerprint == search("wreck").fingerprint
