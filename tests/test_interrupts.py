"""Ctrl-C at any moment: after a reset, an environment or a batch works like a new one.

The tests raise an interrupt at every few instructions, or lines, of the package's code in turn.
"""

import copy
import itertools
import random
import sys
from collections.abc import Callable
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np
import pytest
from helpers import observed, plain, play, play_on

import DroneSwarmSearch as package
from DroneSwarmSearch import Action, Drift, DroneSwarmSearch, Person, ResetNeeded
from DroneSwarmSearch.vector import SearchBatch, SwarmVectorEnv

HOME = str(Path(package.__file__).parent)

# From Python 3.12 on, a first trace skips most opcode events, so lines are counted instead.
EVENT, COARSER = ("opcode", 1) if sys.version_info < (3, 12) else ("line", 8)


def interrupted(call: Callable[[], object], at: int) -> bool:
    """Interrupt a call at an instruction of the package; returns False if it finished first."""
    instructions = itertools.count()

    def trace(frame: FrameType, event: str, argument: object) -> Any:
        if not frame.f_code.co_filename.startswith(HOME):
            return None
        frame.f_trace_opcodes = EVENT == "opcode"
        if event == EVENT and next(instructions) == at:
            raise KeyboardInterrupt
        return trace

    before = sys.gettrace()
    sys.settrace(trace)
    try:
        call()
    except KeyboardInterrupt:
        return True
    finally:
        sys.settrace(before)
    return False


