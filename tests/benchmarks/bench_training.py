"""How fast the one-file PPO trains, beside Stable-Baselines3 on the single environment.

    pip install torch stable-baselines3 supersuit
    python tests/benchmarks/bench_training.py

The same network, crops, search and settings of PPO for all, taken in turns within one
process, updates included; rates in environment steps, medians with quartiles:

- one file: `examples/train_ppo.py`, on a batch of searches;
- SB3: Stable-Baselines3's PPO on one environment through `CropsObservation` and
  SuperSuit, which makes every drone a slot;
- SB3, batched: the same on the batch by `SB3VecEnv`;
- network: what the network alone costs, its forward passes in the rollout and the update,
  with nothing to step: no trainer of it can be faster.

Absolute figures swing with the machine; the ratios hold.
"""

from __future__ import annotations

import argparse
import importlib.util
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import supersuit
import torch
from stable_baselines3 import PPO
from torch import nn

from DroneSwarmSearch import DroneSwarmSearch
from DroneSwarmSearch.bench.turns import Spread, take_turns
from DroneSwarmSearch.vector import DroneVectorEnv
from DroneSwarmSearch.vector.sb3 import SB3VecEnv
from DroneSwarmSearch.wrappers import CropsObservation, ScaledRewards
from DroneSwarmSearch.wrappers.crops import LENGTH

SEARCH: dict[str, Any] = {
    "grid_size": 20,
    "vector": (0.1, 0.1),
    "person_initial_position": (10, 10),
    "timestep_limit": 100,
    "bayesian_update": True,
}

Run = Callable[[int], int]


def one_file() -> Any:
    """The example as a module."""
    path = Path(__file__).parents[2] / "examples" / "train_ppo.py"
    spec = importlib.util.spec_from_file_location("train_ppo", path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def run_one_file(example: Any, num_envs: int, drones: int) -> Run:
    """Rollouts and updates of the example."""
    family = [example.Swarms(0, num_swarms=num_envs, n_drones=drones, **SEARCH)]
    agent = example.Agent(family[0].seen.shape[1])
    optimiser = torch.optim.Adam(agent.parameters(), eps=1e-5, fused=True)
    rng, tally = np.random.default_rng(0), example.Tally()
    a_round = example.ROLLOUT * num_envs

    def run(steps: int) -> int:
        rounds = math.ceil(steps / a_round)
        for _ in range(rounds):
            data = example.rollout(agent, family, rng, tally)
            example.update(agent, optimiser, data, 1.0)
        return rounds * a_round

    return run


def run_network(example: Any, num_envs: int, drones: int) -> Run:
    """What the network has to do for them, on data that lie ready."""
    slots = num_envs * drones
    agent = example.Agent(LENGTH)
    optimiser = torch.optim.Adam(agent.parameters(), eps=1e-5, fused=True)
    seen = torch.rand(example.ROLLOUT * slots, LENGTH)
    numbers = torch.rand(len(seen))
    data = {
        "seen": seen,
        "actions": torch.randint(example.ACTIONS, (len(seen),)),
        "masks": torch.ones(len(seen), example.ACTIONS, dtype=torch.bool),
        "logarithms": torch.full((len(seen),), -math.log(example.ACTIONS)),
        "advantages": numbers,
        "returns": numbers,
        "real": torch.ones(len(seen), dtype=torch.bool),
    }

    def run(steps: int) -> int:
        rounds = math.ceil(steps / (example.ROLLOUT * num_envs))
        for _ in range(rounds):
            with torch.no_grad():
                for part in seen.split(slots):
                    agent.actor(part)
                    agent.value(part)
            example.update(agent, optimiser, data, 1.0)
        return rounds * example.ROLLOUT * num_envs

    return run


def run_sb3(example: Any, env: Any, drones: int, transitions: int) -> Run:
    """PPO of Stable-Baselines3 with the example's network and settings."""
    hidden = [example.HIDDEN, example.HIDDEN]
    model = PPO(
        "MlpPolicy",
        env,
        learning_rate=example.LEARNING_RATE,
        n_steps=max(transitions // env.num_envs, 1),
        batch_size=min(example.MINIBATCH, transitions),
        n_epochs=example.EPOCHS,
        gamma=example.DISCOUNT,
        gae_lambda=example.TRACE,
        ent_coef=example.ENTROPY,
        policy_kwargs={"net_arch": {"pi": hidden, "vf": hidden}, "activation_fn": nn.ReLU},
        device="cpu",
    )

    def run(steps: int) -> int:
        begin = model.num_timesteps
        model.learn(steps * drones, reset_num_timesteps=False)
        return int(model.num_timesteps - begin) // drones

    return run


def single(drones: int) -> Any:
    """One environment as SuperSuit makes it fit for Stable-Baselines3."""
    env: Any = DroneSwarmSearch(n_drones=drones, **SEARCH)
    env = CropsObservation(ScaledRewards(env))
    vector = supersuit.pettingzoo_env_to_vec_env_v1(env)
    return supersuit.concat_vec_envs_v1(vector, 1, base_class="stable_baselines3")


def batched(num_envs: int, drones: int) -> SB3VecEnv:
    """The same searches as a batch."""
    return SB3VecEnv(
        DroneVectorEnv(
            num_envs,
            observation="crops",
            autoreset_mode="SameStep",
            reward_scale=2.0**-17,
            n_drones=drones,
            **SEARCH,
        )
    )


def main() -> None:
    """Read the options, and measure."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--seconds", type=float, default=4.0, help="for a turn, about")
    parser.add_argument("--num-envs", type=int, default=512, help="searches in a batch")
    parser.add_argument("--drones", type=int, nargs="+", default=[1, 2, 4], help="in a swarm")
    options = parser.parse_args()
    print(f"{torch.get_num_threads()} threads, {options.num_envs} searches in a batch")
    for drones in options.drones:
        measure(drones, options)


def measure(drones: int, options: argparse.Namespace) -> None:
    """Measure swarms of one size, and print."""
    example, n = one_file(), options.num_envs
    transitions = example.ROLLOUT * n * drones
    runs: dict[str, Run] = {
        "one file": run_one_file(example, n, drones),
        "SB3": run_sb3(example, single(drones), drones, example.MINIBATCH),
        "SB3, batched": run_sb3(example, batched(n, drones), drones, transitions),
        "network": run_network(example, n, drones),
    }
    rates = take_turns(
        runs,
        rounds=options.rounds,
        seconds=options.seconds,
        warm_up=example.MINIBATCH // drones,
        tell=lambda name, number: print(f"\r{name}, round {number}        ", end="", flush=True),
    )
    print(f"\r{drones} drones; medians (quartiles)")
    for name, figures in rates.items():
        rate = Spread.of(figures)
        ratio = Spread.of([a / b for a, b in zip(figures, rates["SB3"], strict=True)])
        print(
            f"{name:>14}: {rate.median:9,.0f} steps/s, "
            f"{ratio.median:5.1f} x SB3 ({ratio.lower:.1f}-{ratio.upper:.1f})"
        )


if __name__ == "__main__":
    main()
