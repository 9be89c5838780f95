"""Helpers of several test files: playing episodes, comparing them exactly, reading pages."""

import ctypes
import importlib.util
import math
import pickle
import random
import re
import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from DroneSwarmSearch import Action, DroneSwarmSearch, Ending, RewardScheme, Tracks, cli
from DroneSwarmSearch.core import Frame
from DroneSwarmSearch.evaluation import Episodes, Evaluation, View, recording
from DroneSwarmSearch.planning import SuccessBound

TWO_DRONES: dict[str, Any] = {
    "grid_size": 5,
    "n_drones": 2,
    "vector": (0.1, 0.1),
    "person_initial_position": (2, 2),
    "disperse_constant": 2,
    "timestep_limit": 12,
    "bayesian_update": True,
}
"""A search with short episodes, of which random actions end many with a find or a crash."""


def wandering(count, steps, *, start, drift=(0.0, 0.0), sd=0.3, weights=None, size=5):
    """Tracks that drift and diffuse on a small grid, whose border they do not cross."""
    moves = np.random.default_rng(1).normal(drift, sd, (steps + 1, count, 2)).clip(-1, 1)
    moves[0] = start + np.random.default_rng(2).normal(0, 0.5, (count, 2)).clip(-1, 1)
    return Tracks(moves.cumsum(axis=0).clip(-0.4, size - 0.6), weights)


MOVES = {
    Action.LEFT: (-1, 0),
    Action.RIGHT: (1, 0),
    Action.UP: (0, -1),
    Action.DOWN: (0, 1),
    Action.SEARCH: (0, 0),
    Action.IDLE: (0, 0),
}


# The default, the sparse one, one whose sums are not exact in binary, and expected finds of both
# kinds.
SCHEMES = [
    RewardScheme(),
    RewardScheme.sparse(),
    RewardScheme(
        step=0.1, search=3.7, search_threshold=0.25, search_unlikely=-0.3, find=5.5,
        find_early=7.7, timeout=11.3, leave_grid=13.9, collision=17.1,
    ),
    RewardScheme.expected(3.3),
    RewardScheme.expected(2.7, given_misses=True),
]  # fmt: skip
SCHEME_NAMES = ["usual", "sparse", "fractions", "expected", "given-misses"]

# What a drone may intend: an action, or a goal that makes rare events likely.
HUNT = 6  # move to the nearest missing person, and search there
SPREAD = 7  # move at random, neither out of the grid nor into another drone
MEET = 8  # move towards the nearest other drone
INTENTS = [*[SPREAD] * 5, *[HUNT] * 8, *[MEET] * 2, Action.SEARCH, *Action]


def plain(value: Any) -> Any:
    """Nested results as plain data that `==` compares bit for bit, including number types."""
    if isinstance(value, np.ndarray):
        return ("array", str(value.dtype), value.shape, value.tobytes())
    if isinstance(value, Mapping):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, (tuple, list)):
        return [plain(item) for item in value]
    return (type(value).__name__, repr(value))


def whole_state(env: DroneSwarmSearch) -> bytes:
    """The full state of the environment, including the random streams."""
    return pickle.dumps(env)


def without_history(frame: Frame) -> dict[str, Any]:
    """What a batch knows of a frame, as plain data."""
    data: dict[str, Any] = plain(vars(replace(frame, trails=(), searched=())))
    return data


def make_frame(
    grid_size=7,
    *,
    drones=((0, 0),),
    searching=(),
    persons=((1, 1),),
    found=(),
    matrix=None,
    ending=None,
    step=3,
):
    """A frame; `searching` and `found` are indices, and drone 0 finds all persons.

    Without a matrix, cell (1, 1) has all the probability.
    """
    if matrix is None:
        matrix = np.zeros((grid_size, grid_size))
        matrix[1, 1] = 1.0
    return Frame(
        matrix=np.asarray(matrix, dtype=np.float32),
        drones=drones,
        searching=tuple(i in searching for i in range(len(drones))),
        persons=persons,
        found_by=tuple(0 if i in found else None for i in range(len(persons))),
        step=step,
        timestep_limit=10,
        vector=(0.5, -0.25),
        ending=ending,
    )


def overwrite(array: Any) -> None:
    """Overwrite an array even if it is read-only, as a tensor with shared memory can."""
    ctypes.memset(array.ctypes.data, 0x40, array.nbytes)


def target_of(cell: tuple[int, int], action: int) -> tuple[int, int]:
    """The target cell of an action, inside the grid or outside."""
    dx, dy = MOVES[Action(action)]
    return cell[0] + dx, cell[1] + dy


def inside(cell: tuple[int, int], grid_size: int) -> bool:
    return 0 <= cell[0] < grid_size and 0 <= cell[1] < grid_size


