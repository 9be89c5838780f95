"""Many searches at once: random drones, how fast they step, and how often they find.

    python examples/vector_rollout.py --num-envs 4096

Drones search or stay half of the time and otherwise move. An episode that has ended gives
way to the next one by itself, in the step that follows.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

from DroneSwarmSearch import Action
from DroneSwarmSearch.vector import SwarmVectorEnv

CHANCES = {
    Action.LEFT: 0.1,
    Action.RIGHT: 0.15,
    Action.UP: 0.1,
    Action.DOWN: 0.15,
    Action.SEARCH: 0.4,
    Action.IDLE: 0.1,
}


def main() -> None:
    """Step the searches and print what came of it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--num-envs", type=int, default=1024, help="searches at a time (1024)")
    parser.add_argument("--steps", type=int, default=500, help="steps of each (500)")
    parser.add_argument("--seed", type=int, default=0, help="seed of the seas (0)")
    options = parser.parse_args()
    env = SwarmVectorEnv(
        options.num_envs,
        grid_size=20,
        n_drones=4,
        vector=(0.2, 0.1),
        person_initial_position=(9, 9),
        drones_positions=[(8, 8), (10, 8), (8, 10), (10, 10)],
        timestep_limit=60,
    )
    rng = np.random.default_rng(options.seed)
    shape = (32, *env.action_space.shape)  # beforehand, so that the steps alone are timed
    actions = rng.choice(list(CHANCES), shape, p=list(CHANCES.values()))

    episodes = successes = 0
    env.reset(seed=options.seed)
    start = time.perf_counter()
    for step in range(options.steps):
        _, _, terminated, _, infos = env.step(actions[step % len(actions)])
        episodes += int(terminated.sum())
        successes += int(infos["Found"][terminated].sum())
    seconds = time.perf_counter() - start
    env.close()

    steps = options.num_envs * options.steps
    print(f"{steps:,} steps of {options.num_envs} swarms in {seconds:.2f} s")
    print(f"{steps / seconds:,.0f} steps per second")
    if episodes:
        print(f"somebody was found in {successes / episodes:.1%} of {episodes:,} episodes")
    else:
        print("no episode has ended")


if __name__ == "__main__":
    main()
