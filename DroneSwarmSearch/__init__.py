"""Drones search a grid at sea for drifting shipwrecked persons: a PettingZoo ParallelEnv."""

from importlib import import_module
from typing import Any

import gymnasium

from DroneSwarmSearch._internal.errors import ResetNeeded
from DroneSwarmSearch.core.rules import Action, Ending, RewardScheme
from DroneSwarmSearch.core.scenario import Scenario
from DroneSwarmSearch.env import DroneSwarmSearch, parallel_env
from DroneSwarmSearch.geo.scale import Scale
from DroneSwarmSearch.persons.hypotheses import Drift
from DroneSwarmSearch.persons.markov import MarkovDrift
from DroneSwarmSearch.persons.person import Person
from DroneSwarmSearch.persons.tracks import Tracks

__all__ = [
    "Action",
    "Drift",
    "DroneSwarmSearch",
    "Ending",
    "MarkovDrift",
    "Person",
    "ResetNeeded",
    "RewardScheme",
    "Scale",
    "Scenario",
    "Tracks",
    "__version__",
    "parallel_env",
]

__version__ = "1.0.0"

_SUBMODULES = {
    name: name
    for name in (
        "drift",
        "drone_swarm_search_v0",
        "evaluation",
        "geo",
        "incident",
        "persons",
        "planning",
        "policies",
        "rendering",
        "single_drone_env",
        "training",
        "vector",
        "wrappers",
    )
} | {name: f"persons.{name}" for name in ("detection", "leeway", "priors", "survival")}


if "DroneSwarmSearch-v0" not in gymnasium.registry:  # it is there after a reload
    gymnasium.register(
        "DroneSwarmSearch-v0",
        entry_point=f"{__name__}.single_drone_env:SingleDroneEnv",
        vector_entry_point=f"{__name__}.single_drone_env:make_drones",
    )


def __getattr__(name: str) -> Any:
    """Import a submodule on first access, so that `import DroneSwarmSearch` stays fast."""
    if name in _SUBMODULES:
        return import_module(f"{__name__}.{_SUBMODULES[name]}")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*__all__, *_SUBMODULES})
