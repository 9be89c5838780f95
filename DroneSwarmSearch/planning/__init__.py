"""Search planning: paths for all drones, the best ones, and bounds on the success of any policy."""

from DroneSwarmSearch.bound.success import SuccessBound, success_bound
from DroneSwarmSearch.paths.best_paths import DronePath
from DroneSwarmSearch.planning.optimum import Optimum, optimum
from DroneSwarmSearch.planning.plan_paths import PathPlan, plan_paths

__all__ = [
    "DronePath",
    "Optimum",
    "PathPlan",
    "SuccessBound",
    "optimum",
    "plan_paths",
    "success_bound",
]
