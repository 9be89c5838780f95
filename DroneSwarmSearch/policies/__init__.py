"""Trajectories to steer the drones: from what they observe to what they do.

A policy sees what the drones see and the parameters of the search, never the persons. It
is called with the observations of one search, as `DroneSwarmSearch` hands them out,

    policy = make("greedy-posterior", env.scenario)
    observations, infos = env.reset(seed=0)
    policy.reset()
    while env.agents:
        observations, rewards, terminations, truncations, infos = env.step(policy(observations))

or with those of many, as `SwarmVectorEnv` does in its dict layout. `POLICIES` names those
that come with the package; `SwarmPolicy` is the base class for others.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Protocol

from DroneSwarmSearch.observations import Observation
from DroneSwarmSearch.policies.greedy import GreedyPolicy, PosteriorGreedyPolicy
from DroneSwarmSearch.policies.patterns import (
    CreepingLinePolicy,
    ExpandingSquarePolicy,
    ParallelSweepPolicy,
    SectorSearchPolicy,
)
from DroneSwarmSearch.policies.planner import PlannerPolicy
from DroneSwarmSearch.policies.ppo import PPOPolicy
from DroneSwarmSearch.policies.random_walk import RandomPolicy
from DroneSwarmSearch.policies.swarm import BatchPolicy, SwarmPolicy
from DroneSwarmSearch.scenario import Scenario

__all__ = [
    "POLICIES",
    "BatchPolicy",
    "CreepingLinePolicy",
    "ExpandingSquarePolicy",
    "GreedyPolicy",
    "PPOPolicy",
    "ParallelSweepPolicy",
    "PlannerPolicy",
    "PosteriorGreedyPolicy",
    "RandomPolicy",
    "SectorSearchPolicy",
    "SwarmPolicy",
    "make",
]


class Policy(Protocol):
    """What steers one search; `BatchPolicy` does more."""

    def __call__(self, observations: Mapping[str, Observation], /) -> dict[str, int]:
        """An action, 0 to 5, for each drone that is observed."""

    def reset(self) -> None:
        """Forget the episode: the next observations are the first of another one."""


POLICIES: dict[str, Callable[[Scenario], BatchPolicy]] = {
    "random": RandomPolicy,
    "parallel-sweep": ParallelSweepPolicy,
    "creeping-line": CreepingLinePolicy,
    "expanding-square": ExpandingSquarePolicy,
    "sector-search": SectorSearchPolicy,
    "greedy-matrix": GreedyPolicy,
    "greedy-posterior": PosteriorGreedyPolicy,
    "ppo": PPOPolicy,
    "planner": PlannerPolicy,
}
"""The policies by name, from the weakest idea to the strongest: what makes one for a search."""


def make(name: str, scenario: Scenario) -> BatchPolicy:
    """A policy by its name.

    Args:
        name: one of `POLICIES`; or a file of weights, "….npz", as `examples/train_ppo.py`
            writes it, for a `PPOPolicy`.
        scenario: the parameters of every search that it is going to steer.

    Raises:
        FileNotFoundError: there is no such file.
        TypeError: the name is no string, or `scenario` no `Scenario`.
        ValueError: no policy has this name, or the file holds no such network.
    """
    if not isinstance(name, str):
        raise TypeError(f"name must be a policy's name, got {name!r}")
    if name.endswith(".npz"):
        return PPOPolicy(scenario, name)
    if name not in POLICIES:
        raise ValueError(
            f"name must be one of {', '.join(POLICIES)}, or a file of weights (.npz), got {name!r}"
        )
    return POLICIES[name](scenario)
