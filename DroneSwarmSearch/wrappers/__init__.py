"""PettingZoo wrappers that make the environment fit for trainers; they compose.

The usual stack, from the inside out:

    env = DroneSwarmSearch(n_drones=2, bayesian_update=True)
    env = FlatObservation(ScaledRewards(SeparateFlags(env)))
    env = ActionMask(env, in_observation=True)

The batched views of `DroneSwarmSearch.vector` offer the same by their arguments.
"""

from DroneSwarmSearch.wrappers.action_mask import ActionMask
from DroneSwarmSearch.wrappers.crops_observation import CropsObservation
from DroneSwarmSearch.wrappers.dict_observation import DictObservation
from DroneSwarmSearch.wrappers.flat_observation import FlatObservation
from DroneSwarmSearch.wrappers.masks import action_masks
from DroneSwarmSearch.wrappers.other_drones import OtherDrones
from DroneSwarmSearch.wrappers.planes_observation import PlanesObservation
from DroneSwarmSearch.wrappers.scaled_rewards import ScaledRewards
from DroneSwarmSearch.wrappers.separate_flags import SeparateFlags
from DroneSwarmSearch.wrappers.top_cells_observation import TopCellsObservation

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
