"""Compare one greedy policy with and without Bayesian updates of the probability matrix.

    python examples/prior_or_posterior.py --episodes 200

With `bayesian_update=False`, the matrix is the forecast of the drift alone, and the policy itself
remembers which cells it has searched. With True, the matrix is the exact posterior given all
searches. Both runs play the same episodes.
"""

from __future__ import annotations

import argparse

from DroneSwarmSearch import DroneSwarmSearch
from DroneSwarmSearch.policies import GreedyPolicy


def play(bayesian_update: bool, episodes: int, seed: int) -> list[bool]:
    """Play the episodes; return whether the person was found in each."""
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
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--episodes", type=int, default=200, help="per policy (200)")
    parser.add_argument("--seed", type=int, default=0, help="of the first episode (0)")
    options = parser.parse_args()
    for name, bayesian_update in (("forecast", False), ("posterior", True)):
        outcomes = play(bayesian_update, options.episodes, options.seed)
        rate = sum(outcomes) / len(outcomes)
        error = (rate * (1 - rate) / len(outcomes)) ** 0.5
        print(f"{name:>9}: found in {rate:.1%} of {len(outcomes)} episodes (± {error:.1%})")


if __name__ == "__main__":
    main()
