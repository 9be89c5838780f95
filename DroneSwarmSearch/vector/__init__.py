"""Many searches stepped together in NumPy: thousands in one process, millions of steps a second.

`SwarmVectorEnv` and `DroneVectorEnv` are Gymnasium vector environments; `SearchBatch` is
the engine under them, arrays in and arrays out. `sb3` holds an adapter for
Stable-Baselines3, which is imported with that module alone.
"""

from DroneSwarmSearch.vector.engine import SearchBatch
from DroneSwarmSearch.vector.parameters import Sampler
from DroneSwarmSearch.vector.vector_env import Buffers, DroneVectorEnv, SwarmVectorEnv

__all__ = ["Buffers", "DroneVectorEnv", "Sampler", "SearchBatch", "SwarmVectorEnv"]
