"""Background work is complete and done once, with any number of worker threads."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
import threading
import time
from typing import Any

import numpy as np
import pytest

from DroneSwarmSearch import Action
from DroneSwarmSearch.vector import DroneVectorEnv, SearchBatch, SwarmVectorEnv, threads
from DroneSwarmSearch.vector.threads import run_in_parts, usual_number
from DroneSwarmSearch.vector.vector_env import SearchVectorEnv
from DroneSwarmSearch.wrappers.layouts import LAYOUTS


def workers(number: int) -> threads._Workers:
    made = threads._Workers()
    made.number = number
    return made


def require(fact: object) -> None:
    assert fact


@pytest.fixture
def two(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two workers on any machine."""
    monkeypatch.setattr(threads, "_workers", workers(2))


# Work in parts.


@pytest.mark.parametrize("number", [0, 1, 3])
@pytest.mark.parametrize("parts", [0, 1, 2, 50])
def test_every_part_is_done_once(number: int, parts: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(threads, "_workers", workers(number))
    for _ in range(20):
        done: list[int] = []
        run_in_parts(done.append, range(parts))
        assert sorted(done) == list(range(parts))


def test_workers_run_while_the_caller_does_something_else(two: None) -> None:
    begun, may_end = threading.Event(), threading.Event()
    who = []

    def work(_: int) -> None:
        who.append(threading.current_thread())
        begun.set()
        assert may_end.wait(60)

    def foreground() -> None:
        assert begun.wait(60)  # while the work is not done
        may_end.set()

    run_in_parts(work, [1], foreground)
    assert [thread.daemon for thread in who] == [True]
    assert who != [threading.current_thread()]


def test_the_caller_waits_for_the_workers(two: None) -> None:
    begun, may_end = threading.Event(), threading.Event()
    done = []

    def work(part: int) -> None:
        begun.set()
        assert may_end.wait(60)
        done.append(part)

    def let_go() -> None:
        assert begun.wait(60)
        may_end.set()

    other = threading.Thread(target=let_go)
    other.start()
    run_in_parts(work, [7], lambda: require(begun.wait(60)))
    assert done == [7]
    other.join()


def test_small_work_is_done_by_the_caller_at_the_end(two: None) -> None:
    who = []
    run_in_parts(
        lambda _: who.append(threading.current_thread()),
        range(3),
        lambda: require(who == []),
        shares=False,
    )
    assert who == [threading.current_thread()] * 3


@pytest.mark.parametrize("shares", [True, False])
@pytest.mark.parametrize("wrong", [0, 1, 2])
def test_an_error_of_a_part_is_raised_at_the_end(wrong: int, shares: bool, two: None) -> None:
    def work(part: int) -> None:
        if part == wrong:
            raise ArithmeticError(part)

    with pytest.raises(ArithmeticError, match=str(wrong)):
        run_in_parts(work, range(3), shares=shares)


@pytest.mark.parametrize("shares", [True, False])
def test_an_error_of_the_caller_is_raised_after_the_workers_have_stopped(
    shares: bool, two: None
) -> None:
    begun: list[int] = []
    done: list[int] = []

    def work(part: int) -> None:
        begun.append(part)
        time.sleep(0.001)
        done.append(part)

    def foreground() -> None:
        raise KeyError("foreground")

    for _ in range(10):
        with pytest.raises(KeyError, match="foreground"):
            run_in_parts(work, range(9), foreground, shares)
        assert sorted(begun) == sorted(done)
    if not shares:
        assert not begun


def test_without_threads_the_caller_does_all_parts(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def start(thread: threading.Thread) -> None:
        raise RuntimeError("can't start new thread")

    monkeypatch.setattr(threads, "_workers", workers(3))
    monkeypatch.setattr(threading.Thread, "start", start)
    done: list[int] = []
    for _ in range(2):
        run_in_parts(done.append, range(4))
    assert done == [0, 1, 2, 3] * 2
    assert threads._workers.number == 0


# The number of threads.


@pytest.mark.parametrize(
    ("wanted", "number"),
    [("1", 1), ("3", 3), ("2,4", 2), (" 5 ", 5), ("99", 8), ("", 4), ("0", 4), ("-2", 4), ("x", 4)],
)
def test_the_number_of_threads_is_openmps_or_the_processors(
    wanted: str, number: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", wanted)
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(4)), raising=False)
    assert usual_number() == number


def test_without_openmp_and_affinities_the_processors_are_counted(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    monkeypatch.delattr(os, "sched_getaffinity", raising=False)
    for count, number in ((6, 6), (64, 8), (None, 1)):
        monkeypatch.setattr(os, "cpu_count", lambda count=count: count)
        assert usual_number() == number


def test_no_thread_is_started_for_small_batches() -> None:
    program = (
        "import threading, numpy as np\n"
        "from DroneSwarmSearch.vector import SwarmVectorEnv\n"
        "env = SwarmVectorEnv(400, grid_size=20, n_drones=4, bayesian_update=True)\n"
        "env.reset(seed=0)\n"
        "for _ in range(3): env.step(env.action_space.sample())\n"
        "assert threading.active_count() == 1\n"
    )
    subprocess.run([sys.executable, "-c", program], check=True, timeout=120)


# Batches that are large enough for threads.

LARGE = {"grid_size": 50, "n_drones": 2, "person_initial_position": (25, 25)}
ROWS = 900  # matrices of 9 MB, several tiles of beliefs


def states(batch: SearchBatch, steps: int, together: bool) -> list[bytes]:
    """The results of some steps; matrices are written with the steps, or after them."""
    rng = np.random.default_rng(5)
    matrices = np.empty((batch.num_rows, 50, 50), np.float32)
    seen = []
    for _ in range(steps):
        actions = rng.integers(0, len(Action), (batch.num_rows, 2))
        if together:
            batch.step(actions, matrices)
        else:
            batch.step(actions)
            batch.write_matrices(matrices)
        seen += [matrices.tobytes(), batch.rewards.tobytes(), batch.person_cells.tobytes()]
    return seen


@pytest.mark.parametrize("bayesian", [False, True])
def test_large_batches_do_not_depend_on_the_number_of_workers(
    bayesian: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen = []
    for number in (0, 1, 3):
        monkeypatch.setattr(threads, "_workers", workers(number))
        batch = SearchBatch(ROWS, bayesian_update=bayesian, **LARGE)
        batch.reset(range(ROWS))
        seen.append(states(batch, 6, together=True))
        assert (threads._workers._started > 0) == (number > 0)
    assert seen[0] == seen[1] == seen[2]
    batch = SearchBatch(ROWS, bayesian_update=bayesian, **LARGE)
    batch.reset(range(ROWS))
    assert states(batch, 6, together=False) == seen[0]


@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes cannot be forked here")
@pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning")
def test_forked_processes_have_their_own_workers(two: None) -> None:
    batch = SearchBatch(ROWS, **LARGE)
    batch.reset(range(ROWS))
    states(batch, 2, together=True)
    assert threads._workers._started == 2
    copied = pickle.loads(pickle.dumps(batch))
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:  # pragma: no cover (in another process)
        threads._workers.number = 2
        with os.fdopen(writing, "wb") as pipe:
            pickle.dump((states(batch, 2, together=True), threads._workers._started), pipe)
        os._exit(0)
    os.close(writing)
    with os.fdopen(reading, "rb") as pipe:
        theirs, started = pickle.load(pipe)
    os.waitpid(child, 0)
    assert started == 2
    assert theirs == states(copied, 2, together=True)


def shown(view: type[SearchVectorEnv], **how: Any) -> list[bytes]:
    """The observations of some small searches whose episodes end in between."""
    env = view(7, n_drones=2, timestep_limit=4, copy=False, **how)
    env.action_space.seed(3)
    seen = [pickle.dumps(env.reset(seed=3)[0])]
    for _ in range(9):
        observations, rewards, *_, infos = env.step(env.action_space.sample())
        seen.append(pickle.dumps((observations, rewards, infos.get("final_obs"))))
    return seen


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
@pytest.mark.parametrize("layout", list(LAYOUTS))
@pytest.mark.parametrize("view", [SwarmVectorEnv, DroneVectorEnv])
def test_observations_do_not_depend_on_the_number_of_threads(
    view: type[SearchVectorEnv],
    layout: str,
    mode: str,
    two: None,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    without_threads = shown(view, observation=layout, autoreset_mode=mode)
    assert threads._workers._started == 0
    monkeypatch.setattr(threads, "_LEAST_BYTES", 1)
    monkeypatch.setattr(threads, "_PART_BYTES", 1)
    assert shown(view, observation=layout, autoreset_mode=mode) == without_threads
    assert threads._workers._started == 2


# Output arrays.


@pytest.mark.parametrize(
    ("receiver", "error", "came"),
    [
        ([0.0], TypeError, r"got \[0.0\]"),
        (np.zeros((2, 7, 7)), ValueError, r"got float64 of shape \(2, 7, 7\)"),
        (np.zeros((3, 7, 7), np.float32), ValueError, r"got float32 of shape \(3, 7, 7\)"),
        (np.zeros((2, 7, 14), np.float32)[..., ::2], ValueError, "got one with gaps or in"),
        (np.zeros((2, 7, 7), np.float32).swapaxes(1, 2), ValueError, "got one with gaps or in"),
    ],
)
def test_the_output_array_for_matrices_is_validated(
    receiver: Any, error: type[Exception], came: str
) -> None:
    batch = SearchBatch(2)
    batch.reset([1, 2])
    before = pickle.dumps(batch)
    actions = [[Action.SEARCH], [Action.RIGHT]]
    wanted = r"matrices must be a writeable C-contiguous float32 array of shape \(2, 7, 7\), "
    for write in (batch.write_matrices, lambda given: batch.step(actions, given)):
        with pytest.raises(error, match=wanted + came):
            write(receiver)
        assert pickle.dumps(batch) == before


def test_matrices_are_not_written_into_read_only_arrays() -> None:
    batch = SearchBatch(2)
    batch.reset([1, 2])
    receiver = np.zeros((2, 7, 7), np.float32)
    receiver.flags.writeable = False
    with pytest.raises(ValueError, match="got a read-only one"):
        batch.step([[Action.SEARCH]] * 2, receiver)
    assert batch.steps.tolist() == [0, 0]
