"""Search planning: plans for all drones (`plan`), and an upper bound on any success (`bound`)."""

from DroneSwarmSearch.bound.success import SuccessBound, success_bound

__all__ = ["SuccessBound", "success_bound"]
