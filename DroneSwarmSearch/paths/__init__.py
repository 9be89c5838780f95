"""Paths of drones: the best one for given gains, and plans for all drones together."""

from DroneSwarmSearch.paths.best_paths import FORBIDDEN, DronePath, best_paths, values_to_go
from DroneSwarmSearch.paths.joint_plan import JointPlan
from DroneSwarmSearch.paths.passes import Passes, Target
from DroneSwarmSearch.paths.windows import Boxes, TargetWindow

__all__ = [
    "FORBIDDEN",
    "Boxes",
    "DronePath",
    "JointPlan",
    "Passes",
    "Target",
    "TargetWindow",
    "best_paths",
    "values_to_go",
]
