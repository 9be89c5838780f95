"""Search planning: paths for all drones, and an upper bound on the success of any policy."""

from DroneSwarmSearch.bound.success import SuccessBound, success_bound
from DroneSwarmSearch.paths.best_paths import DronePath
from DroneSwarmSearch.planning.plan_paths import PathPlan, plan_paths

__all__ = ["DronePath", "PathPlan", "SuccessBound", "plan_paths", "success_bound"]
