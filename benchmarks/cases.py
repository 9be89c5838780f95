"""The benchmark cases: each is prepared for a grid, a number of drones and of searches.

All cases run the same task: the drones start spread over the grid, the person starts in the
middle, and random actions drawn beforehand are played. Episodes reset automatically.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import cycle, islice
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from timing import Run

from DroneSwarmSearch import Action, Drift, DroneSwarmSearch, Person, Tracks
from DroneSwarmSearch.vector import DroneVectorEnv, SearchBatch, SwarmVectorEnv

TIMESTEP_LIMIT = 100
MAX_BYTES = 2**29  # of matrices in a step; larger cases are skipped
ACTION_ROWS = 512  # rows of random actions, played in a cycle
STRIDE = 1009  # from one row to the next; prime, so that no two drones repeat each other

Actions = list[NDArray[np.int64]]


class LeftOutError(Exception):
    """A case cannot be measured; the message gives the reason."""


class Size(NamedTuple):
    grid_size: int
    n_drones: int

    def __str__(self) -> str:
        return f"{self.grid_size}x{self.n_drones}"


@dataclass(frozen=True)
class BenchmarkCase:
    """A case that `make` prepares for a size and a number of searches, or raises `LeftOutError`.

    If it is not `batched`, it runs one search whatever the number of searches.
    """

    name: str
    make: Callable[[Size, int], Run]
    batched: bool = True


def parameters(size: Size) -> dict[str, Any]:
    return {
        "grid_size": size.grid_size,
        "n_drones": size.n_drones,
        "person_initial_position": (size.grid_size // 2, size.grid_size // 2),
        "timestep_limit": TIMESTEP_LIMIT,
    }


def spread_cells(grid_size: int, n_drones: int) -> list[tuple[int, int]]:
    """Distinct cells spread evenly over the grid, off the border if there is room."""
    side = int(np.ceil(np.sqrt(n_drones)))
    margin = int(side <= grid_size - 2)
    places = np.linspace(0, grid_size - 1, side + 2 * margin)[margin : margin + side]
    along = places.round().astype(int).tolist()
    return [(x, y) for y in along for x in along][:n_drones]


def random_actions(num_envs: int, n_drones: int, n_actions: int = len(Action)) -> Actions:
    """`ACTION_ROWS` arrays of random actions, each of shape (num_envs, n_drones).

    The arrays are overlapping windows of one sequence, which saves gigabytes.
    """
    count = num_envs * n_drones
    drawn = np.random.default_rng(0).integers(0, n_actions, count + STRIDE * (ACTION_ROWS - 1))
    starts = range(0, STRIDE * ACTION_ROWS, STRIDE)
    return [drawn[start : start + count].reshape(num_envs, n_drones) for start in starts]


# A single environment.


def steps_of_one(env: Any, actions: list[dict[str, int]], **reset: Any) -> Run:
    """Step a PettingZoo environment, and reset it when an episode ends."""
    env.reset(**reset)
    next_actions = cycle(actions)

    def run(steps: int) -> int:
        step = env.step
        for row in islice(next_actions, steps):
            step(row)
            if not env.agents:
                env.reset(**reset)
        return steps

    return run


def single(size: Size, **changes: Any) -> Run:
    env = DroneSwarmSearch(**parameters(size), **changes)
    rows = np.concatenate(random_actions(1, size.n_drones)).tolist()
    actions = [dict(zip(env.possible_agents, row, strict=True)) for row in rows]
    return steps_of_one(env, actions, drones_positions=spread_cells(*size))


# Batches.


def make_batch(size: Size, num_envs: int, **changes: Any) -> SearchBatch:
    task = {**parameters(size), "drones_positions": spread_cells(*size), **changes}
    if "situations" in task:
        del task["person_initial_position"]
    batch = SearchBatch(num_envs, **task)
    batch.reset(range(num_envs))
    return batch


def steps_of_batch(
    batch: SearchBatch, step: Callable[[NDArray[np.int64]], object], actions: Actions
) -> Run:
    """Step a batch; a row that resets instead of stepping does not count."""
    num_envs = len(batch.ended)
    next_actions = cycle(actions)

    def run(steps: int) -> int:
        made = 0
        for row in islice(next_actions, steps):
            made += num_envs - int(np.count_nonzero(batch.ended))
            step(row)
        return made

    return run


def batch_with_matrices(
    size: Size, num_envs: int, writes_matrices: bool = True, **changes: Any
) -> Run:
    buffer = matrix_buffer(size, num_envs) if writes_matrices else None
    batch = make_batch(size, num_envs, **changes)

    def step(actions: NDArray[np.int64]) -> object:
        batch.step(actions)
        if buffer is not None:
            batch.write_matrices(buffer)
        return batch.positions

    return steps_of_batch(batch, step, random_actions(num_envs, size.n_drones))


def with_radios(radio_range: float | None) -> Callable[[Size, int], Run]:
    """Drones that block each other, with the matrix that each observes."""

    def make(size: Size, num_envs: int) -> Run:
        batch = make_batch(
            size, num_envs, bayesian_update=True, crash="block", radio_range=radio_range
        )

        def step(actions: NDArray[np.int64]) -> object:
            batch.step(actions)
            return batch.matrices_by_drone()

        return steps_of_batch(batch, step, random_actions(num_envs, size.n_drones))

    return make


def sampled_drifts(size: Size, num_envs: int) -> Run:
    def sampler(rng: Any) -> Mapping[str, Any]:
        return {"vector": rng.uniform(-0.5, 0.5, 2)}

    return batch_with_matrices(size, num_envs, sampler=sampler)


def situations(hypotheses: int, count: int, posterior: bool = False) -> Callable[[Size, int], Run]:
    """A batch of persons with uncertain starts and drifts, each in one of some situations."""

    def make(size: Size, num_envs: int) -> Run:
        rng = np.random.default_rng(2)
        middle = size.grid_size / 2
        drifts = [
            Drift(
                rng.normal(middle, size.grid_size / 10, 2),
                start_sd=size.grid_size / 15,
                vector=rng.uniform(-0.2, 0.2, 2),
                vector_sd=0.03,
                diffusion=0.1,
            )
            for _ in range(count * hypotheses)
        ]
        own = [drifts[first : first + hypotheses] for first in range(0, len(drifts), hypotheses)]
        persons = [[Person(hypotheses_of)] for hypotheses_of in own]
        return batch_with_matrices(
            size, num_envs, posterior, bayesian_update=posterior, situations=persons
        )

    return make


def of_tracks(size: Size, num_envs: int) -> Run:
    """A batch of persons made of 30,000 tracks, which drift and diffuse."""
    rng = np.random.default_rng(3)
    moves = rng.normal((0.05, 0.02), 0.1, (TIMESTEP_LIMIT + 1, 30_000, 2)).clip(-1, 1)
    moves[0] = rng.normal(size.grid_size / 2, size.grid_size / 15, (30_000, 2))
    tracks = Tracks(moves.cumsum(axis=0).clip(-0.4, size.grid_size - 0.6))
    return batch_with_matrices(size, num_envs, bayesian_update=True, situations=[[Person(tracks)]])


def matrix_buffer(size: Size, num_matrices: int) -> NDArray[np.float32]:
    wanted = 4 * num_matrices * size.grid_size**2
    if wanted > MAX_BYTES:
        raise LeftOutError(
            f"{num_matrices:,} matrices take {wanted / 2**20:,.0f} MiB per step, "
            f"more than {MAX_BYTES / 2**20:,.0f}"
        )
    return np.empty((num_matrices, size.grid_size, size.grid_size), np.float32)


def vector_env(
    kind: type[DroneVectorEnv] | type[SwarmVectorEnv],
) -> Callable[[Size, int], Run]:
    """Gymnasium's vector environments, which return new arrays from every step."""
    by_drone = kind is DroneVectorEnv

    def make(size: Size, num_envs: int) -> Run:
        matrix_buffer(size, num_envs * (size.n_drones if by_drone else 1))
        cells = spread_cells(*size)
        env = kind(num_envs, **parameters(size), drones_positions=cells)
        env.reset(seed=0)
        actions = random_actions(num_envs, size.n_drones)
        if by_drone:
            actions = [row.reshape(-1) for row in actions]
        return steps_of_batch(env.batch, env.step, actions)

    return make


