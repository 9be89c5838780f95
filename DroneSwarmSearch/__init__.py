"""Drones search a grid at sea for shipwrecked persons who drift: a PettingZoo ParallelEnv."""

from DroneSwarmSearch._internal.errors import ResetNeeded
from DroneSwarmSearch.env import DroneSwarmSearch, parallel_env
from DroneSwarmSearch.rules import Action, Ending, RewardScheme
from DroneSwarmSearch.scenario import Scenario

__all__ = [
    "Action",
    "DroneSwarmSearch",
    "Ending",
    "ResetNeeded",
    "RewardScheme",
    "Scenario",
    "__version__",
    "parallel_env",
]

__version__ = "1.0.0"
