"""What a true belief is worth: one greedy policy, with and without the posterior.

    python examples/prior_or_posterior.py --episodes 200

Both runs meet the same seas. With `bayesian_update=False` the matrix is the drift alone
and the policy has to remember by itself where it has searched; with True the matrix is
the exact posterior given the searches made.
"""

from __future__ import annotations

import argparse

from DroneSwarmSearch import DroneSwarmSearch
from DroneSwarmSearch.policies import GreedyPolicy


def found(bayesian_update: bool, episodes: int, seed: int) -> list[bool]:
    """Whether each of some episodes ended with the person found."""
    env = DroneSwarmSearch(
        grid_size=20,
        n_drones=4,
        vector=(0.2, 0.1),
        person_initial_position=(9, 9),
        disperse_constant=10,
        timestep_limit=60,
        bayesian_update=bayesian_update,
    )
    policy = GreedyPolicy(env.scenario)
    outcomes = []
    for episode in range(episodes):
        observations, infos = env.reset(seed=seed if episode == 0 else None)
        policy.reset()
        while env.agents:
            observations, _, _, _, infos = env.step(policy(observations))
        outcomes.append(bool(infos["Found"]))
    return outcomes


def main() -> None:
    """Play both and print the shares of success."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--episodes", type=int, default=200, help="episodes of each (200)")
    parser.add_argument("--seed", type=int, default=0, help="seed of the seas (0)")
    options = parser.parse_args()
    for name, bayesian_update in (("drift alone", False), ("posterior", True)):
        outcomes = found(bayesian_update, options.episodes, options.seed)
        share = sum(outcomes) / len(outcomes)
        spread = (share * (1 - share) / len(outcomes)) ** 0.5
        print(f"{name:>12}: found in {share:.1%} of {len(outcomes)} episodes (± {spread:.1%})")


if __name__ == "__main__":
    main()
