"""Upper bounds on the success of any policy."""

from DroneSwarmSearch.bound.frank_wolfe import frank_wolfe
from DroneSwarmSearch.bound.memory import RememberingDrones
from DroneSwarmSearch.bound.mirror_ascent import CHECKS, mirror_ascent
from DroneSwarmSearch.bound.objectives import MarkovChainObjective, TrajectoryObjective
from DroneSwarmSearch.bound.success import SuccessBound, success_bound
from DroneSwarmSearch.bound.trajectories import (
    Trajectories,
    chernoff_bound,
    enumerate_trajectories,
    equally_likely,
    sample_trajectories,
)

__all__ = [
    "CHECKS",
    "MarkovChainObjective",
    "RememberingDrones",
    "SuccessBound",
    "Trajectories",
    "TrajectoryObjective",
    "chernoff_bound",
    "enumerate_trajectories",
    "equally_likely",
    "frank_wolfe",
    "mirror_ascent",
    "sample_trajectories",
    "success_bound",
]
