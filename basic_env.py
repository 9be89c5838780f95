"""The demo: drones search the sea for a shipwrecked person while you watch, or fly along.

Run it from the repository, or anywhere once the package is installed:

    python basic_env.py                      watch a search, in a window or in the terminal
    python basic_env.py --manual             fly drone 0: arrows, space to search, i to idle
    python basic_env.py --record search.gif  make a film of it
    python basic_env.py --help               everything else

The search itself is a few lines; `DroneSwarmSearch/demo.py` adds the window and the keys:

    env = DroneSwarmSearch(grid_size=20, n_drones=4, render_mode="human")
    policy = GreedyPolicy(env.scenario)
    observations, infos = env.reset(seed=0)
    while env.agents:
        observations, rewards, terminations, truncations, infos = env.step(policy(observations))
"""

import sys

from DroneSwarmSearch.demo import main

if __name__ == "__main__":
    sys.exit(main())