def training(sampled: bool) -> Callable[[Size, int], Run]:
    """What the training guide recommends: posterior, crops, masks with right of way.

    Actions are drawn from those that the masks allow, and the choice counts. With a sampler, every
    256 episodes are new searches.
    """

    def make(size: Size, num_envs: int) -> Run:
        task = parameters(size)
        if sampled:
            middle = task.pop("person_initial_position")

            def sampler(rng: np.random.Generator) -> dict[str, Any]:
                return {"vector": rng.uniform(-0.3, 0.3, 2), "person_initial_position": middle}

            task["sampler"] = sampler
        env = DroneVectorEnv(
            num_envs,
            observation="crops",
            action_mask="observation",
            right_of_way=True,
            autoreset_mode="SameStep",
            mission="coverage",
            bayesian_update=True,
            shared_reward=True,
            drones_positions=spread_cells(*size),
            **task,
        )
        observations, _ = env.reset(seed=0)
        draws = np.random.default_rng(0).random((7, env.num_envs, len(Action)), np.float32)

        def step(row: NDArray[np.int64]) -> None:
            nonlocal observations
            scores = draws[row[0, 0]] * observations["action_mask"]
            observations, *_ = env.step(scores.argmax(axis=1))

        rows = [np.full((1, 1), number) for number in range(len(draws))]
        return steps_of_batch(env.batch, step, rows)

    return make


