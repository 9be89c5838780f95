"""Measure the training speed of PPO on single environments and on the batch.

    pip install torch stable-baselines3 supersuit
    python benchmarks/bench_training.py

All cases share the grid, the observations (crops), the network and the settings of PPO. They
take turns within one process; rates are environment steps per second, updates included. On a busy
machine, measure CPU time with one thread: OMP_NUM_THREADS=1 and --cpu-time.

- SB3: Stable-Baselines3's PPO on a single environment, through SuperSuit;
- SB3, batched: the same on a batch, through `SB3VecEnv`;
- own loop: examples/train_own_loop.py on a batch, with a new search in each episode, and masks;
- network: only the network's forward passes and updates, an upper limit for any trainer.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from pathlib import Path
from typing import Any

import supersuit
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from timing import Run, Spread, take_turns

from DroneSwarmSearch import Action, DroneSwarmSearch
from DroneSwarmSearch.adapters.sb3 import SB3VecEnv
from DroneSwarmSearch.vector import DroneVectorEnv
from DroneSwarmSearch.wrappers import CropsObservation, ScaledRewards

sys.path.insert(0, str(Path(__file__).parents[1] / "examples"))
import train_own_loop as example

GRID_SIZE = 20
NUM_STEPS = example.NUM_STEPS  # of each environment between updates
UPDATE_EPOCHS = example.UPDATE_EPOCHS
MINIBATCH_SIZE = example.MINIBATCH_SIZE

SEARCH: dict[str, Any] = {
    "grid_size": GRID_SIZE,
    "vector": (0.1, 0.1),
    "person_initial_position": (10, 10),
    "timestep_limit": 100,
    "bayesian_update": True,
}


class Network(BaseFeaturesExtractor):
    """The example's network, whose features SB3's actor and critic share."""

    def __init__(self, observation_space: Any) -> None:
        super().__init__(observation_space, example.HIDDEN)
        self.network = example.Agent().network[:-1]  # without its last layer

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        features: torch.Tensor = self.network(observations)
        return features


def network_only(num_swarms: int, n_drones: int) -> Run:
    """The network's share of the above, on random data."""
    agent = example.Agent()
    optimizer = torch.optim.Adam(agent.parameters(), fused=True)
    obs = torch.rand(NUM_STEPS * num_swarms * n_drones, example.INPUTS)
    masks = torch.ones(1, len(Action))

    def forward_and_update() -> None:
        with torch.no_grad():
            for part in obs.split(num_swarms * n_drones):
                agent(part, masks)
        for _ in range(UPDATE_EPOCHS):
            for part in obs.split(MINIBATCH_SIZE):
                logprobs, values = agent(part, masks)
                loss = logprobs.square().mean() + values.square().mean()
                optimizer.zero_grad()
                loss.backward()
                optimizer.step()

    return repeated(forward_and_update, NUM_STEPS * num_swarms)


def own_loop(num_swarms: int, n_drones: int) -> Run:
    """The example's loop."""
    example.GRID_SIZE = GRID_SIZE
    example.DRONES = n_drones
    size = {"grid_size": GRID_SIZE, "n_drones": n_drones}
    setting = argparse.Namespace(lr=example.LEARNING_RATE, entropy=example.ENT_COEF)
    agent = example.Agent()
    envs = example.make_envs(num_swarms, {**example.RANDOM_SEARCHES, **size})
    optimizer = torch.optim.Adam(agent.parameters(), fused=True)
    data: dict[str, torch.Tensor] = {}
    observations, _ = envs.reset(seed=0)

    def collect_and_update() -> None:
        nonlocal observations
        observations, _ = example.rollout(envs, agent, data, observations, example.GAMMA)
        example.update(agent, optimizer, data, setting, 1.0)

    return repeated(collect_and_update, NUM_STEPS * num_swarms)


def repeated(function: Any, steps_per_call: int) -> Run:
    def run(steps: int) -> int:
        calls = math.ceil(steps / steps_per_call)
        for _ in range(calls):
            function()
        return calls * steps_per_call

    return run


def sb3(env: Any, n_drones: int, transitions: int) -> Run:
    """PPO of Stable-Baselines3 with the shared network and settings."""
    model = PPO(
        "MlpPolicy",
        env,
        learning_rate=example.LEARNING_RATE,
        n_steps=max(transitions // env.num_envs, 1),
        batch_size=min(MINIBATCH_SIZE, transitions),
        n_epochs=UPDATE_EPOCHS,
        gamma=example.GAMMA,
        gae_lambda=example.GAE_LAMBDA,
        ent_coef=example.ENT_COEF,
        policy_kwargs={"features_extractor_class": Network, "net_arch": []},
        device="cpu",
    )

    def run(steps: int) -> int:
        start = model.num_timesteps
        model.learn(steps * n_drones, reset_num_timesteps=False)
        return int(model.num_timesteps - start) // n_drones

    return run


def single_env(n_drones: int) -> Any:
    env: Any = DroneSwarmSearch(n_drones=n_drones, **SEARCH)
    env = CropsObservation(ScaledRewards(env))
    vector = supersuit.pettingzoo_env_to_vec_env_v1(env)
    return supersuit.concat_vec_envs_v1(vector, 1, base_class="stable_baselines3")


def batched_env(num_swarms: int, n_drones: int) -> SB3VecEnv:
    return SB3VecEnv(
        DroneVectorEnv(
            num_swarms,
            observation="crops",
            autoreset_mode="SameStep",
            reward_scale=2.0**-17,
            n_drones=n_drones,
            **SEARCH,
        )
    )


def measure(n_drones: int, options: argparse.Namespace) -> None:
    """Measure all cases with swarms of one size, and print the rates."""
    num_swarms = options.num_swarms
    transitions = NUM_STEPS * num_swarms * n_drones
    runs: dict[str, Run] = {
        "SB3": sb3(single_env(n_drones), n_drones, MINIBATCH_SIZE),
        "SB3, batched": sb3(batched_env(num_swarms, n_drones), n_drones, transitions),
        "own loop": own_loop(num_swarms, n_drones),
        "network": network_only(num_swarms, n_drones),
    }
    rates = take_turns(
        runs,
        rounds=options.rounds,
        seconds=options.seconds,
        warm_up=MINIBATCH_SIZE // n_drones,
        clock=time.process_time if options.cpu_time else time.perf_counter,
    )
    print(f"{n_drones} drones; medians (quartiles)")
    for name, values in rates.items():
        rate = Spread.of(values)
        ratio = Spread.of([a / b for a, b in zip(values, rates["SB3"], strict=True)])
        print(
            f"{name:>14}: {rate.median:9,.0f} steps/s, "
            f"{ratio.median:5.1f} x SB3 ({ratio.lower:.1f} to {ratio.upper:.1f})",
            flush=True,
        )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rounds", type=int, default=7, help="turns per case (7)")
    parser.add_argument("--seconds", type=float, default=4.0, help="per turn (4)")
    parser.add_argument("--cpu-time", action="store_true", help="steps per second of CPU time")
    parser.add_argument("--num-swarms", type=int, default=512, help="searches in a batch (512)")
    parser.add_argument("--n-drones", type=int, nargs="+", default=[1, 2, 4], help="1 2 4")
    options = parser.parse_args()
    print(f"{torch.get_num_threads()} threads, {options.num_swarms} searches in a batch")
    for n_drones in options.n_drones:
        measure(n_drones, options)


if __name__ == "__main__":
    main()
