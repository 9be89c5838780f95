"""The 2023 package's module: ``from DroneSwarmSearchEnvironment.env import DroneSwarmSearch``."""

from DroneSwarmSearch.env import DroneSwarmSearch, env, parallel_env

__all__ = ["DroneSwarmSearch", "env", "parallel_env"]
