"""Measure how fast TorchRL collects steps from single environments and from the batch.

    pip install torch torchrl
    python tests/benchmarks/bench_torchrl.py

All cases share the search, the observations (flat) and the action masks. They take turns within
one process; rates are environment steps per second:

- SerialEnv: 16 single environments in PettingZooWrapper and TorchRL's SerialEnv;
- SearchEnv: a batch of searches, one case for each size.

Each is measured with random actions, and with the policy of `examples/train_torchrl.py`.
"""

from __future__ import annotations

import argparse
import warnings
from typing import Any

import torch
from tensordict.nn import TensorDictModule
from timing import Run, Spread, take_turns
from torch import nn
from torchrl.collectors import Collector
from torchrl.envs import EnvBase, PettingZooWrapper, RewardSum, SerialEnv, TransformedEnv
from torchrl.envs.utils import RandomPolicy
from torchrl.modules import MLP

from DroneSwarmSearch import Action, DroneSwarmSearch
from DroneSwarmSearch.adapters.torchrl import (
    LOGITS,
    OBSERVATION,
    RETURN,
    REWARD,
    SearchEnv,
    masked_policy,
)
from DroneSwarmSearch.training import TRAINING_TASK
from DroneSwarmSearch.wrappers import ActionMask, FlatObservation, ScaledRewards

SINGLE = 16  # environments in SerialEnv
REWARD_SCALE = 2.0**-17
NUM_STEPS = 32  # steps of each search in a batch of the collector

warnings.filterwarnings("ignore", module="torch")
warnings.filterwarnings("ignore", "PettingZoo in TorchRL is tested using")


def single_env() -> EnvBase:
    env: Any = FlatObservation(ScaledRewards(DroneSwarmSearch(**TRAINING_TASK), REWARD_SCALE))
    env = ActionMask(env, right_of_way=True)
    return PettingZooWrapper(env, group_map={"drones": env.possible_agents})


def batched_env(num_swarms: int) -> EnvBase:
    return SearchEnv(num_swarms, right_of_way=True, reward_scale=REWARD_SCALE, **TRAINING_TASK)


def collecting(env: EnvBase, searches: int, with_network: bool) -> Run:
    """Collect steps of some searches."""
    returns = RewardSum(in_keys=[REWARD], out_keys=[RETURN], reset_keys=["_reset"])
    env = TransformedEnv(env, returns)
    policy: Any = RandomPolicy(env.full_action_spec)
    if with_network:
        inputs = env.observation_spec[OBSERVATION].shape[-1]
        network = MLP(inputs, len(Action), num_cells=[128, 128], activation_class=nn.Tanh)
        policy = masked_policy(TensorDictModule(network, [OBSERVATION], [LOGITS]))
    batches = iter(Collector(env, policy, frames_per_batch=NUM_STEPS * searches))

    def run(steps: int) -> int:
        done = 0
        while done < steps:
            done += next(batches).numel()
        return done

    return run


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rounds", type=int, default=5, help="turns per case (5)")
    parser.add_argument("--seconds", type=float, default=2.0, help="per turn (2)")
    parser.add_argument(
        "--num-swarms", type=int, nargs="+", default=[16, 64, 256, 1024], help="16 64 256 1024"
    )
    options = parser.parse_args()
    torch.set_num_threads(1)
    for with_network in (False, True):
        serial = SerialEnv(SINGLE, single_env)
        runs = {f"SerialEnv, {SINGLE}": collecting(serial, SINGLE, with_network)}
        for number in options.num_swarms:
            run = collecting(batched_env(number), number, with_network)
            runs[f"SearchEnv, {number}"] = run
        rates = take_turns(runs, rounds=options.rounds, seconds=options.seconds, warm_up=512)
        print("with the policy's network" if with_network else "random actions")
        first = next(iter(rates.values()))
        for name, values in rates.items():
            ratio = Spread.of([a / b for a, b in zip(values, first, strict=True)])
            print(
                f"{name:>16}: {Spread.of(values).median:9,.0f} steps/s, "
                f"{ratio.median:6.1f} times ({ratio.lower:.1f} to {ratio.upper:.1f})",
                flush=True,
            )


if __name__ == "__main__":
    main()
