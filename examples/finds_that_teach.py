"""What a find is worth: persons of one wreck, who drift alike in a sea that nobody knows.

    python examples/finds_that_teach.py

Six persons drift by one of nineteen hypotheses. Greedy drones search for them: first as if each
person drifted on their own, so that finds teach nothing; then with the exact posterior; and at last
with the true drift, which nobody knows. Takes about two minutes.
"""

from __future__ import annotations

import argparse

import numpy as np

from DroneSwarmSearch import Drift, DroneSwarmSearch, Person, Scenario, policies

PERSONS = 6
DRONES = [(14, 14), (16, 14), (14, 16), (16, 16)]
TWELFTH = np.pi / 6


def vectors() -> list[tuple[float, float]]:
    """The drifts that are possible: twelve fast directions, six slow ones, and none."""
    around = [(0.4, TWELFTH * number) for number in range(12)]
    around += [(0.2, 2 * TWELFTH * number) for number in range(6)]
    moving = [(speed * np.cos(angle), speed * np.sin(angle)) for speed, angle in around]
    return [*moving, (0.0, 0.0)]


def wreck() -> Scenario:
    """Six persons who have been adrift for 25 steps."""
    drifts = [
        Drift((15, 15), start_sd=1, vector=vector, diffusion=0.04, adrift=25)
        for vector in vectors()
    ]
    return Scenario(
        31,
        n_drones=len(DRONES),
        persons=[Person(drifts, 0.9)] * PERSONS,
        shared_drift=True,
        bayesian_update=True,
        crash="block",
        timestep_limit=80,
    )


def found(truth: Scenario, believed: Scenario, seed: int) -> float:
    """The share of the persons that greedy drones find who believe in a scenario."""
    env = DroneSwarmSearch(scenario=truth)
    observations, infos = env.reset(seed=seed, drones_positions=DRONES)
    policy = policies.make("greedy-posterior", believed)
    while env.agents:
        observations, _, _, _, infos = env.step(policy(observations))
    return sum(infos["persons_found"]) / PERSONS


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--episodes", type=int, default=60, help="how many (60)")
    episodes = parser.parse_args().episodes
    together = wreck()
    known = [scenario for _, scenario in together.by_hypothesis()]
    cases = {
        "finds teach nothing": ([together], together.replace(shared_drift=False)),
        "finds teach": ([together], together),
        "the drift is known": (known, None),
    }
    for name, (truths, believed) in cases.items():
        shares = []
        for seed in range(episodes):
            truth = truths[seed % len(truths)]
            shares.append(found(truth, believed or truth, seed))
        error = np.std(shares) / np.sqrt(episodes)
        print(f"{name:>20}: {np.mean(shares):.1%} of the persons, ± {error:.1%}", flush=True)


if __name__ == "__main__":
    main()