SINGLE = BenchmarkCase("one environment", lambda size, _: single(size), batched=False)
SINGLE_POSTERIOR = BenchmarkCase(
    "one environment, posterior", lambda size, _: single(size, bayesian_update=True), batched=False
)
ENGINE = BenchmarkCase(
    "batch, without matrices",
    lambda size, n: batch_with_matrices(size, n, writes_matrices=False),
)
MATRICES = BenchmarkCase("batch, matrices", batch_with_matrices)
POSTERIOR = BenchmarkCase(
    "batch, posterior", lambda size, n: batch_with_matrices(size, n, bayesian_update=True)
)
ALL_HEAR = BenchmarkCase("batch, posterior, all hear each other", with_radios(None))
RADIOS = BenchmarkCase("batch, posterior, radios of 4 cells", with_radios(4.0))
TRAINING = BenchmarkCase("DroneVectorEnv, training", training(sampled=False))
TRAINING_SAMPLER = BenchmarkCase("DroneVectorEnv, training, a sampler", training(sampled=True))
SAMPLER = BenchmarkCase("batch, a sampler of drifts", sampled_drifts)
ONE_HYPOTHESIS = BenchmarkCase("batch, one hypothesis, posterior", situations(1, 1, True))
TWO_HYPOTHESES = BenchmarkCase("batch, two hypotheses, posterior", situations(2, 1, True))
TRACKS = BenchmarkCase("batch, tracks, posterior", of_tracks)
CATALOGUE = BenchmarkCase("batch, 100 situations, posterior", situations(2, 100, True))
ONE_SITUATION_ENGINE = BenchmarkCase("batch, one situation, without matrices", situations(2, 1))
CATALOGUE_ENGINE = BenchmarkCase("batch, 100 situations, without matrices", situations(2, 100))
SWARM_ENV = BenchmarkCase("SwarmVectorEnv", vector_env(SwarmVectorEnv))
DRONE_ENV = BenchmarkCase("DroneVectorEnv", vector_env(DroneVectorEnv))
