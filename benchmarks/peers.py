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
from cases import (
    TIMESTEP_LIMIT,
    BenchmarkCase,
    LeftOutError,
    Size,
    random_actions,
    spread_cells,
    steps_of_one,
)
from timing import Run

COIN_GAME_SIZE = Size(20, 2)
"""What coin_game, a game for two, is compared with."""


def dsse(size: Size, _: int) -> Run:
    """DSSE, the package whose rules this environment extends."""
    module = installed("DSSE", "DSSE==1.1.9")
    rows = np.concatenate(random_actions(1, size.n_drones, n_actions=9)).tolist()  # diagonals, too
    actions = [{f"drone{i}": action for i, action in enumerate(row)} for row in rows]
    with silence():
        env = module.DroneSwarmSearch(
            grid_size=size.grid_size,
            drone_amount=size.n_drones,
            person_initial_position=(size.grid_size // 2, size.grid_size // 2),
            vector=(-0.5, -0.5),
            timestep_limit=TIMESTEP_LIMIT,
        )
        return steps_of_one(env, actions, options={"drones_positions": spread_cells(*size)})


def coin_game(num_envs: int) -> tuple[Any, Callable[..., Any], Any, Any, list[Any]]:
    """JAX, a function that steps many games, the first key and state, and random actions."""
    jax = installed("jax", "jaxmarl")
    jax.config.update("jax_platforms", "cpu")
    jaxmarl = installed("jaxmarl", "jaxmarl")
    with silence():
        env = jaxmarl.make("coin_game")

    def step(key: Any, state: Any, actions: Any) -> tuple[Any, Any, Any]:
        key, step_key = jax.random.split(key)
        by_agent = {agent: actions[:, i] for i, agent in enumerate(env.agents)}
        keys = jax.random.split(step_key, num_envs)
        observations, state, rewards, dones, _ = jax.vmap(env.step)(keys, state, by_agent)
        return key, state, (observations, rewards, dones)

    key = jax.random.PRNGKey(0)
    _, state = jax.jit(jax.vmap(env.reset))(jax.random.split(key, num_envs))
    return jax, step, key, state, random_actions(num_envs, COIN_GAME_SIZE.n_drones, n_actions=5)


def coin_game_steps(_: Size, num_envs: int) -> Run:
    """One compiled call per step; only the last result is awaited."""
    jax, step, key, state, actions = coin_game(num_envs)
    compiled = jax.jit(step)
    next_actions = cycle([jax.numpy.asarray(row) for row in actions])

    def run(steps: int) -> int:
        nonlocal key, state
        result: Any = None
        for row in islice(next_actions, steps):
            key, state, result = compiled(key, state, row)
        jax.block_until_ready(result)
        return steps * num_envs

    return run


def coin_game_scan(_: Size, num_envs: int) -> Run:
    """One compiled scan per episode; it returns the rewards only."""
    jax, step, key, state, actions = coin_game(num_envs)
    rows = jax.numpy.asarray(np.stack(actions[:TIMESTEP_LIMIT]))

    def one(carry: tuple[Any, Any], row: Any) -> tuple[tuple[Any, Any], Any]:
        key, state, (_, rewards, _) = step(*carry, row)
        return (key, state), rewards

    compiled = jax.jit(lambda *carry: jax.lax.scan(one, carry, rows))

    def run(steps: int) -> int:
        nonlocal key, state
        rewards: Any = None
        calls = -(-steps // TIMESTEP_LIMIT)
        for _ in range(calls):
            (key, state), rewards = compiled(key, state)
        jax.block_until_ready(rewards)
        return calls * TIMESTEP_LIMIT * num_envs

    return run


def installed(name: str, requirement: str) -> Any:
    """Import a module without its output.

    Raises:
        LeftOutError: it cannot be imported.
    """
    try:
        with silence():
            return importlib.import_module(name)
    except ImportError as error:
        raise LeftOutError(
            f"not installed ({error}): python -m pip install {requirement}"
        ) from error


@contextlib.contextmanager
def silence() -> Iterator[None]:
    """Discard what is printed; JaxMARL prints to the original stdout."""
    with (
        contextlib.redirect_stdout(io.StringIO()) as output,
        mock.patch.object(sys, "__stdout__", output),
    ):
        yield


DSSE = BenchmarkCase("DSSE", dsse, batched=False)
COIN_GAME = BenchmarkCase("JaxMARL coin_game", coin_game_steps)
COIN_GAME_SCAN = BenchmarkCase("JaxMARL coin_game, scan", coin_game_scan)
