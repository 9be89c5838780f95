"""Other people's environments, measured where they are installed."""

from __future__ import annotations

import contextlib
import importlib
import io
import sys
from collections.abc import Callable, Iterator
from itertools import cycle, islice
from typing import Any
from unittest import mock

import numpy as np

from DroneSwarmSearch.bench.cases import (
    TIMESTEP_LIMIT,
    BenchmarkCase,
    LeftOutError,
    Run,
    Size,
    random_actions,
    spread_cells,
    steps_of_one,
)

__all__ = ["COIN_GAME", "COIN_GAME_SCAN", "COIN_GAME_SIZE", "DSSE"]

COIN_GAME_SIZE = Size(20, 2)
"""What coin_game, a game for two, is compared with."""

_DSSE_ACTIONS = 9  # diagonal moves as well
_COIN_GAME_ACTIONS = 5


def _installed(name: str, requirement: str) -> Any:
    """A module, without what it prints when it is imported.

    Raises:
        LeftOutError: it cannot be imported.
    """
    try:
        with _silence():
            return importlib.import_module(name)
    except ImportError as error:
        raise LeftOutError(
            f"not installed ({error}): python -m pip install {requirement}"
        ) from error


@contextlib.contextmanager
def _silence() -> Iterator[None]:
    """Let nothing be printed; JaxMARL takes up the original stdout to print."""
    with (
        contextlib.redirect_stdout(io.StringIO()) as nowhere,
        mock.patch.object(sys, "__stdout__", nowhere),
    ):
        yield


def _dsse(size: Size, _: int) -> Run:
    """DSSE, from which this game's rules come; its own end episodes less often."""
    module = _installed("DSSE", "DSSE==1.1.9")
    rows = np.concatenate(random_actions(1, size.n_drones, _DSSE_ACTIONS)).tolist()
    actions = [{f"drone{i}": action for i, action in enumerate(row)} for row in rows]
    with _silence():
        env = module.DroneSwarmSearch(
            grid_size=size.grid_size,
            drone_amount=size.n_drones,
            person_initial_position=(size.grid_size // 2, size.grid_size // 2),
            vector=(-0.5, -0.5),
            timestep_limit=TIMESTEP_LIMIT,
        )
        return steps_of_one(env, actions, options={"drones_positions": spread_cells(*size)})


def _coin_game(num_envs: int) -> tuple[Any, Callable[..., Any], Any, Any]:
    """JAX; a step of many games, to be compiled; a key and a state to begin with."""
    jax = _installed("jax", "jaxmarl")
    jax.config.update("jax_platforms", "cpu")
    jaxmarl = _installed("jaxmarl", "jaxmarl")
    with _silence():
        env = jaxmarl.make("coin_game")

    def step(key: Any, state: Any, actions: Any) -> tuple[Any, Any, Any]:
        key, of_step = jax.random.split(key)
        by_agent = {agent: actions[:, i] for i, agent in enumerate(env.agents)}
        keys = jax.random.split(of_step, num_envs)
        seen, state, rewards, over, _ = jax.vmap(env.step)(keys, state, by_agent)
        return key, state, (seen, rewards, over)

    key = jax.random.PRNGKey(0)
    _, state = jax.jit(jax.vmap(env.reset))(jax.random.split(key, num_envs))
    return jax, step, key, state


def _coin_game_actions(num_envs: int) -> list[Any]:
    return random_actions(num_envs, COIN_GAME_SIZE.n_drones, _COIN_GAME_ACTIONS)


def _coin_game_steps(_: Size, num_envs: int) -> Run:
    """A compiled call for each step; the results are awaited at the end of all."""
    jax, step, key, state = _coin_game(num_envs)
    compiled = jax.jit(step)
    coming = cycle([jax.numpy.asarray(row) for row in _coin_game_actions(num_envs)])

    def run(steps: int) -> int:
        nonlocal key, state
        seen: Any = None
        for row in islice(coming, steps):
            key, state, seen = compiled(key, state, row)
        jax.block_until_ready(seen)
        return steps * num_envs

    return run


def _coin_game_scan(_: Size, num_envs: int) -> Run:
    """A compiled call for all steps of an episode, which leaves the rewards of each."""
    jax, step, key, state = _coin_game(num_envs)
    actions = jax.numpy.asarray(np.stack(_coin_game_actions(num_envs)[:TIMESTEP_LIMIT]))

    def one(carried: tuple[Any, Any], row: Any) -> tuple[tuple[Any, Any], Any]:
        key, state, (_, rewards, _) = step(*carried, row)
        return (key, state), rewards

    compiled = jax.jit(lambda *carried: jax.lax.scan(one, carried, actions))

    def run(steps: int) -> int:
        nonlocal key, state
        rewards: Any = None
        calls = -(-steps // TIMESTEP_LIMIT)
        for _ in range(calls):
            (key, state), rewards = compiled(key, state)
        jax.block_until_ready(rewards)
        return calls * TIMESTEP_LIMIT * num_envs

    return run


DSSE = BenchmarkCase("DSSE", _dsse, batched=False)
COIN_GAME = BenchmarkCase("JaxMARL coin_game", _coin_game_steps)
COIN_GAME_SCAN = BenchmarkCase("JaxMARL coin_game, scan", _coin_game_scan)
