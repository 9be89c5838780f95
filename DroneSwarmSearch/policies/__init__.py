"""Policies map the drones' observations to actions.

A policy sees the drones' observations and the parameters of the search, never the persons. Call it
with the observations of one search, or of a batch of `SwarmVectorEnv` in its dict layout:

    policy = make("greedy-posterior", env.scenario)
    observations, infos = env.reset(seed=0)
    policy.reset()
    while env.agents:
        observations, rewards, terminations, truncations, infos = env.step(policy(observations))
"""

from __future__ import annotations

from collections.abc import Callable

from DroneSwarmSearch._internal.errors import did_you_mean
from DroneSwarmSearch.core.scenario import Scenario
from DroneSwarmSearch.policies.base import BatchPolicy, SwarmPolicy
from DroneSwarmSearch.policies.belief_tracker import BeliefTracker, Outlook
from DroneSwarmSearch.policies.gains import SearchGains
from DroneSwarmSearch.policies.greedy import (
    ForecastGreedyPolicy,
    GreedyPolicy,
    PosteriorGreedyPolicy,
)
from DroneSwarmSearch.policies.imitation import DEFAULT_WEIGHTS, ImitationPolicy, Network
from DroneSwarmSearch.policies.patterns import (
    CreepingLinePolicy,
    ExpandingSquarePolicy,
    ParallelSweepPolicy,
    SectorSearchPolicy,
)
from DroneSwarmSearch.policies.planner import PlannerPolicy
from DroneSwarmSearch.policies.random_policy import RandomPolicy
from DroneSwarmSearch.policies.rollout import RolloutPolicy

__all__ = [
    "DEFAULT_WEIGHTS",
    "POLICIES",
    "BatchPolicy",
    "BeliefTracker",
    "CreepingLinePolicy",
    "ExpandingSquarePolicy",
    "ForecastGreedyPolicy",
    "GreedyPolicy",
    "ImitationPolicy",
    "Network",
    "Outlook",
    "ParallelSweepPolicy",
    "PlannerPolicy",
    "PosteriorGreedyPolicy",
    "RandomPolicy",
    "RolloutPolicy",
    "SearchGains",
    "SectorSearchPolicy",
    "SwarmPolicy",
    "make",
]


POLICIES: dict[str, Callable[[Scenario], BatchPolicy]] = {
    "random": RandomPolicy,
    "parallel-sweep": ParallelSweepPolicy,
    "creeping-line": CreepingLinePolicy,
    "expanding-square": ExpandingSquarePolicy,
    "sector-search": SectorSearchPolicy,
    "greedy-matrix": GreedyPolicy,
    "greedy-posterior": PosteriorGreedyPolicy,
    "greedy-forecast": ForecastGreedyPolicy,
    "rollout": RolloutPolicy,
    "imitation": ImitationPolicy,
    "planner": PlannerPolicy,
}
"""The packaged policies by name, from the simplest to the strongest."""


def make(name: str, scenario: Scenario) -> BatchPolicy:
    """Make a policy by its name.

    Args:
        name: one of `POLICIES`.
        scenario: the parameters of every search to steer.

    Raises:
        TypeError: `name` is not text, or `scenario` is not a `Scenario`.
        ValueError: no policy has this name.
    """
    if not isinstance(name, str):
        raise TypeError(f"name must be one of {', '.join(POLICIES)}, got {name!r:.100}")
    if name not in POLICIES:
        raise ValueError(
            f"name must be one of {', '.join(POLICIES)}, got {name!r}"
            + did_you_mean(name, POLICIES)
        )
    return POLICIES[name](scenario)
