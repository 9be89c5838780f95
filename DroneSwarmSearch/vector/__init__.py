"""Thousands of searches stepped together in NumPy, millions of steps a second in one process.

`SwarmVectorEnv` and `DroneVectorEnv` are Gymnasium vector environments around `SearchBatch`,
which works with plain arrays.
"""

from DroneSwarmSearch.vector.engine import Sampler, SearchBatch
from DroneSwarmSearch.vector.vector_env import DroneVectorEnv, SwarmVectorEnv

__all__ = ["DroneVectorEnv", "Sampler", "SearchBatch", "SwarmVectorEnv"]
