"""The demo: watch drones search for a shipwrecked person, or fly one of them.

    python basic_env.py                         watch a search in a window or in the terminal
    python basic_env.py gale                    watch a search of the suite
    python basic_env.py --manual --hide-person  fly drone 0 against the policies
    python basic_env.py --record search.gif     record a video
    python basic_env.py --help                  all options

The search itself is a few lines; `DroneSwarmSearch/demo.py` adds the window and the keys:

    env = DroneSwarmSearch.example(render_mode="human")
    policy = GreedyPolicy(env.scenario)
    observations, infos = env.reset(seed=0)
    while env.agents:
        observations, rewards, terminations, truncations, infos = env.step(policy(observations))
"""

import sys

from DroneSwarmSearch.cli import main

if __name__ == "__main__":
    sys.exit(main(["play", *sys.argv[1:]]))
