"""Search planning: plans for all drones (`joint_plan`), and the bound of the room `bound`."""

from DroneSwarmSearch.bound.success import SuccessBound, success_bound

__all__ = ["SuccessBound", "success_bound"]
