"""PettingZoo wrappers that adapt the environment to RL libraries; they compose.

A typical stack:

    env = DroneSwarmSearch.example(bayesian_update=True)
    env = FlatObservation(ScaledRewards(SeparateFlags(env)))
    env = ActionMask(env, in_observation=True)

The environments in `DroneSwarmSearch.vector` offer the same through their arguments.
"""

from DroneSwarmSearch.wrappers.action_mask import ActionMask
from DroneSwarmSearch.wrappers.crops import CropsObservation
from DroneSwarmSearch.wrappers.dictionary import DictObservation
from DroneSwarmSearch.wrappers.flat import FlatObservation
from DroneSwarmSearch.wrappers.masks import action_masks
from DroneSwarmSearch.wrappers.other_drones import OtherDrones
from DroneSwarmSearch.wrappers.planes import PlanesObservation
from DroneSwarmSearch.wrappers.scaled_rewards import ScaledRewards
from DroneSwarmSearch.wrappers.separate_flags import SeparateFlags
from DroneSwarmSearch.wrappers.top_cells import TopCellsObservation

__all__ = [
    "ActionMask",
    "CropsObservation",
    "DictObservation",
    "FlatObservation",
    "OtherDrones",
    "PlanesObservation",
    "ScaledRewards",
    "SeparateFlags",
    "TopCellsObservation",
    "action_masks",
]
