"""Step many searches at once with random actions, and measure the speed.

    python examples/vector_rollout.py --num-envs 4096

Sub-environments reset automatically: the step after the end of an episode starts the next one.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

from DroneSwarmSearch import Action
from DroneSwarmSearch.vector import SwarmVectorEnv

PROBABILITIES = {
    Action.LEFT: 0.1,
    Action.RIGHT: 0.15,
    Action.UP: 0.1,
    Action.DOWN: 0.15,
    Action.SEARCH: 0.4,
    Action.IDLE: 0.1,
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--num-envs", type=int, default=1024, help="searches at once (1024)")
    parser.add_argument("--steps", type=int, default=500, help="steps of each search (500)")
    parser.add_argument("--seed", type=int, default=0, help="of episodes and actions (0)")
    options = parser.parse_args()
    envs = SwarmVectorEnv(
        options.num_envs,
        grid_size=20,
        n_drones=4,
        vector=(0.2, 0.1),
        person_initial_position=(9, 9),
        drones_positions=[(8, 8), (10, 8), (8, 10), (10, 10)],
        timestep_limit=60,
    )
    # Draw the actions beforehand, so that only the steps are timed.
    rng = np.random.default_rng(options.seed)
    shape = (32, *envs.action_space.shape)
    actions = rng.choice(list(PROBABILITIES), shape, p=list(PROBABILITIES.values()))

    episodes = successes = 0
    envs.reset(seed=options.seed)
    start = time.perf_counter()
    for step in range(options.steps):
        _, _, terminated, _, infos = envs.step(actions[step % len(actions)])
        episodes += int(terminated.sum())
        successes += int(infos["Found"][terminated].sum())
    seconds = time.perf_counter() - start
    envs.close()

    steps = options.num_envs * options.steps
    print(f"{steps:,} steps of {options.num_envs} swarms in {seconds:.2f} s")
    print(f"{steps / seconds:,.0f} steps per second")
    if episodes:
        print(f"person found in {successes / episodes:.1%} of {episodes:,} episodes")
    else:
        print("no episode has ended")


if __name__ == "__main__":
    main()
