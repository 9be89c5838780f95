"""Search planning: plans for all drones, and an upper bound on the success of any policy."""

from DroneSwarmSearch.bound.success import SuccessBound, success_bound

__all__ = ["SuccessBound", "success_bound"]
