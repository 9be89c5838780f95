"""What is measured: cases, each made for a size and a number of searches.

All play the same search: the drones start spread over the grid, the person in its middle,
and random actions, drawn beforehand, are taken until the episode ends. Episodes begin anew
by themselves.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import cycle, islice
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch._internal.streams import RowGenerator
from DroneSwarmSearch.env import DroneSwarmSearch
from DroneSwarmSearch.rules import Action
from DroneSwarmSearch.scenario import Cell
from DroneSwarmSearch.vector import DroneVectorEnv, SearchBatch, SwarmVectorEnv
from DroneSwarmSearch.vector.vector_env import SearchVectorEnv

__all__ = [
    "ACTION_ROWS",
    "DRONE_VIEW",
    "DRONE_VIEW_INDEX",
    "GATHER",
    "INDEX",
    "MATRICES",
    "OWN_LAWS",
    "POSTERIOR",
    "SAMPLER",
    "SINGLE",
    "SINGLE_POSTERIOR",
    "SWARM_VIEW",
    "SWARM_VIEW_INDEX",
    "TIMESTEP_LIMIT",
    "BenchmarkCase",
    "LeftOutError",
    "Run",
    "Size",
    "random_actions",
    "spread_cells",
    "steps_of_one",
]

TIMESTEP_LIMIT = 100
ACTION_ROWS = 512
"""So many rows of actions are drawn; then they come again."""

MOST_BYTES = 2**29
"""BenchmarkCases whose observations of one step take more are left out."""

_STRIDE = 1009  # from a row of actions to the next; a prime, so that no two drones move alike


class Size(NamedTuple):
    """A grid and a swarm."""

    grid_size: int
    n_drones: int

    def __str__(self) -> str:
        return f"{self.grid_size}x{self.n_drones}"


Run = Callable[[int], int]
"""Makes at least so many steps, or calls, and tells how many environment steps they were."""

Actions = list[NDArray[np.int64]]


class LeftOutError(Exception):
    """A case cannot take part; the message says why."""


@dataclass(frozen=True)
class BenchmarkCase:
    """One of those that are measured.

    Attributes:
        name: in tables.
        make: prepares it for a size and a number of searches; raises `LeftOutError`.
        batched: False: it steps one search, whatever the number of searches.
    """

    name: str
    make: Callable[[Size, int], Run]
    batched: bool = True


def spread_cells(grid_size: int, n_drones: int) -> list[Cell]:
    """Different cells spread evenly over the grid, none at its border if that can be helped."""
    side = int(np.ceil(np.sqrt(n_drones)))
    if side <= grid_size - 2:
        places = np.linspace(0, grid_size - 1, side + 2)[1:-1]
    else:
        places = np.linspace(0, grid_size - 1, side)
    along = places.round().astype(int).tolist()
    return [(x, y) for y in along for x in along][:n_drones]


def random_actions(num_envs: int, n_drones: int, high: int = len(Action)) -> Actions:
    """`ACTION_ROWS` arrays of random actions, shape (num_envs, n_drones).

    They are windows of one sequence, lest they take gigabytes: a search gets other numbers
    at every step, but some that other searches get at other steps.
    """
    count = num_envs * n_drones
    drawn = np.random.default_rng(0).integers(0, high, count + _STRIDE * (ACTION_ROWS - 1))
    starts = range(0, _STRIDE * ACTION_ROWS, _STRIDE)
    return [drawn[start : start + count].reshape(num_envs, n_drones) for start in starts]


# One environment.


def steps_of_one(env: Any, actions: list[dict[str, int]], **reset: Any) -> Run:
    """Steps of a PettingZoo environment, and a reset after each end."""
    env.reset(**reset)
    coming = cycle(actions)

    def run(steps: int) -> int:
        step = env.step
        for row in islice(coming, steps):
            step(row)
            if not env.agents:
                env.reset(**reset)
        return steps

    return run


def _one(size: Size, **more: Any) -> Run:
    env = DroneSwarmSearch(
        grid_size=size.grid_size,
        n_drones=size.n_drones,
        person_initial_position=_middle(size),
        timestep_limit=TIMESTEP_LIMIT,
        **more,
    )
    rows = np.concatenate(random_actions(1, size.n_drones)).tolist()
    actions = [dict(zip(env.possible_agents, row, strict=True)) for row in rows]
    return steps_of_one(env, actions, drones_positions=spread_cells(*size))


# The engine.


def _parameters(size: Size) -> dict[str, Any]:
    return {
        "grid_size": size.grid_size,
        "n_drones": size.n_drones,
        "person_initial_position": _middle(size),
        "timestep_limit": TIMESTEP_LIMIT,
        "drones_positions": spread_cells(*size),
    }


def _middle(size: Size) -> Cell:
    return size.grid_size // 2, size.grid_size // 2


def _batch(size: Size, num_envs: int, **more: Any) -> SearchBatch:
    batch = SearchBatch(num_envs, **_parameters(size), **more)
    batch.reset(range(num_envs))
    return batch


def _steps_of_batch(
    batch: SearchBatch, look: Callable[[], object], matrices: NDArray[np.float32] | None = None
) -> Run:
    """Steps of the engine, which write matrices where wanted; then something is looked at."""
    num_rows = batch.num_rows
    coming = cycle(random_actions(num_rows, batch.scenario_of(0).n_drones))

    def run(steps: int) -> int:
        made = 0
        for row in islice(coming, steps):
            # Rows that are over begin anew in place of a step.
            made += num_rows - int(np.count_nonzero(batch.ended))
            batch.step(row, matrices)
            look()
        return made

    return run


def _index(size: Size, num_envs: int) -> Run:
    batch = _batch(size, num_envs, wants_table=True)
    return _steps_of_batch(batch, lambda: (batch.positions, batch.table_index))


def _matrices(size: Size, num_envs: int, **more: Any) -> Run:
    buffer = _matrix_buffer(size, num_envs)
    batch = _batch(size, num_envs, **more)
    return _steps_of_batch(batch, lambda: batch.positions, buffer)


def _own_forecasts(size: Size, num_envs: int) -> Run:
    vectors = np.random.default_rng(1).uniform(-0.5, 0.5, (num_envs, 2))
    return _matrices(size, num_envs, vector=vectors)


def _sampler(rng: RowGenerator) -> Mapping[str, Any]:
    return {"vector": rng.uniform(-0.5, 0.5, 2)}


def _gather(size: Size, num_envs: int) -> Run:
    """Nothing but fetching from the table the matrices at which a batch has come to stand."""
    buffer = _matrix_buffer(size, num_envs)
    batch = _batch(size, num_envs, wants_table=True)
    _steps_of_batch(batch, lambda: None)(TIMESTEP_LIMIT)
    table, index = batch.table, batch.table_index

    def run(steps: int) -> int:
        for _ in range(steps):
            table.take(index, 0, out=buffer, mode="clip")
        return steps * num_envs

    return run


def _matrix_buffer(size: Size, num_envs: int) -> NDArray[np.float32]:
    shape = (num_envs, size.grid_size, size.grid_size)
    _check_bytes(size, num_envs)
    return np.empty(shape, np.float32)


def _check_bytes(size: Size, matrices: int) -> None:
    wanted = 4 * matrices * size.grid_size**2
    if wanted > MOST_BYTES:
        raise LeftOutError(
            f"{matrices:,} matrices a step take {wanted / 2**20:,.0f} MiB, "
            f"more than {MOST_BYTES / 2**20:,.0f}"
        )


# Gymnasium's views, as their users get them: new arrays at every step.


def _view(kind: type[SearchVectorEnv], writes: bool) -> Callable[[Size, int], Run]:
    def make(size: Size, num_envs: int) -> Run:
        if writes:
            _check_bytes(size, num_envs * (size.n_drones if kind is DroneVectorEnv else 1))
        env = kind(num_envs, write_matrices=writes, **_parameters(size))
        env.reset(seed=0)
        actions = random_actions(num_envs, size.n_drones)
        if kind is DroneVectorEnv:
            actions = [row.reshape(-1) for row in actions]
        batch, coming = env.batch, cycle(actions)

        def run(steps: int) -> int:
            made = 0
            for row in islice(coming, steps):
                made += num_envs - int(np.count_nonzero(batch.ended))
                env.step(row)
            return made

        return run

    return make


SINGLE = BenchmarkCase("one environment", lambda size, _: _one(size), batched=False)
SINGLE_POSTERIOR = BenchmarkCase(
    "one environment, posterior",
    lambda size, _: _one(size, bayesian_update=True),
    batched=False,
)
INDEX = BenchmarkCase("batch, index", _index)
MATRICES = BenchmarkCase("batch, matrices", _matrices)
GATHER = BenchmarkCase("gather alone", _gather)
POSTERIOR = BenchmarkCase(
    "batch, posterior", lambda size, num_envs: _matrices(size, num_envs, bayesian_update=True)
)
OWN_LAWS = BenchmarkCase("batch, a drift for each row", _own_forecasts)
SAMPLER = BenchmarkCase(
    "batch, a drift for each episode",
    lambda size, num_envs: _matrices(size, num_envs, sampler=_sampler),
)
SWARM_VIEW = BenchmarkCase("SwarmVectorEnv", _view(SwarmVectorEnv, writes=True))
SWARM_VIEW_INDEX = BenchmarkCase("SwarmVectorEnv, index", _view(SwarmVectorEnv, writes=False))
DRONE_VIEW = BenchmarkCase("DroneVectorEnv", _view(DroneVectorEnv, writes=True))
DRONE_VIEW_INDEX = BenchmarkCase("DroneVectorEnv, index", _view(DroneVectorEnv, writes=False))