def interruptions(make, call, stride):
    """Interrupt a call on new subjects at every `stride` instructions; yields the subjects."""
    for at in itertools.count(0, max(1, stride // COARSER)):
        subject = make()
        if not interrupted(lambda subject=subject: call(subject), at):
            assert at > 10 * stride // COARSER  # at least ten interrupts
            return
        yield subject


SEVERAL: dict[str, Any] = {
    "grid_size": 4,
    "n_drones": 2,
    "person_initial_position": [(1, 0), (2, 2)],
    "probability_of_detection": 0.5,
    "vector": (0.2, 0.3),
    "timestep_limit": 12,
}
STEPS = {
    "a search": (SEVERAL, [4, 5]),
    "searches, posterior": ({**SEVERAL, "bayesian_update": True}, [4, 4]),
    "a find": ({"grid_size": 5, "timestep_limit": 12}, [4]),
    "a crash": (SEVERAL, [1, 5]),
    "the time limit": ({**SEVERAL, "timestep_limit": 1}, [5, 4]),
}


def future(env: DroneSwarmSearch) -> list[Any]:
    """The current state and the episode that follows from it."""
    now = [plain(env.state()), plain(env.frame().persons), env.agents, env.frame().ending]
    return [*now, play_on(env, observed(env), random.Random(5))]


@pytest.mark.thorough
@pytest.mark.parametrize(("parameters", "actions"), STEPS.values(), ids=STEPS)
def test_an_interrupted_step_of_an_environment(parameters, actions):
    env = DroneSwarmSearch(**parameters)
    env.reset(seed=3)
    acted = dict(zip(env.agents, actions, strict=True))
    after = copy.deepcopy(env)
    after.step(acted)
    possible = [future(copy.deepcopy(env)), future(after)]
    next_episode = play(copy.deepcopy(env))
    expected = play(DroneSwarmSearch(**parameters), seed=8)
    asked = 0
    for left in interruptions(lambda: copy.deepcopy(env), lambda env: env.step(acted), stride=53):
        if not left.agents:
            with pytest.raises(ResetNeeded, match="interrupted"):
                left.step(acted)
        try:
            assert future(copy.deepcopy(left)) in possible
        except ResetNeeded:
            asked += 1
        assert play(left) == next_episode
        assert play(left, seed=8) == expected
    assert asked > 10


def test_an_interrupted_reset_of_an_environment():
    parameters = {**SEVERAL, "bayesian_update": True}
    env = DroneSwarmSearch(**parameters)
    env.reset(seed=3)
    expected = play(DroneSwarmSearch(**parameters), seed=8, vector=(0.1, 0.1))
    asked = 0
    for left in interruptions(
        lambda: copy.deepcopy(env), lambda env: env.reset(seed=2, vector=(-0.1, 0.4)), stride=151
    ):
        asked += not left.agents
        left = copy.deepcopy(left)
        assert play(left, seed=8, vector=(0.1, 0.1)) == expected
    assert asked > 10


ROWS = 5
BATCHES: dict[str, dict[str, Any]] = {
    "situations, posterior": {
        "bayesian_update": True,
        "situations": [
            [Person([Drift((1, 0), start_sd=1), Drift((3, 3), weight=2)])],
            [Person(Drift((2, 2), diffusion=0.3, adrift=2), 0.5)],
        ],
    },
    "several persons, coverage": {
        "mission": "coverage",
        "persons": [Person(Drift((1.5, 1.5), start_sd=1)), Person(Drift((3, 0)))],
    },
}


def made_batch(parameters: dict[str, Any]) -> SearchBatch:
    """A batch in mid-episode; in the next step, some episodes start and some end."""
    batch = SearchBatch(ROWS, grid_size=4, n_drones=2, timestep_limit=4, **parameters)
    batch.reset(range(ROWS))
    batch.step([[5, 5], [4, 5], [2, 5], [5, 5], [3, 3]])
    batch.step([[4, 5], [4, 3], [5, 5], [5, 4], [3, 1]])
    return batch


def seen(batch: SearchBatch, steps: int = 7) -> list[Any]:
    """The results of some steps of a batch."""
    rng = np.random.default_rng(6)
    matrices = np.empty((batch.num_rows, 4, 4), np.float32)
    log = []
    for _ in range(steps):
        batch.step(rng.choice([1, 2, 3, 4, 4, 4, 5], (batch.num_rows, 2)))
        batch.write_matrices(matrices)
        log.append(plain([matrices, batch.rewards, batch.endings, batch.person_cells, batch.steps]))
    return log


ACTIONS = [[4, 5], [1, 4], [4, 5], [4, 4], [2, 2]]


@pytest.mark.parametrize("parameters", BATCHES.values(), ids=BATCHES)
def test_an_interrupted_step_of_a_batch(parameters):
    batch = made_batch(parameters)
    new = made_batch(parameters)
    new.reset(range(20, 20 + ROWS))
    expected = seen(new)
    after = copy.deepcopy(batch)
    after.step(ACTIONS)
    possible = [seen(copy.deepcopy(batch)), seen(after)]
    asked = 0
    for left in interruptions(
        lambda: copy.deepcopy(batch), lambda batch: batch.step(ACTIONS), stride=131
    ):
        try:
            left.step(np.full((ROWS, 2), Action.IDLE))
        except ResetNeeded:
            asked += 1
            for call in (
                lambda: left.step(ACTIONS),  # noqa: B023
                lambda: left.reset(range(2), np.arange(2)),  # noqa: B023
            ):
                with pytest.raises(ResetNeeded, match="interrupted"):
                    call()
            continued = copy.deepcopy(left)
            continued.reset()
            seen(continued, 1)
        else:
            assert seen(left, 1)
        left.reset(range(20, 20 + ROWS))
        assert seen(left) == expected
    assert asked > 10
    assert seen(batch) in possible


@pytest.mark.parametrize("parameters", BATCHES.values(), ids=BATCHES)
def test_an_interrupted_reset_of_a_batch(parameters):
    batch = made_batch(parameters)
    new = made_batch(parameters)
    given: dict[str, Any] = {"drones_positions": [(1, 1), (2, 3)]}
    others: dict[str, Any] = {"drones_positions": [(3, 1), (2, 2)]}
    if "situations" in parameters:
        given = {"situation": 1}
        others = {"situation": 0}
    new.reset(range(20, 20 + ROWS), **given)
    expected = seen(new)
    for rows in (None, np.arange(3)):
        count = ROWS if rows is None else len(rows)
        for left in interruptions(
            lambda: copy.deepcopy(batch),
            lambda batch, rows=rows, count=count: batch.reset(range(count), rows, **others),
            stride=101,
        ):
            left.reset(range(20, 20 + ROWS), **given)
            assert seen(left) == expected


@pytest.mark.parametrize("mode", ["NextStep", "SameStep", "Disabled"])
def test_an_interrupted_step_of_a_view(mode):
    """Ended episodes do not continue, in any autoreset mode."""

    def made() -> Any:
        env = SwarmVectorEnv(3, autoreset_mode=mode, grid_size=3, n_drones=2, timestep_limit=2)
        env.reset(seed=1)
        return env

    def log(env: Any) -> list[Any]:
        env.reset(seed=8)
        shown = [env.step(np.full((3, 2), Action.SEARCH))[:3]]
        if mode == "Disabled" and shown[0][2].any():
            env.reset(options={"reset_mask": shown[0][2]})
        return plain([*shown, env.step(np.full((3, 2), Action.SEARCH))[:3]])

    crash = np.array([[Action.RIGHT, Action.IDLE], [Action.RIGHT] * 2, [Action.RIGHT] * 2])
    expected = log(made())
    for left in interruptions(made, lambda env: env.step(crash), stride=121):
        if left.batch.ended.any() and mode != "NextStep":
            with pytest.raises(ResetNeeded):
                left.step(np.full((3, 2), Action.IDLE))
        assert log(left) == expected