def planned_actions(plans, step, drones, missing, grid_size, rng):
    """Return the actions of a step; plans are intents, repeated cyclically."""
    taken = set(drones)
    actions = []
    for plan, cell in zip(plans, drones, strict=True):
        intent = plan[step % len(plan)]
        goals = {HUNT: missing, MEET: [other for other in drones if other != cell]}.get(intent, [])
        if intent in MOVES:
            action = Action(intent)
        elif intent == HUNT and cell in missing:
            action = Action.SEARCH
        else:
            allowed = [move for move in Action if inside(target_of(cell, move), grid_size)]
            if intent != MEET:
                allowed = [m for m in allowed if target_of(cell, m) not in taken - {cell}]
            rng.shuffle(allowed)
            if goals:
                allowed.sort(key=lambda m: min(math.dist(target_of(cell, m), g) for g in goals))
            action = allowed[0]
        actions.append(action)
        taken.add(target_of(cell, action))
    return actions


def careful_actions(rng, observations, grid_size):
    """Random actions that neither leave the grid nor collide."""
    cells = {name: seen["observation"][0] for name, seen in observations.items()}
    taken = set(cells.values())
    actions = {}
    for name, cell in cells.items():
        free = [Action.SEARCH, Action.SEARCH, Action.IDLE]
        for action in (Action.LEFT, Action.RIGHT, Action.UP, Action.DOWN):
            target = target_of(cell, action)
            if inside(target, grid_size) and target not in taken:
                free.append(action)
        actions[name] = int(rng.choice(free))
        taken.add(target_of(cell, actions[name]))
    return actions


def play_on(env, observations, rng):
    """Play to the end of the episode; returns everything observed, as plain data."""
    log = []
    while env.agents:
        result = env.step(careful_actions(rng, observations, env.grid_size))
        observations = result[0]
        log.append([*plain(result), plain(env.state()), plain(env.frame().persons)])
    return log


def play(env: DroneSwarmSearch, policy_seed: int = 0, **reset: Any) -> list[Any]:
    """Play a whole episode, from reset to end; returns everything observed, as plain data."""
    observations, infos = env.reset(**reset)
    start = [plain(observations), plain(infos), plain(env.state()), plain(env.frame().persons)]
    return [start, *play_on(env, observations, random.Random(policy_seed))]


def observed(env: DroneSwarmSearch) -> dict[str, Any]:
    """The drones' current observations."""
    frame = env.frame()
    return {
        name: {"observation": (cell, frame.matrix)}
        for name, cell in zip(env.possible_agents, frame.drones, strict=True)
    }


def bound_by_time(by_time: Any, *, gap: float = 0.0, confidence: float = 1.0) -> SuccessBound:
    """A made-up bound."""
    values = np.array(by_time, np.float64)
    return SuccessBound(values, relaxed=float(values[-1]), gap=gap, confidence=confidence)


def made_evaluation(found_at, search, *, policy="mine", seed=0, bound=None, is_exact=False):
    """A made-up evaluation in which the persons are found in these steps, or never for 0.

    The steps have the shape (n, persons); the bound grows in proportion to time.
    """
    found = np.array(found_at)
    limit = search.scenario.timestep_limit
    last = np.where((found > 0).all(axis=1), found.max(axis=1), limit + 1)
    curves = (np.arange(limit + 1) >= last[:, None]) * 1.0
    episodes = replace(
        Episodes.empty(len(found), found.shape[1], limit),
        found_at=found,
        endings=np.where(last <= limit, Ending.FOUND, Ending.TIME_LIMIT),
        steps=np.minimum(last, limit),
        curves=curves.mean(axis=0, keepdims=True) if is_exact else curves,
    )
    known = None if bound is None else bound_by_time(np.linspace(0.0, bound, limit + 1))
    return Evaluation(policy, search, seed, View(), episodes, is_exact, known)


def module_at(path: Path) -> ModuleType:
    """Import a script as a module."""
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[path.stem] = module  # dataclasses look up their module
    spec.loader.exec_module(module)
    return module


def few_pictures(patch: pytest.MonkeyPatch) -> None:
    """Let videos show the first and the last frame only."""
    write = recording.write_video

    def write_few(path: Path, frames: Any, look: Any, **how: Any) -> None:
        every = [*frames]
        write(path, [every[0], every[-1]], look, **how)

    patch.setattr(recording, "write_video", write_few)


def refusal(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    """The last line of what the command prints about wrong arguments."""
    capsys.readouterr()
    with pytest.raises(SystemExit) as stop:
        cli.main([str(each) for each in arguments])
    captured = capsys.readouterr()
    assert (stop.value.code, captured.out) == (2, "")
    return captured.err.splitlines()[-1]


def tables_of(page: str) -> list[list[list[str]]]:
    """The tables of a page: rows of cells, without the line below the heading."""
    tables = []
    for block in re.findall(r"(?:^\|.*\|\n)+", page + "\n", re.M):
        heading, rule, *rows = block.splitlines()
        assert set(rule) <= set("|-: "), rule
        tables.append(
            [
                [cell.strip() for cell in re.split(r"(?<!\\)\|", line[1:-1])]
                for line in (heading, *rows)
            ]
        )
    return tables


def data_of(evaluation: Any) -> dict[str, Any]:
    """What happened in the episodes of an evaluation, without the curves, as plain data."""
    arrays = vars(evaluation.episodes)
    return {name: array.tolist() for name, array in arrays.items() if name != "curves"}
